"""Reading meshes: any format that trimesh reads, scenes flattened, vertices welded.

Everything here is in the mesh's own frame and unit, float64. Bad input ends in one `InputError`.
"""

from __future__ import annotations

import hashlib
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from .reader import MeshReader
from .weld import clean_faces, face_areas, weld_vertices

if TYPE_CHECKING:
    import trimesh

MEMORY_NAME = "the mesh"
"""What messages call a mesh that came as an object and not as a file."""


@dataclass(frozen=True)
class Part:
    """One node of a scene, or the whole of a file without nodes."""

    name: str
    first_face: int
    face_count: int
    """Its faces are those from `first_face` to `first_face + face_count` of the loaded mesh."""


@dataclass(frozen=True)
class LoadedMesh:
    """A triangle mesh as it was found, welded and without faces that say nothing."""

    vertices: npt.NDArray[np.float64]
    """(n, 3), mesh units; each is used by a face."""
    faces: npt.NDArray[np.int64]
    """(m, 3), m > 0, in the order of the input."""
    source_faces: npt.NDArray[np.int64]
    """(m,) index of each face among the triangles of the input, before any were dropped."""
    parts: tuple[Part, ...]
    sha256: str
    """Of the file's bytes; of vertices and faces, if the mesh came as an object."""
    notes: tuple[str, ...]
    """Sentences about what was changed."""


def load_mesh(source: str | PathLike[str] | trimesh.Trimesh | trimesh.Scene) -> LoadedMesh:
    """Read, flatten and weld a mesh.

    Vertices nearer to each other than about a millionth of the longest side become one. Faces that name a
    vertex twice and repeated faces are dropped. Polygons become triangles; the nodes of a scene keep their
    transforms.

    Args:
        source: path of a file in any format that trimesh reads, or a trimesh object.

    Raises:
        InputError: if it cannot be read or holds no surface.
    """
    if isinstance(source, MeshReader):
        return source.read()
    if isinstance(source, str | PathLike):
        path = Path(source)
        name = f"'{path}'"
        digest = _hash_file(path)
        pieces, notes = _pieces(_read(path), name)
    else:
        name, digest = MEMORY_NAME, ""
        pieces, notes = _pieces(source, name)
    vertices, faces, parts = _concatenate(pieces)
    _check_arrays(vertices, faces, name)
    if not digest:
        digest = hashlib.sha256(vertices.tobytes() + faces.tobytes()).hexdigest()
    return _weld(vertices, faces, parts, digest, notes, name)


