"""Reading meshes: any format, scenes flattened, vertices welded.

Everything here is in the mesh's own frame and unit, float64. Bad input ends in one `InputError`.
"""

from __future__ import annotations

import hashlib
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from resfit.errors import InputError

from .background_load import MeshReader
from .formats import read_mesh_file
from .formats.mesh_file import MeshFile, Piece
from .formats.trimesh_object import from_object
from .loaded_mesh import LoadedMesh, Part
from .mesh_path import check_mesh_path
from .specks import find_specks
from .weld import LEAST_WIDTH, clean_faces, has_area, weld_vertices

if TYPE_CHECKING:
    import trimesh

MEMORY_NAME = "the mesh"
"""What messages call a mesh that came as an object and not as a file."""


def load_mesh(source: str | PathLike[str] | trimesh.Trimesh | trimesh.Scene) -> LoadedMesh:
    """Read, flatten and weld a mesh.

    Vertices nearer to each other than about a millionth of the longest side become one. Faces that name a
    vertex twice and repeated faces are dropped. Polygons become triangles; the nodes of a scene keep their
    transforms.

    Args:
        source: path of a mesh file, or a trimesh object.

    Raises:
        InputError: if it cannot be read or holds no surface.
    """
    if isinstance(source, MeshReader):
        return source.read()
    if isinstance(source, str | PathLike):
        path = Path(source)
        name = f"'{path}'"
        digest = _hash_file(path)
        file = read_mesh_file(path)
    else:
        name, digest = MEMORY_NAME, ""
        file = from_object(source, name)
    notes, reader = _check_content(file, name), file.reader
    vertices, faces, parts = _concatenate([piece for piece in file.pieces if len(piece.faces)])
    # Of a large scan each copy counts.
    del file
    check_arrays(vertices, faces, name)
    if not digest:
        digest = hashlib.sha256(vertices.tobytes() + faces.tobytes()).hexdigest()
    return _weld(vertices, faces, parts, digest, notes, name, reader)


def _hash_file(path: Path) -> str:
    check_mesh_path(path)
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror or error}.") from error


def _check_content(file: MeshFile, name: str) -> list[str]:
    """Sentences about what a file holds beside faces.

    Raises:
        InputError: if it holds no faces.
    """
    others = [
        f"{count} {word}{'' if count == 1 else 's'}"
        for count, word in ((file.points, "point"), (file.lines, "line"))
        if count
    ]
    if any(len(piece.faces) for piece in file.pieces):
        verb = "was" if file.points + file.lines == 1 else "were"
        return [*file.notes, *([f"{' and '.join(others)} without faces {verb} left out."] if others else [])]
    if file.points and not file.lines:
        raise InputError(
            f"{name} holds {others[0]} but no faces; make a surface of them first, for instance by Poisson"
            " reconstruction in MeshLab."
        )
    if others:
        raise InputError(
            f"{name} holds {' and '.join(others)} but no faces; export the surface of the shape."
        )
    raise InputError(f"{name} holds no faces; export the surface of the shape.")


def _concatenate(pieces: list[Piece]) -> tuple[np.ndarray, np.ndarray, list[Part]]:
    vertices, faces, parts = [], [], []
    vertex_count = face_count = 0
    for piece in pieces:
        vertices.append(piece.vertices)
        # An index that is not there must not become one of the next piece.
        outside = (piece.faces < 0) | (piece.faces >= len(piece.vertices))
        faces.append(np.where(outside, -1, piece.faces + vertex_count))
        parts.append(Part(piece.name, face_count, len(piece.faces)))
        vertex_count += len(piece.vertices)
        face_count += len(piece.faces)
    return np.ascontiguousarray(np.concatenate(vertices)), np.ascontiguousarray(np.concatenate(faces)), parts


def check_arrays(vertices: np.ndarray, faces: np.ndarray, name: str) -> None:
    """Refuse vertices (n, 3) and faces (m, 3), m > 0, that are no triangles in space; `name` is whose they are.

    Raises:
        InputError: if a face names a vertex that is not there, or one whose coordinates are not finite.
    """
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise InputError(f"{name} holds no triangles in space; export it as a triangle mesh.")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(
            f"a face of {name} names a vertex that is not there; the file is damaged, export it again."
        )
    bad = int(np.count_nonzero(~np.isfinite(vertices[faces]).all(axis=(1, 2))))
    if bad:
        have = "has" if bad == 1 else "have"
        raise InputError(
            f"{bad} of the {len(faces)} faces of {name} {have} coordinates that are not finite numbers (NaN or"
            " infinity); repair or export the mesh again."
        )


def _weld(
    vertices: np.ndarray,
    faces: np.ndarray,
    parts: list[Part],
    digest: str,
    notes: list[str],
    name: str,
    reader: str,
) -> LoadedMesh:
    specks, left_out = find_specks(vertices, faces)
    near = np.flatnonzero(~specks)
    welded, corners = weld_vertices(vertices, faces[near], name)
    kept, more = clean_faces(corners)
    if not has_area(welded, corners[kept], LEAST_WIDTH):
        raise InputError(
            f"every face of {name} is thinner than a millionth of the longest side; no shape can be fitted to it."
            if has_area(vertices, faces[near])
            else f"no face of {name} has an area: it holds lines or points only, and no shape to fit."
        )
    used, inverse = np.unique(corners[kept], return_inverse=True)
    source = near[kept]
    starts = np.searchsorted(source, [part.first_face for part in parts])
    ends = np.searchsorted(source, [part.first_face + part.face_count for part in parts])
    named = [Part(part.name, int(a), int(b - a)) for part, a, b in zip(parts, starts, ends, strict=True)]
    return LoadedMesh(
        welded[used],
        inverse.reshape(-1, 3).astype(np.int64),
        tuple(named),
        digest,
        (*notes, *([left_out] if left_out else []), *more),
        reader,
    )
