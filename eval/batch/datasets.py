"""Shapes to compare methods on: files, folders, lists, and data sets as they lie on a user's disk.

Nothing is downloaded. A source is a mesh file; a folder; a text file with one path a line (relative to the file; `#`
begins a comment); or one of these after the name of a layout, such as `toys4k:/data/toys4k_obj_files`.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from resfit.errors import InputError

from ...assembly.transform import Transform
from ...shape.formats import MESH_SUFFIXES
from ...shape.load import load_mesh
from ..metrics.surface_metrics import chamfer, draw_surface

LISTS = (".txt", ".lst", ".list")

SELECTION_POINTS = 1024
"""Points on a shape when shapes are told apart."""


@dataclass(frozen=True)
class Shape:
    """One mesh of a data set."""

    path: Path
    name: str
    """Unique among the shapes found together, and good as a file's name."""
    category: str = ""
    labels: Path | None = None
    """Where the data set has labels of the faces: a .npy file."""


def find_shapes(sources: Iterable[str | Path]) -> list[Shape]:
    """All shapes of several sources, in their order; none is named twice.

    Raises:
        InputError: if a source is not there, or a layout is unknown.
    """
    found: list[Shape] = []
    for source in sources:
        layout, path = _split(str(source))
        if path.is_dir():
            found += (LAYOUTS[layout] if layout else _guess(path))(path)
        elif path.suffix.lower() in LISTS and path.is_file():
            found += _read_list(path)
        else:
            # A mesh that is missing or broken is one failed shape among others, not the end of a comparison.
            found.append(Shape(path, path.stem))
    unique: dict[Path, Shape] = {}
    for shape in found:
        unique.setdefault(shape.path.resolve(), shape)
    return _named_apart(list(unique.values()))


def _split(source: str) -> tuple[str, Path]:
    """Layout, empty where none is given, and path."""
    head, colon, rest = source.partition(":")
    if colon and rest and not Path(source).exists() and re.fullmatch(r"[a-z0-9]{2,}", head):
        if head not in LAYOUTS:
            raise InputError(f"there is no layout '{head}'; known are {', '.join(LAYOUTS)}.")
        if not Path(rest).is_dir():
            raise InputError(f"there is no folder '{rest}'; give the folder in which the data set lies.")
        return head, Path(rest)
    return "", Path(source)


def _guess(folder: Path) -> Callable[[Path], list[Shape]]:
    """The layout of a folder by what lies in it; plain unless it is one of those known."""
    if next(folder.glob("*_mesh/*.glb"), None) and next(folder.glob("*_semantic.json"), None):
        return _partobjaverse
    if next(folder.glob("*/*_trimesh_*.obj"), None):
        return _abc
    if next(folder.glob("*/*_[0-9][0-9][0-9]/mesh.obj"), None):
        return _toys4k
    return _plain


def _plain(folder: Path) -> list[Shape]:
    """The meshes directly in a folder; if there are none, those anywhere below it."""
    direct = _meshes(folder.iterdir())
    return [Shape(path, path.stem) for path in direct or _meshes(folder.rglob("*"))]


def _toys4k(folder: Path) -> list[Shape]:
    """CATEGORY/CATEGORY_NNN/mesh.obj, or CATEGORY/CATEGORY_NNN.SUFFIX."""
    nested = _meshes(folder.glob("*/*/mesh.*"))
    if nested:
        return [Shape(path, path.parent.name, path.parent.parent.name) for path in nested]
    return [Shape(path, path.stem, path.parent.name) for path in _meshes(folder.glob("*/*"))]


def _generated(folder: Path) -> list[Shape]:
    """Outputs of a generator: one mesh a prompt, ID.SUFFIX, or the first mesh of each folder ID."""
    shapes = [Shape(path, path.stem) for path in _meshes(folder.iterdir())]
    for child in sorted(path for path in folder.iterdir() if path.is_dir()):
        shapes += [Shape(path, child.name) for path in _meshes(child.rglob("*"))[:1]]
    return shapes


def _abc(folder: Path) -> list[Shape]:
    """A chunk, or a subset of one: NNNNNNNN/NNNNNNNN_..._trimesh_NNN.obj, or such files directly."""
    paths = _meshes(folder.glob("*/*_trimesh_*.obj")) or _meshes(folder.glob("*.obj"))
    return [Shape(path, path.stem.partition("_")[0]) for path in paths]