def _hash_file(path: Path) -> str:
    try:
        if path.is_dir():
            raise InputError(f"'{path}' is a folder, not a mesh file; give the path of one file in it.")
        if not path.exists():
            raise InputError(f"there is no file '{path}'; check the path.")
        if path.stat().st_size == 0:
            raise InputError(f"'{path}' is empty (0 bytes); export or download it again.")
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror or error}.") from error


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep what trimesh logs and warns about off the terminal: what matters is said in our own words."""
    logger = logging.getLogger("trimesh")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)


def _read(path: Path) -> Any:
    """The trimesh scene in a file."""
    import trimesh

    known = trimesh.available_formats()
    suffix = path.suffix.lower().lstrip(".")
    if suffix not in known:
        written = f"'.{suffix}'" if suffix else "no suffix"
        raise InputError(
            f"'{path}' has {written}, which is no mesh format known here; convert it to GLB, OBJ, PLY or STL."
        )
    with _quiet():
        try:
            # Materials are of no use here, and reading their pictures would take most of the time.
            options: dict[str, Any] = {"skip_materials": True} if suffix in {"glb", "gltf", "obj"} else {}
            return trimesh.load_scene(path, process=False, **options)
        except Exception as error:
            # Loaders raise whatever their parsers run into: to a user each of them means the same.
            reason = " ".join(str(error).split())[:120] or type(error).__name__
            raise InputError(
                f"'{path}' is not a readable {suffix.upper()} file ({reason}); export it again, or convert it to"
                " GLB, OBJ, PLY or STL."
            ) from error


def _pieces(source: Any, name: str) -> tuple[list[tuple[str, np.ndarray, np.ndarray]], list[str]]:
    """(node name, vertices in the mesh's frame, triangles) of everything in a scene that has faces.

    Raises:
        InputError: if there is nothing of the kind.
    """
    pieces, bare = [], 0
    with _quiet():
        for node, geometry, matrix in _nodes(source, name):
            faces = np.asarray(getattr(geometry, "faces", np.zeros((0, 3))))
            if len(faces) == 0:
                bare += len(getattr(geometry, "vertices", ()))
                continue
            vertices = np.asarray(geometry.vertices, np.float64)
            if matrix is not None:
                vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
                if np.linalg.det(matrix[:3, :3]) < 0.0:
                    # A mirroring transform turns the surface inside out, unless its triangles turn with it.
                    faces = faces[:, ::-1]
            pieces.append((str(node), vertices, faces.astype(np.int64)))
    if not pieces and bare:
        raise InputError(
            f"{name} holds {bare} points but no faces; make a surface of them first, for instance by Poisson"
            " reconstruction in MeshLab."
        )
    if not pieces:
        raise InputError(f"{name} holds no faces; it may be another kind of file under this name.")
    notes = [f"{bare} points or line vertices without faces were left out."] if bare else []
    return pieces, notes


def _nodes(source: Any, name: str) -> Iterator[tuple[str, Any, np.ndarray | None]]:
    """(node name, geometry, transform or None) of a trimesh object."""
    if hasattr(source, "graph") and hasattr(source, "geometry"):
        for node in source.graph.nodes_geometry:
            matrix, geometry = source.graph[node]
            matrix = np.asarray(matrix, np.float64)
            yield node, source.geometry[geometry], None if np.array_equal(matrix, np.eye(4)) else matrix
    elif hasattr(source, "vertices"):
        yield "mesh", source, None
    else:
        raise InputError(
            f"{name} is a {type(source).__name__}; give a path, a trimesh.Trimesh or a trimesh.Scene."
        )


def _concatenate(
    pieces: list[tuple[str, np.ndarray, np.ndarray]],
) -> tuple[np.ndarray, np.ndarray, list[Part]]:
    vertices, faces, parts = [], [], []
    vertex_count = face_count = 0
    for name, points, triangles in pieces:
        vertices.append(points)
        faces.append(triangles + vertex_count)
        parts.append(Part(name, face_count, len(triangles)))
        vertex_count += len(points)
        face_count += len(triangles)
    return np.ascontiguousarray(np.concatenate(vertices)), np.ascontiguousarray(np.concatenate(faces)), parts


def _check_arrays(vertices: np.ndarray, faces: np.ndarray, name: str) -> None:
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise InputError(f"{name} holds no triangles in space; export it as a triangle mesh.")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(
            f"a face of {name} names a vertex that is not there; the file is damaged, export it again."
        )
    bad = int(np.count_nonzero(~np.isfinite(vertices[faces]).all(axis=(1, 2))))
    if bad:
        raise InputError(
            f"{bad} of the {len(faces)} faces of {name} have coordinates that are not finite numbers (NaN or"
            " infinity); repair or export the mesh again."
        )


def _weld(
    vertices: np.ndarray, faces: np.ndarray, parts: list[Part], digest: str, notes: list[str], name: str
) -> LoadedMesh:
    vertices, faces = weld_vertices(vertices, faces)
    kept, more = clean_faces(faces)
    if len(kept) == 0 or not face_areas(vertices, faces[kept]).max() > 0.0:
        raise InputError(
            f"no face of {name} has an area: it holds lines or points only, and no shape to fit."
        )
    used, inverse = np.unique(faces[kept], return_inverse=True)
    starts = np.searchsorted(kept, [part.first_face for part in parts])
    ends = np.searchsorted(kept, [part.first_face + part.face_count for part in parts])
    named = [Part(part.name, int(a), int(b - a)) for part, a, b in zip(parts, starts, ends, strict=True)]
    return LoadedMesh(
        vertices[used],
        inverse.reshape(-1, 3).astype(np.int64),
        kept,
        tuple(named),
        digest,
        tuple(notes + more),
    )
