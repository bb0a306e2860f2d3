"""Assemblies: damaged and hostile assembly.json, what loads is saved again and exported in every format.

Wrong: other bytes when saved again; an export that holds other names, shapes or numbers that are not finite; markup of
a name in a page; files beside the one asked for.
"""

from __future__ import annotations

import html.parser
import json
import random
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from fuzz.assembly_cases import GOOD, document_cases, mutated, number_cases, text_of
from fuzz.campaigns import shuffled
from fuzz.harness import Campaign, Case, Wrong

if TYPE_CHECKING:
    from resfit import Assembly

EXPORTS: tuple[tuple[str, Mapping[str, Any]], ...] = (
    (".glb", {"merged": False}), (".glb", {"merged": True}), (".obj", {"merged": False}), (".ply", {"merged": True}),
    (".stl", {"merged": False}), (".ply", {"merged": False}), (".html", {}),
)  # fmt: skip

RESOLUTION = 12
MANY_PARTS, MANY_PARTS_OF_A_PAGE = 100, 1100
"""Assemblies of more are not exported here: it would take long, as it should."""

EXPORTED = 20
"""Of the mutated ones, each so manieth is exported."""


def cases(rng: random.Random) -> Iterator[Case]:
    """All by hand, then mutated ones for ever."""
    yield from shuffled(rng, [*document_cases(), *number_cases()])
    for number in count():
        how, data = mutated(rng)
        yield Case(f"mutated {number} {how}", data, "json")


def attempt(case: Case, folder: Path) -> str:
    """Load one, save it again, and export it."""
    from resfit import Assembly

    path = folder / "assembly.json"
    path.write_bytes(case.data)
    assembly = Assembly.load(path)
    again = assembly.to_json()
    if Assembly.from_json(again).to_json() != again or Assembly.from_json(again) != assembly:
        raise Wrong("saved, loaded and saved again, it has other bytes")
    kind, number, *_ = [*case.name.split(), ""]
    if kind == "mutated" and int(number) % EXPORTED:
        return "loaded"
    return f"loaded, {export_all(assembly, folder)} exports"


def export_all(assembly: Assembly, folder: Path) -> int:
    """Write all formats, each of which may be refused; how many were written."""
    from resfit import export
    from resfit.errors import InputError

    written = 0
    for suffix, options in EXPORTS:
        page = suffix == ".html"
        if len(assembly.primitives) > (MANY_PARTS_OF_A_PAGE if page else MANY_PARTS):
            continue
        out = folder / f"out{suffix}"
        try:
            export(assembly, out, device="cpu", resolution=RESOLUTION, **options)
        except InputError:
            if out.exists():
                raise Wrong(f"{suffix} was refused, but is there") from None
            continue
        check_page(out, assembly) if page else check_mesh(out, assembly, options)
        out.unlink()
        written += 1
    strange = sorted(path.name for path in folder.iterdir() if path.name != "assembly.json")
    if strange:
        raise Wrong(f"exports left {strange}")
    return written


def check_mesh(out: Path, assembly: Assembly, options: Mapping[str, Any]) -> None:
    """Read an export back, and compare."""
    import numpy as np
    import trimesh

    if out.suffix == ".glb":
        check_glb(out.read_bytes(), assembly, bool(options["merged"]))
    scene = trimesh.load_scene(out, process=False)
    meshes = [mesh for mesh in scene.geometry.values() if isinstance(mesh, trimesh.Trimesh)]
    if not all(np.isfinite(mesh.vertices).all() for mesh in meshes):
        raise Wrong(f"{out.suffix} holds coordinates that are not finite")
    if out.suffix == ".obj":
        parts = [mesh for mesh in assembly.part_meshes(resolution=RESOLUTION) if len(mesh.faces)]
        expected, found = (sum(len(mesh.faces) for mesh in some) for some in (parts, meshes))
        if found != expected:
            raise Wrong(f"the OBJ reads back with {found} faces instead of {expected}")
        with np.errstate(all="ignore"):
            volumes = [sum(float(mesh.volume) for mesh in some) for some in (parts, meshes)]
        if np.isfinite(volumes).all() and not np.isclose(*volumes, rtol=1e-3, atol=1e-5):
            raise Wrong(f"the OBJ reads back with a volume of {volumes[1]} instead of {volumes[0]}")


def check_glb(content: bytes, assembly: Assembly, merged: bool) -> None:
    """The document of a GLB is JSON, with the names of the parts."""

    def refuse(name: str) -> None:
        raise Wrong(f"{name} in the document of the GLB")

    size = int.from_bytes(content[12:16], "little")
    document = json.loads(content[20 : 20 + size], parse_constant=refuse)
    names = [part.name for part in assembly.primitives]
    nodes = [node.get("name") for node in document["nodes"]]
    if not merged and not Counter(names) <= Counter(nodes):
        raise Wrong(f"the GLB has other names: {nodes[:4]!a}")


class Page(html.parser.HTMLParser):
    """Counts what a browser would make of a page."""

    def __init__(self) -> None:
        """Nothing has been read."""
        super().__init__(convert_charrefs=True)
        self.found: Counter[str] = Counter()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Count the tag, and its attributes that run code."""
        self.found[tag] += 1
        self.found.update(name for name, _ in attrs if name.startswith("on"))


def tags_of(text: str) -> Counter[str]:
    """Tags and event attributes of a page."""
    page = Page()
    page.feed(text)
    return page.found


@cache
def plain_tags() -> Counter[str]:
    """Those of the page of an assembly with plain names."""
    from resfit import Assembly, export

    with TemporaryDirectory() as folder:
        export(Assembly.from_json(text_of(GOOD)), Path(folder) / "plain.html")
        return tags_of((Path(folder) / "plain.html").read_text())


def check_page(out: Path, assembly: Assembly) -> None:
    """A page holds no tag more than that of plain names, and the names as they are."""
    text = out.read_text()
    more = tags_of(text) - plain_tags()
    if more:
        raise Wrong(f"there is markup in the page: {dict(more)}")
    begin = text.find('<script type="application/json"')
    if begin < 0:
        return
    inner = text[text.index(">", begin) + 1 : text.index("</script>", begin)]
    names = [part["name"] for part in json.loads(inner)["primitives"]]
    if names != [part.name for part in assembly.primitives]:
        raise Wrong(f"the page has other names: {names[:4]!a}")


CAMPAIGN = Campaign("assemblies", cases, attempt)
