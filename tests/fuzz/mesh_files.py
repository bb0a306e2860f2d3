"""Mesh files: damaged, with headers that lie, hostile glTF, OBJ, archives and XML, and paths that are no files.

Each is read and, if it is small, made into a target. Wrong: a target with NaN, a file written elsewhere.
"""

from __future__ import annotations

import os
import random
from collections.abc import Callable, Iterator
from functools import cache
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from fuzz.archive_cases import archive_cases, xml_cases
from fuzz.campaigns import shuffled
from fuzz.damage import damaged_bytes, damaged_gltf
from fuzz.gltf_cases import gltf_cases
from fuzz.harness import Campaign, Case, Wrong
from fuzz.mesh_cases import file_cases
from fuzz.samples import CORNERS, gltf, good_files, obj, put, stl, tetrahedron

if TYPE_CHECKING:
    import warp as wp

MEASURED_FACES = 20000
"""Larger meshes are only read: measuring them takes long, as it should."""

NAMES = (
    b"\xff\xfe.stl", b"\xe4.obj", b"a\nb.stl", b"a b.stl", "\U0001f984.stl".encode(), b"x" * 240 + b".stl", b"-o.stl",
    b"~.stl", b"%s{0}.stl", b"A.STL", b".stl", b"a.stl.", b"a.", b"a",
)  # fmt: skip


def cases(rng: random.Random) -> Iterator[Case]:
    """Every hostile file once, with as many damaged ones between them; then damaged ones for ever."""
    by_hand = [*file_cases(), *gltf_cases(), *archive_cases(), *xml_cases()]
    by_hand += [Case(f"path {name}") for name in PATHS] + [Case(f"name {name!r}") for name in NAMES]
    good = good_files()
    last = iter(shuffled(rng, by_hand))
    for number in count():
        yield from [case for case in (next(last, None),) if case]
        original = rng.choice(good)
        if original.suffix in ("glb", "gltf") and rng.random() < 0.3:
            how, data = "document", damaged_gltf(rng, original.data, original.suffix)
        else:
            how, data = damaged_bytes(rng, original.data)
        yield Case(f"damaged {number} {original.suffix} {how}", data, original.suffix)


def attempt(case: Case, folder: Path) -> str:
    """Read one file, and measure what it holds."""
    from resfit.shape.load import load_mesh
    from resfit.shape.target import make_target

    kind, _, name = case.name.partition(" ")
    if kind == "path":
        path = PATHS[name](folder)
    elif kind == "name":
        path = named(folder, next(raw for raw in NAMES if repr(raw) == name))
    else:
        path = folder / f"m.{case.suffix}"
        path.write_bytes(case.data)
    before = set(os.listdir(os.fsencode(folder)))
    mesh = load_mesh(path)
    if set(os.listdir(os.fsencode(folder))) != before or Path("/tmp/slipped.stl").exists():
        raise Wrong(f"reading it wrote {sorted(set(os.listdir(os.fsencode(folder))) - before)} or elsewhere")
    if len(mesh.faces) < MEASURED_FACES:
        target = make_target(mesh, device(), 32, 1000)
        if not (target.grid == target.grid).all():
            raise Wrong("there are NaN in the target's grid")
    return f"{len(mesh.faces)} faces"


@cache
def device() -> wp.Device:
    """The CPU: GPUs allocate address space that the worker does not have."""
    from resfit.kernels.runtime.launch import choose_device

    return choose_device("cpu")


def named(folder: Path, name: bytes) -> Path:
    """A good mesh under an odd name."""
    path = folder / os.fsdecode(name)
    path.write_bytes(obj(CORNERS) if name.endswith(b".obj") else stl(tetrahedron()))
    return path


def special(name: str, make: Callable[[Path], object]) -> Callable[[Path], Path]:
    """Makes something in a folder that is no plain file, and returns its path."""

    def made(folder: Path) -> Path:
        make(folder / name)
        return folder / name

    return made


def link(target: str) -> Callable[[Path], Path]:
    """A symbolic link."""
    return special("link.obj", lambda path: path.symlink_to(target))


def with_buffer(make: Callable[[Path], object]) -> Callable[[Path], Path]:
    """A glTF file whose buffer, beside it, is something else."""

    def made(folder: Path) -> Path:
        make(folder / "buffer.bin")
        (folder / "m.gltf").write_bytes(gltf(put("buffers", 0, "uri", "buffer.bin")))
        return folder / "m.gltf"

    return made


PATHS: dict[str, Callable[[Path], Path]] = {
    "folder": special("folder.stl", Path.mkdir),
    "pipe": special("pipe.stl", os.mkfifo),
    "link to itself": link("link.obj"),
    "link to nothing": link("nowhere.obj"),
    "link to /dev/zero": link("/dev/zero"),
    "link to /etc/passwd": link("/etc/passwd"),
    "link to memory": link("/proc/self/mem"),
    "name too long": lambda folder: folder / ("y" * 300 + ".stl"),
    "name with zero": lambda folder: folder / "a\0b.stl",
    "missing": lambda folder: folder / "missing.stl",
    "below a file": lambda folder: named(folder, b"A.stl") / "x.stl",
    "empty": lambda folder: Path(""),
    "buffer is a pipe": with_buffer(os.mkfifo),
    "buffer is a folder": with_buffer(Path.mkdir),
    "buffer is a link": with_buffer(lambda path: path.symlink_to("/etc/passwd")),
    "buffer is /dev/zero": with_buffer(lambda path: path.symlink_to("/dev/zero")),
}

CAMPAIGN = Campaign("mesh-files", cases, attempt)
