"""Reading what is to be scored: an assembly, its file or folder, or a mesh or scene of parts by any other tool.

Of a scene with several nodes each node is a part. Of anything else each connected body is: by shared vertices if the
bodies so found are closed, else by shared places.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from resfit.errors import InputError

from ...assembly.assembly import Assembly
from ...assembly.transform import Transform
from ...shape.formats import read_mesh_file
from ...shape.formats.mesh_file import Piece
from ...shape.load import check_arrays, load_mesh
from ...shape.topology import connected_labels, find_edges, is_balanced
from .prediction import AssemblyPrediction, Prediction, box_alignment, moved
from .prediction_parts import PartMesh, PartsPrediction

if TYPE_CHECKING:
    import trimesh

FLAT = 1e-9
"""A part whose volume is a smaller share of its longest side's cube is convex only because it is flat."""

NO_FACES = "holds no faces; a prediction is an assembly, or meshes of its parts."


@dataclass(frozen=True)
class PartFile:
    """Meshes of parts in the frame they came in."""

    parts: tuple[PartMesh, ...]
    floats: int
    """Numbers that store them: three a vertex, and three a face unless the part is the convex hull of its vertices."""
    notes: tuple[str, ...] = ()

    def placed(self, motion: Transform | None, frame: Transform) -> list[PartMesh]:
        """The parts, moved by `motion` if given, in the normalised frame `frame`."""
        meshes = []
        for part in self.parts:
            points = part.vertices if motion is None else motion.to_mesh(part.vertices)
            meshes.append(PartMesh(frame.to_normalised(points), part.faces))
        return meshes


Source = Assembly | PartFile


def read_prediction(source: Any) -> Source:
    """An assembly, or meshes of parts.

    Args:
        source: an Assembly, an assembly.json, a folder that holds one, a mesh file, a trimesh object, or a sequence of
            trimesh meshes.

    Raises:
        InputError: if it cannot be read or is none of these.
    """
    if isinstance(source, Assembly):
        return source
    if isinstance(source, str | PathLike):
        path = Path(source)
        if path.is_dir() or path.suffix.lower() == ".json":
            return Assembly.load(path / "assembly.json" if path.is_dir() else path)
        pieces, notes = _open_pieces(path)
        return _parts_of(pieces, f"'{path}'", notes)
    if isinstance(source, Sequence):
        return _parts_of([(f"part {index}", mesh) for index, mesh in enumerate(source)], "the prediction")
    return _parts_of(_nodes(source, "the prediction"), "the prediction")


def place(
    source: Source, frame: Transform, device: str = "auto", onto: tuple[np.ndarray, np.ndarray] | None = None
) -> tuple[Prediction, str]:
    """A prediction in the normalised frame of a target, and what was done to bring it there.

    Args:
        source: what `read_prediction` gave.
        frame: the target's.
        device: `auto`, `cpu`, `cuda:0`.
        onto: corners (3,) each of the target's box, mesh units, if the prediction's box is to be mapped onto it.
    """
    motion, sentence = None, ""
    if onto is not None:
        box = _own_box(source, device)
        if box is not None:
            motion = box_alignment(*box, *onto)
            shift = ", ".join(f"{value:g}" for value in motion.translation)
            sentence = f"The prediction was scaled by {motion.scale:g} and then moved by ({shift})."
    if isinstance(source, Assembly):
        assembly = source if motion is None else moved(source, motion)
        return AssemblyPrediction(assembly, frame, device), sentence
    return PartsPrediction(source.placed(motion, frame), source.floats, device), sentence


def _own_box(source: Source, device: str) -> tuple[np.ndarray, np.ndarray] | None:
    """Corners (3,) each of a prediction's box in its own mesh units; None if it has no extent."""
    if isinstance(source, Assembly):
        alone = AssemblyPrediction(source, source.transform, device)
        lower, upper = source.transform.to_mesh(np.stack([alone.lower, alone.upper]))
    elif source.parts:
        lower = np.min([part.vertices.min(axis=0) for part in source.parts], axis=0)
        upper = np.max([part.vertices.max(axis=0) for part in source.parts], axis=0)
    else:
        return None
    return (lower, upper) if (upper - lower).max() > 0.0 else None


def _open_pieces(path: Path) -> tuple[list[tuple[str, Piece]], tuple[str, ...]]:
    """Named pieces with faces of a mesh file, in the order of their names, and what was left out of it."""
    if not path.is_file() or not path.stat().st_size:
        # Raises the sentence that fits.
        load_mesh(path)
    file, name = read_mesh_file(path), f"'{path}'"
    pieces = [(piece.name, piece) for piece in file.pieces if len(piece.faces)]
    if not pieces:
        raise InputError(f"{name} {NO_FACES}")
    for _, piece in pieces:
        check_arrays(piece.vertices, piece.faces, name)
    return sorted(pieces, key=lambda named: _natural(named[0])), file.notes


