"""Same bytes: one mesh fitted again, on other threads and locales, in other formats, moved, scaled and shuffled.

Wrong: another assembly.json where nothing but the surroundings changed; another shape where the mesh is the same but
for its format, order, unit or place (IoU further off than fits of different sampling are).
"""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from fuzz.campaigns import shuffled
from fuzz.commands import check_code, check_folder, fit_command, run
from fuzz.harness import Campaign, Case, Wrong
from fuzz.samples import obj

if TYPE_CHECKING:
    import trimesh

IOU_SLACK = 0.02
"""Other vertices mean other samples; the fit is as good all the same."""

SURROUNDINGS: dict[str, dict[str, str | None]] = {
    "again": {},
    "1 thread": {"RESFIT_THREADS": "1"},
    "4 threads": {"RESFIT_THREADS": "4"},
    "hash seed 1": {"PYTHONHASHSEED": "1"},
    "hash seed 77": {"PYTHONHASHSEED": "77"},
    "locale C": {"LC_ALL": "C"},
    "other home": {"HOME": "/nonexistent", "WARP_CACHE_PATH": str(Path.home() / ".cache" / "warp")},
    "one core": {},
}

FORMATS = ("stl", "ply", "obj", "off", "glb")
MOVES: dict[str, tuple[float, float]] = {
    "x 1e3": (1e3, 0.0),
    "x 1e-3": (1e-3, 0.0),
    "x 1e-9": (1e-9, 0.0),
    "x 1e12": (1e12, 0.0),
    "+ 1e3 sizes": (1.0, 1e3),
    "+ 1e5 sizes": (1.0, 1e5),
}
"""Factor, and shift in sizes of the mesh."""

ORDERS = ("faces shuffled", "corners turned", "vertices shuffled")


@cache
def whole() -> trimesh.Trimesh:
    """A mesh of several parts whose coordinates are float32, so that every format can hold them."""
    import numpy as np
    import trimesh

    tube = trimesh.creation.annulus(0.4, 1.0, 0.7)
    box = trimesh.creation.box((1, 2, 0.5)).apply_translation((1.5, 0.25, 0.1))
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.6).apply_translation((-1.2, 0.5, 0.3))
    mesh = trimesh.util.concatenate([tube, box, ball])
    return trimesh.Trimesh(
        np.asarray(mesh.vertices, np.float32).astype(np.float64), mesh.faces, process=False
    )


def varied(name: str) -> trimesh.Trimesh:
    """The same mesh, moved, scaled or in another order."""
    import numpy as np
    import trimesh

    mesh = whole().copy()
    rng = np.random.default_rng(0)
    if name in MOVES:
        factor, sizes = MOVES[name]
        shift = sizes * float(np.ptp(mesh.vertices, axis=0).max()) * np.array([1.0, -0.5, 0.25])
        mesh.vertices = mesh.vertices * factor + shift
    elif name == "faces shuffled":
        mesh.faces = mesh.faces[rng.permutation(len(mesh.faces))]
    elif name == "corners turned":
        mesh.faces = np.roll(mesh.faces, 1, axis=1)
    else:
        order = rng.permutation(len(mesh.vertices))
        mesh = trimesh.Trimesh(mesh.vertices[order], np.argsort(order)[mesh.faces], process=False)
    return mesh


def fitted(
    mesh: trimesh.Trimesh, suffix: str, folder: Path, environment: Any = None, prefix: tuple[str, ...] = ()
) -> Path:
    """Write a mesh and fit it; the folder of the fit."""
    path, out = folder / f"m.{suffix}", folder / "out"
    if suffix == "obj":
        # trimesh rounds to so many places behind the point, whatever the size.
        path.write_bytes(obj(mesh.vertices.tolist(), (mesh.faces + 1).tolist()))
    else:
        mesh.export(path, **({"digits": 17} if suffix == "off" else {}))
    done = run([*prefix, *fit_command(path, out)], folder, environment)
    check_code(done, (0,))
    check_folder(done, out)
    return out


def told(out: Path) -> tuple[bytes, float, list[Any]]:
    """(assembly.json, IoU, its parts) of a fit."""
    data = (out / "assembly.json").read_bytes()
    iou = json.loads((out / "report.json").read_text())["metrics"]["iou"]
    return data, iou, json.loads(data)["primitives"]


@cache
def reference(suffix: str) -> tuple[bytes, float, list[Any]]:
    """What a fit as usual gives."""
    with TemporaryDirectory(prefix="resfit-fuzz-same-") as folder:
        return told(fitted(whole(), suffix, Path(folder)))


def cases(rng: random.Random) -> Iterator[Case]:
    """All of them once."""
    names = [*(f"surroundings {name}" for name in SURROUNDINGS), *(f"format {name}" for name in FORMATS)]
    return shuffled(rng, [Case(name) for name in [*names, *(f"mesh {name}" for name in (*MOVES, *ORDERS))]])


def attempt(case: Case, folder: Path) -> str:
    """One fit, compared with the usual one."""
    kind, _, name = case.name.partition(" ")
    return CHECKS[kind](name, folder)


def check_surroundings(name: str, folder: Path) -> str:
    """The same file: the same bytes."""
    prefix = ("taskset", "-c", "0") if name == "one core" else ()
    data, *_ = told(fitted(whole(), "stl", folder, SURROUNDINGS[name], prefix))
    if data != reference("stl")[0]:
        raise Wrong("assembly.json has other bytes")
    return "same bytes"


def check_format(name: str, folder: Path) -> str:
    """The same triangles: as good a fit."""
    return check_iou(told(fitted(whole(), name, folder)), reference("obj"))


def check_mesh(name: str, folder: Path) -> str:
    """The same mesh elsewhere or in another order: as good a fit."""
    return check_iou(told(fitted(varied(name), "obj", folder)), reference("obj"))


def check_iou(found: tuple[bytes, float, list[Any]], usual: tuple[bytes, float, list[Any]]) -> str:
    """How far a fit is from the usual one."""
    if abs(found[1] - usual[1]) > IOU_SLACK:
        raise Wrong(
            f"IoU {found[1]:.4f} with {len(found[2])} parts instead of {usual[1]:.4f} with {len(usual[2])}"
        )
    return f"IoU {found[1]:.4f}, usually {usual[1]:.4f}; the same parts: {found[2] == usual[2]}"


CHECKS: dict[str, Callable[[str, Path], str]] = {
    "surroundings": check_surroundings,
    "format": check_format,
    "mesh": check_mesh,
}

CAMPAIGN = Campaign("same-bytes", cases, attempt, hang_s=180.0)
