"""HTML: one self-contained page that draws the exact field of an assembly and edits its numbers, offline.

The page's sources lie in `page/`; the GLSL of families, and of what combines them, comes from the kernels' own
files. What is put in is text or JSON, never
markup, and the page's own policy lets it send no request.
"""

from __future__ import annotations

import html
import json
import math
import re
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from resfit.errors import InputError

from ..assembly.assembly import Assembly
from ..assembly.atomic_write import write_bytes
from ..assembly.document import FORMAT, VERSION
from ..kernels.field.combine import GLSL as COMBINE_GLSL
from ..kernels.primitives import FAMILIES, Family
from .exporter import Exporter
from .overlay import Surface, mesh_table

SCRIPTS = (
    "model.js", "spheres.js", "glsl.js", "overlay.js", "render.js", "camera.js", "fields.js", "panel.js", "keys.js",
    "main.js",
)  # fmt: skip
"""In the order in which they are read; each uses names of those before it."""

MAX_PARTS = 1024
"""Parts a page can draw: each ray keeps one bit a part."""


def write_html(
    assembly: Assembly,
    path: str | Path,
    *,
    mesh: Surface | None = None,
    up: Literal["y", "z"] = "y",
    title: str | None = None,
    facts: Sequence[str] = (),
) -> None:
    """Write the page of an assembly, at once or not at all.

    Args:
        assembly: what to show and edit.
        path: of the page.
        mesh: the input, in its own frame, to be shown over the assembly.
        up: what points up at first.
        title: shown above the list of parts; the name of the file or of its folder unless given.
        facts: sentences about where the assembly came from, shown below the title.

    Raises:
        InputError: if there are more than MAX_PARTS parts, or the file cannot be written.
    """
    path = Path(path)
    folder = path.absolute().parent.name.removesuffix(".resfit")
    name = folder if path.stem in ("viewer", "index") and folder else path.stem
    text = page_text(assembly, mesh=mesh, up=up, title=title or name, facts=facts)
    # Names of files and folders may be no Unicode.
    write_bytes(path, text.encode("utf-8", "replace"))


def page_text(
    assembly: Assembly,
    *,
    mesh: Surface | None = None,
    up: Literal["y", "z"] = "y",
    title: str = "assembly",
    facts: Sequence[str] = (),
) -> str:
    """The page as text; see `write_html`."""
    count = len(assembly.primitives)
    if count > MAX_PARTS:
        raise InputError(
            f"a page shows at most {MAX_PARTS} parts; this assembly has {count}. Use --top {MAX_PARTS}."
        )
    names = sorted({primitive.family for primitive in assembly.primitives})
    document = json.loads(assembly.to_json())
    # Kept as text: a seed may have more digits than JavaScript's numbers.
    provenance = json.dumps(document["provenance"], sort_keys=True)
    data = {
        "title": title,
        "facts": list(facts),
        "most": MAX_PARTS,
        "up": up,
        "format": FORMAT,
        "version": VERSION,
        "transform": document["transform"],
        "primitives": document["primitives"],
        "provenance": provenance,
        "families": {name: _family_table(FAMILIES[name]) for name in names},
        "combine": COMBINE_GLSL,
        "shader": _shader_text(names, count),
        "mesh": None if mesh is None else mesh_table(mesh, assembly),
    }
    parts = {
        "TITLE": html.escape(title),
        "STYLE": source("style.css"),
        "DATA": embedded(data),
        "SCRIPT": script_text(names),
    }
    # All at once, so that nothing that was put in is looked at again.
    return re.sub(r"\{\{([A-Z]+)\}\}", lambda found: parts[found[1]], source("page.html"))


def source(name: str) -> str:
    """A file of `page/`, which lies in this package."""
    return files("resfit.exports").joinpath("page", name).read_text(encoding="utf-8")


def script_text(names: list[str]) -> str:
    """The page's script: the model, what the families say of their boxes and steps, and all the rest."""
    geometry = ",\n".join(f"{name}: {FAMILIES[name].javascript.strip()}" for name in names)
    model, *rest = (source(name) for name in SCRIPTS)
    return "\n".join([model, f"const GEOMETRY = {{\n{geometry}\n}};", *rest])


def embedded(data: Any) -> str:
    """JSON that may stand in a script element: nothing in it can end that element, or begin a comment."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _family_table(family: Family) -> dict[str, Any]:
    """Slider settings of a family; an open end of a range is None."""
    return {
        "glsl": family.glsl,
        "approximate": family.approximate,
        "parameters": [
            {
                "name": parameter.name,
                "description": parameter.description,
                "unit": parameter.unit,
                "count": parameter.count,
                "slider": list(parameter.slider),
                "legal": [value if math.isfinite(value) else None for value in parameter.legal],
            }
            for parameter in family.parameters
        ],
    }


def _shader_text(names: list[str], part_count: int) -> str:
    """The fragment shader: the families' own texts, the choice between them, and the tracer."""
    cases = [f"  if (family == {index}) return sdf_{name}(p, s);" for index, name in enumerate(names)]
    return "\n".join(
        [
            "#version 300 es",
            "precision highp float;",
            "precision highp int;",
            "precision highp sampler2D;",
            f"#define WORDS {max(1, -(-part_count // 32))}",
            COMBINE_GLSL,
            *(FAMILIES[name].glsl for name in names),
            "float family_distance(int family, vec3 p, float s[8]) {",
            *cases,
            "  return 1e30;",
            "}",
            source("trace.glsl"),
        ]
    )


EXPORTER = Exporter((".html",), write_html)