def _nodes(source: Any, name: str) -> list[tuple[str, trimesh.Trimesh]]:
    """(name, mesh in the scene's frame) of all nodes with faces, in the order of their names."""
    if not hasattr(source, "graph"):
        return [("mesh", source)]
    found = []
    for node in sorted(source.graph.nodes_geometry, key=_natural):
        matrix, geometry = source.graph[node]
        mesh = source.geometry[geometry]
        if len(getattr(mesh, "faces", ())):
            found.append((str(node), mesh.copy().apply_transform(matrix)))
    if not found:
        raise InputError(f"{name} {NO_FACES}")
    return found


def _natural(name: str) -> list[tuple[int, str]]:
    """Sorts part_2 before part_10."""
    # Longer numbers than int() takes are no numbers of parts.
    return [
        (int(piece), "") if piece.isdecimal() and len(piece) < 20 else (-1, piece)
        for piece in re.split(r"(\d+)", str(name))
    ]


def _parts_of(nodes: Sequence[tuple[str, Any]], name: str, notes: tuple[str, ...] = ()) -> PartFile:
    pieces: list[tuple[np.ndarray, np.ndarray]] = []
    for _, mesh in nodes:
        if not hasattr(mesh, "faces"):
            raise InputError(
                f"{name} is a {type(mesh).__name__}; give an Assembly, a path, or meshes of trimesh."
            )
        vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
        pieces += [(vertices, faces)] if len(nodes) > 1 else _split_bodies(vertices, faces, name)
    parts, floats, flat = [], 0, 0
    for vertices, faces in pieces:
        try:
            welded = _weld(vertices, faces)
        except InputError:
            if len(pieces) == 1:
                raise
            flat += 1
            continue
        parts.append(welded)
        floats += 3 * len(welded.vertices) + (0 if is_convex(welded) else 3 * len(welded.faces))
    if flat:
        what, were = ("part", "was") if flat == 1 else ("parts", "were")
        notes = (*notes, f"{flat} {what} of {name} without area {were} left out.")
    return PartFile(tuple(parts), floats, notes)


def _weld(vertices: np.ndarray, faces: np.ndarray) -> PartMesh:
    import trimesh

    loaded = load_mesh(trimesh.Trimesh(vertices, faces, process=False))
    return PartMesh(loaded.vertices, loaded.faces)


def _split_bodies(vertices: np.ndarray, faces: np.ndarray, name: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Connected bodies of a mesh (n, 3), (m, 3), by their first faces; cavities go with what is round them."""
    if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{name} holds no faces, or a face names a vertex that is not there.")
    labels = _labels(faces)
    if labels.max() == 0 or not all(is_balanced(find_edges(faces[group])) for group in _groups(labels)):
        # Vertices of their own for each face or normal: bodies are then what hangs together in space.
        welded = _weld(vertices, faces)
        vertices, faces = welded.vertices, welded.faces
        labels = _labels(faces)
    bodies = [faces[group] for group in _groups(labels)]
    return [(vertices, body) for body in _with_cavities(vertices, bodies)]


def _labels(faces: np.ndarray) -> np.ndarray:
    """Body (m,) of each face, numbered by first appearance: faces that share a vertex are of one body."""
    size = int(faces.max()) + 1
    corner = connected_labels(
        np.concatenate([faces[:, 0], faces[:, 1]]), np.concatenate([faces[:, 1], faces[:, 2]]), size
    )
    _, first, label = np.unique(corner[faces[:, 0]], return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[label]


def _groups(labels: np.ndarray) -> list[np.ndarray]:
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.cumsum(np.bincount(labels))[:-1])


def _with_cavities(vertices: np.ndarray, bodies: list[np.ndarray]) -> list[np.ndarray]:
    """Bodies, each with the closed inverted ones in its box added: of several boxes, to the smallest."""
    corners = [vertices[body] for body in bodies]
    volume = np.array([np.einsum("ij,ij->", c[:, 0], np.cross(c[:, 1], c[:, 2])) for c in corners])
    lower = np.array([c.min(axis=(0, 1)) for c in corners])
    upper = np.array([c.max(axis=(0, 1)) for c in corners])
    extent = (upper - lower).prod(axis=1)
    result: list[list[np.ndarray]] = [[body] for body in bodies]
    for index in np.flatnonzero(volume < 0.0):
        around = (lower <= lower[index]).all(axis=1) & (upper >= upper[index]).all(axis=1) & (volume > 0.0)
        if around.any() and is_balanced(find_edges(bodies[index])):
            holder = np.flatnonzero(around)[extent[around].argmin()]
            result[holder].append(bodies[index])
            result[index] = []
    return [np.concatenate(group) for group in result if group]


def is_convex(part: PartMesh) -> bool:
    """Convexity test: True if a part is the convex hull of its vertices, so that these say it all."""
    a, b, c = (part.vertices[part.faces[:, corner]] - part.vertices[0] for corner in range(3))
    volume = abs(float(np.einsum("ij,ij->", a, np.cross(b, c)))) / 6.0
    side = float(np.ptp(part.vertices, axis=0).max())
    if volume <= FLAT * side**3 or not is_balanced(find_edges(part.faces)):
        return False
    import trimesh

    return bool(trimesh.Trimesh(part.vertices, part.faces, process=False).is_convex)
