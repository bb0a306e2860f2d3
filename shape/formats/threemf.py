"""3MF files: the build items of a package, with their components placed, in the unit of the file.

The standard library reads them: the reference library, lib3mf, has no wheels for ARM on Linux, refuses a file for one
triangle without area, and follows components as often as a file says.
"""

from __future__ import annotations

import zipfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from resfit.errors import InputError

from .mesh_file import MeshFile, Piece
from .threemf_model import Matrix, Model, Object, Use, read_model, relationship_target
from .unpacking import check_members, refusing_damage

UNITS = {"micron": "um", "millimeter": "mm", "centimeter": "cm", "inch": "in", "foot": "ft", "meter": "m"}
LEFT_OUT = ("support", "solidsupport", "other")
"""Types of objects that are no part of the shape: support structures may be left out, others must not be built."""
ROOT_TYPE = "/3dmodel"
"""How the type of the relationship that names the root model ends."""
DEEPEST = 50
"""Levels of components within components."""
MOST_PIECES, MOST_FACES = 100_000, 50_000_000


def read(path: Path) -> MeshFile:
    """The build items of a 3MF file, each mesh of their components as a piece.

    Where nothing is to be built, all objects that are no components of others are read. Support structures are left
    out with a note, as are beam lattices, slices and what else is no mesh. Names are those of objects, or of the
    assemblies above them.

    Raises:
        InputError: if it is no 3MF file, is damaged, or unpacks to more than it may.
    """
    if not zipfile.is_zipfile(path):
        raise InputError(f"'{path}' is no 3MF file, or its end is missing; export or download it again.")
    with refusing_damage(path, "3MF file"), zipfile.ZipFile(path) as archive:
        return _Package(path, archive).file()


class _Package:
    """The model parts of a 3MF file, each read once."""

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.path, self.archive = path, archive
        # Names of parts are compared without regard to case.
        self.members = {_part_name(member.filename): member for member in archive.infolist()}
        parts = [self.members[name] for name in self.members if name.endswith((".model", ".rels"))]
        check_members(path, parts, "export it again as 3MF or STL")
        self.models: dict[str, Model] = {}
        self.counts: dict[tuple[str, str], tuple[int, int]] = {}
        self.left_out = 0
        self.taken: Counter[str] = Counter()

    def file(self) -> MeshFile:
        root = self._root()
        model = self._model(root)
        items = model.items or _roots(model)
        counts = [self._count(root, item, 0) for item in items]
        if (
            sum(pieces for pieces, _ in counts) > MOST_PIECES
            or sum(faces for _, faces in counts) > MOST_FACES
        ):
            raise InputError(
                f"'{self.path}' repeats its objects too often: it asks for {sum(faces for _, faces in counts):,}"
                " triangles; export one part of it."
            )
        pieces = tuple(piece for item in items for piece in self._placed(root, item, [], ""))
        return MeshFile(
            pieces, "resfit", notes=tuple(self._notes(model, pieces)), unit=UNITS.get(model.unit, "")
        )

    def _notes(self, root: Model, pieces: tuple[Piece, ...]) -> Iterator[str]:
        """Sentences about what was left out."""
        shapes = {shape: None for model in self.models.values() for shape in model.shapes}
        words = " and ".join(shapes)
        if not any(len(piece.faces) for piece in pieces):
            if shapes:
                raise InputError(
                    f"'{self.path}' holds {words} but no triangles; export it as a triangle mesh."
                )
            if self.left_out:
                raise InputError(
                    f"'{self.path}' holds support structures only; export the shape that they support."
                )
        if not root.items and pieces:
            yield "The file says of no object that it is to be built: all of them were read."
        if shapes:
            yield f"The file holds {words}, of which only the triangles were read."
        if self.left_out == 1:
            yield "1 support structure was left out."
        elif self.left_out:
            yield f"{self.left_out} support structures were left out."

    def _root(self) -> str:
        """The name of the part that says what is built."""
        if member := self.members.get("_rels/.rels"):
            with self.archive.open(member) as stream:
                name = _part_name(relationship_target(stream, f"'{self.path}'", ROOT_TYPE))
            if name in self.members:
                return name
        found = sorted(
            (name for name in self.members if name.endswith(".model")), key=lambda name: name.count("/")
        )
        if not found:
            raise InputError(f"'{self.path}' is a ZIP archive without a 3D model; export it again as 3MF.")
        return "3d/3dmodel.model" if "3d/3dmodel.model" in found else found[0]

    def _model(self, name: str) -> Model:
        if name not in self.models:
            if name not in self.members:
                raise InputError(f"'{self.path}' names a part '{name}' that is not in it; export it again.")
            with self.archive.open(self.members[name]) as stream:
                self.models[name] = read_model(stream, f"'{self.path}'")
        return self.models[name]

    def _find(self, part: str, use: Use) -> tuple[str, Object]:
        """The object that a component or build item of a part means, and the part that it is in."""
        part = _part_name(use.part) if use.part else part
        found = self._model(part).objects.get(use.object_id)
        if found is None:
            raise InputError(
                f"'{self.path}' places an object {use.object_id} that is not in it; export it again."
            )
        return part, found

    def _count(self, part: str, use: Use, depth: int) -> tuple[int, int]:
        """Pieces and triangles that a component or build item will give, counted without placing them."""
        if depth > DEEPEST:
            raise InputError(f"'{self.path}' has objects within objects without end; export it again.")
        part, found = self._find(part, use)
        key = part, use.object_id
        if key not in self.counts:
            inner = [self._count(part, component, depth + 1) for component in found.components]
            pieces = sum(count for count, _ in inner) + 1
            self.counts[key] = pieces, sum(count for _, count in inner) + found.face_count
        return self.counts[key]

    def _placed(self, part: str, use: Use, above: list[Matrix], name: str) -> Iterator[Piece]:
        """The meshes of a component or build item; `above` are the transforms around it, outermost last."""
        part, found = self._find(part, use)
        if found.kind in LEFT_OUT:
            self.left_out += 1
            return
        matrices = above if use.matrix is None else [use.matrix, *above]
        name = found.name or use.name or name
        if found.corners:
            yield self._piece(found, name or f"object {use.object_id}", matrices)
        for component in found.components:
            yield from self._placed(part, component, matrices, name)

    def _piece(self, found: Object, name: str, matrices: list[Matrix]) -> Piece:
        """A mesh placed. Of several of one name all but the first get a number, so that they stay apart."""
        vertices = np.array(found.coordinates).reshape(-1, 3)
        faces = np.array(found.corners).reshape(-1, 3)
        with np.errstate(all="ignore"):
            for matrix in matrices:
                vertices = vertices @ matrix[:3] + matrix[3]
                if np.linalg.det(matrix[:3]) < 0.0:
                    # A mirroring transform turns the surface inside out, unless its triangles turn with it.
                    faces = faces[:, ::-1]
        self.taken[name] += 1
        return Piece(name if self.taken[name] == 1 else f"{name} {self.taken[name]}", vertices, faces)


def _roots(model: Model) -> list[Use]:
    """The objects of a model that are no components of others, placed as they are."""
    used = {component.object_id for found in model.objects.values() for component in found.components}
    return [Use("", number, None, "") for number in model.objects if number not in used]


def _part_name(name: str) -> str:
    return name.replace("\\", "/").lstrip("/").lower()