def _partobjaverse(folder: Path) -> list[Shape]:
    """PartObjaverse-Tiny: NAME_mesh/UID.glb, NAME_semantic.json (category, then UID), NAME_semantic_gt/UID.npy."""
    category = {}
    for path in sorted(folder.glob("*_semantic.json")):
        try:
            entries = json.loads(path.read_text(encoding="utf-8"))
            category |= {uid: name for name, uids in entries.items() for uid in uids}
        except (OSError, ValueError, AttributeError, TypeError) as error:
            raise InputError(
                f"'{path}' does not name the shapes of each category; download it again."
            ) from error
    shapes = []
    for path in _meshes(folder.glob("*_mesh/*.glb")) or _meshes(folder.glob("*.glb")):
        labels = next(iter(sorted(folder.glob(f"*_semantic_gt/{path.stem}.npy"))), None)
        shapes.append(Shape(path, path.stem, category.get(path.stem, ""), labels))
    return shapes


LAYOUTS: dict[str, Callable[[Path], list[Shape]]] = {
    "folder": _plain,
    "toys4k": _toys4k,
    "3dgen": _generated,
    "abc": _abc,
    "partobjaverse": _partobjaverse,
}
"""How to find the shapes of a data set in its folder."""


def _read_list(path: Path) -> list[Shape]:
    shapes = []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        entry = line.partition("#")[0].strip()
        if entry:
            mesh = path.parent / entry
            shapes.append(Shape(mesh, mesh.stem))
    return shapes


def _meshes(paths: Iterable[Path]) -> list[Path]:
    return sorted(path for path in paths if path.suffix.lower() in MESH_SUFFIXES and path.is_file())


def _plain_name(name: str) -> str:
    """A name without what folders and tables stumble over."""
    return re.sub(r"[^\w.+-]+", "_", name).strip(".") or "shape"


def _named_apart(shapes: Sequence[Shape]) -> list[Shape]:
    """The same shapes; of those with equal names, each gets what tells it apart."""
    names = [_plain_name(shape.name) for shape in shapes]
    for further in (lambda path: path.suffix[1:], lambda path: path.resolve().parent.name):
        often = Counter(name.lower() for name in names)
        for index, shape in enumerate(shapes):
            if often[names[index].lower()] > 1:
                names[index] = f"{names[index]}_{_plain_name(further(shape.path))}"
    often, seen = Counter(name.lower() for name in names), Counter()
    for index, name in enumerate(names):
        seen[name.lower()] += 1
        if often[name.lower()] > 1:
            names[index] = f"{name}_{seen[name.lower()]}"
    return [replace(shape, name=name) for shape, name in zip(shapes, names, strict=True)]


def select_diverse(
    shapes: Sequence[Shape], count: int, on_shape: Callable[[Shape, str], None] | None = None
) -> list[Shape]:
    """`count` shapes as unlike each other as can be had step by step, by Chamfer distance; in the given order.

    Farthest-point selection: the first shape, then again and again the one that is farthest from all chosen so far.
    Each shape counts by points on its surface, its box centred and its longest side 1.8.

    Args:
        shapes: to choose from; those that cannot be read are left out.
        count: how many; all that can be read, if there are no more.
        on_shape: called with each shape that is left out, and why.
    """
    clouds, readable = [], []
    for shape in shapes:
        try:
            mesh = load_mesh(shape.path)
        except InputError as error:
            if on_shape is not None:
                on_shape(shape, str(error))
            continue
        frame = Transform.from_bounds(mesh.vertices.min(axis=0), mesh.vertices.max(axis=0))
        source = np.random.default_rng(0)
        clouds.append(draw_surface(frame.to_normalised(mesh.vertices), mesh.faces, SELECTION_POINTS, source))
        readable.append(shape)
    return [readable[index] for index in sorted(farthest_clouds(clouds, count))]


def farthest_clouds(clouds: Sequence[np.ndarray], count: int) -> list[int]:
    """Indices of `count` of the clouds (n, 3) by farthest-point selection, in the order of selection."""
    chosen: list[int] = []
    nearest = np.full(len(clouds), np.inf)
    while len(chosen) < min(count, len(clouds)):
        # The first of equals, hence at the beginning the first of all.
        index = int(np.argmax(nearest))
        chosen.append(index)
        nearest[index] = -1.0
        for other in np.flatnonzero(nearest >= 0.0).tolist():
            nearest[other] = min(nearest[other], chamfer(clouds[index], clouds[other]))
    return chosen
