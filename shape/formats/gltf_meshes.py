"""The meshes of a glTF file: triangles of all modes, morph targets, joints, Draco."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError
from resfit.extras import command_for

from .gltf_accessors import Accessors, Floats
from .gltf_buffers import DRACO, Document
from .gltf_record import Record

Ints = npt.NDArray[np.int64]

POINTS, LINES, LINE_LOOP, LINE_STRIP, TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN = range(7)


@dataclass(frozen=True)
class Primitive:
    """The triangles of a primitive, in the frame of its mesh."""

    positions: Floats
    """(n, 3)."""
    faces: Ints
    """(m, 3), m > 0."""
    targets: tuple[Floats | None, ...] = ()
    """Displacements (n, 3) of each morph target; None where it moves nothing."""
    joints: Ints | None = None
    """(n, k) numbers of joints; None where it has none."""
    weights: Floats | None = None
    """(n, k) of these joints."""

    @property
    def size(self) -> int:
        """Number of vertices and faces that are handled where it is placed."""
        joints = 0 if self.joints is None else self.joints.shape[1]
        return len(self.faces) + len(self.positions) * (1 + len(self.targets) + joints)


@dataclass
class Mesh:
    """A mesh, and what of it is no surface."""

    targets: int
    """Number of morph targets."""
    weights: tuple[float, ...]
    """Of the morph targets, by default; empty where all are 0."""
    primitives: list[Primitive] = field(default_factory=list)
    points: int = 0
    lines: int = 0


class Meshes:
    """The meshes of a document, each read once, when it is first asked for."""

    def __init__(self, document: Document, accessors: Accessors) -> None:
        """Take the meshes; none is read yet."""
        self.document, self.accessors = document, accessors
        self.records = document.root.records("meshes")
        self._meshes: dict[int, Mesh] = {}
        self._checked: set[int] = set()

    def mesh(self, index: int) -> Mesh:
        """One of them.

        Raises:
            InputError: if it is not valid, or its data is not there.
        """
        if index not in self._meshes:
            record = self.records[index]
            primitives = record.records("primitives")
            targets = max((len(primitive.records("targets")) for primitive in primitives), default=0)
            found = Mesh(targets, morph_weights(record, targets))
            for primitive in primitives:
                self._add(found, primitive, record.name() or str(index))
            self._meshes[index] = found
        return self._meshes[index]

    def _add(self, mesh: Mesh, record: Record, name: str) -> None:
        """Add a primitive to a mesh."""
        mode = record.integer("mode", TRIANGLES, high=TRIANGLE_FAN)
        attributes = record.record("attributes")
        index = attributes.index("POSITION", self.accessors.records)
        if index is None:
            self.document.notes[f"Primitives of '{name}' without positions were left out."] = None
            return
        packed = record.extension(DRACO)
        columns: dict[str, npt.NDArray[Any]] = {}
        if packed is not None and "bufferView" not in self.accessors.records[index].value:
            columns, corners = self._decode_draco(record, packed)
            points = columns["POSITION"]
        else:
            points = self.accessors.stored(index, "VEC3")
            corners = self._corners(record, len(points))
        self._check_bounds(index, points, name)
        if mode < TRIANGLES:
            self._count(mesh, mode, len(corners))
            return
        # Draco's corners are always those of triangles.
        faces = triangles(corners, TRIANGLES if columns else mode)
        if mode == TRIANGLES and len(corners) % 3:
            note = f"The last triangle of {record.where} lacks a corner and was left out."
            self.document.notes[note] = None
        if len(faces) == 0:
            return
        faces, chosen = self._used(faces, len(points))
        self.document.take(len(points[chosen]))
        targets = self._targets(record, len(points), chosen)
        joints, weights = self._joints(attributes, columns, len(points), chosen)
        positions = self.accessors.scaled(index, points[chosen])
        mesh.primitives.append(Primitive(positions, faces, targets, joints, weights))

    def _corners(self, record: Record, count: int) -> Ints:
        """Indices of the corners of a primitive of `count` vertices, (k,)."""
        index = record.index("indices", self.accessors.records)
        self.document.take(count if index is None else len(self.accessors.stored(index, "SCALAR")))
        return np.arange(count) if index is None else self.accessors.indices(index)

    def _count(self, mesh: Mesh, mode: int, corners: int) -> None:
        if mode == POINTS:
            mesh.points += corners
        else:
            mesh.lines += {LINES: corners // 2, LINE_LOOP: corners, LINE_STRIP: max(corners - 1, 0)}[mode]

    def _used(self, faces: Ints, count: int) -> tuple[Ints, Ints | slice]:
        """Faces, and the vertices to take for them: all, but of many shared ones only those that faces name."""
        if count <= 3 * len(faces):
            return faces, slice(None)
        if faces.max() >= count:
            raise InputError(
                f"a face of '{self.document.path}' names a vertex that is not there; the file is damaged, export it"
                " again."
            )
        used, inverse = np.unique(faces, return_inverse=True)
        return inverse.reshape(-1, 3), used

    def _targets(self, record: Record, count: int, chosen: Any) -> tuple[Floats | None, ...]:
        found: list[Floats | None] = []
        for target in record.records("targets"):
            index = target.index("POSITION", self.accessors.records)
            values = None
            if index is not None:
                stored = self.accessors.stored(index, "VEC3")
                _check_count(target, "POSITION", stored, count)
                self.document.take(len(stored[chosen]))
                values = self.accessors.scaled(index, stored[chosen])
            found.append(values)
        return tuple(found)

    def _joints(
        self, attributes: Record, columns: dict[str, npt.NDArray[Any]], count: int, chosen: Any
    ) -> tuple[Ints | None, Floats | None]:
        """Joints and their weights, (n, 4) for each set that the primitive has."""
        joints, weights = [], []
        while (key := f"JOINTS_{len(joints)}") in attributes.value:
            pair = []
            for name in (key, f"WEIGHTS_{len(joints)}"):
                index = attributes.index(name, self.accessors.records)
                if index is None:
                    raise attributes.invalid(name, "the number of an accessor")
                values = columns[name] if name in columns else self.accessors.stored(index, "VEC4")
                _check_count(attributes, name, values, count)
                self.document.take(len(values[chosen]))
                pair.append(
                    self.accessors.scaled(index, values[chosen]) if pair else values[chosen].astype(np.int64)
                )
            joints.append(pair[0])
            weights.append(pair[1])
        return (np.hstack(joints), np.hstack(weights)) if joints else (None, None)

    def _check_bounds(self, index: int, points: npt.NDArray[Any], name: str) -> None:
        """Note where an accessor does not hold what it states: a fault of the file, or of how it was read."""
        if index not in self._checked and self.accessors.misses_bounds(index, points):
            note = f"The bounds that the file states for '{name}' differ from its points."
            self.document.notes[note] = None
        self._checked.add(index)

    def _decode_draco(self, record: Record, packed: Record) -> tuple[dict[str, npt.NDArray[Any]], Ints]:
        """Attributes by name, (n, width) each, and the corners of the triangles."""
        try:
            import DracoPy
        except ImportError:
            raise InputError(
                f"'{record.path}' uses Draco compression; call {command_for('gltf')} first, or export it without."
            ) from None
        data, _ = self.document.view(packed.integer("bufferView", high=len(self.document.view_records) - 1))
        names = packed.record("attributes")
        wanted = {names.integer(key): key for key in names.value}
        try:
            mesh = DracoPy.decode(bytes(data))
            found = {wanted.get(column["unique_id"], ""): column["data"] for column in mesh.attributes}
            corners = np.asarray(mesh.faces, np.int64).reshape(-1)
        except MemoryError:
            raise
        except Exception as error:
            # The decoder raises whatever it runs into: to a user each of them means the same.
            raise InputError(
                f"the Draco data of '{record.path}' cannot be decoded; export it again."
            ) from error
        if "POSITION" not in found or found["POSITION"].shape[1:] != (3,):
            raise InputError(f"the Draco data of '{record.path}' holds no positions; export it again.")
        self.document.take(len(corners))
        return found, corners


def triangles(corners: Ints, mode: int) -> Ints:
    """Triangles (m, 3) of a list, strip or fan of corners, counter-clockwise where the file's are."""
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if len(corners) < 3:
        return np.zeros((0, 3), np.int64)
    if mode == TRIANGLE_FAN:
        return np.column_stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]])
    found = np.column_stack([corners[:-2], corners[1:-1], corners[2:]])
    found[1::2] = found[1::2, ::-1]
    # A corner that comes twice joins two strips: such triangles are no surface.
    return found[(found != np.roll(found, 1, axis=1)).all(axis=1)]


def morph_weights(record: Record, count: int) -> tuple[float, ...]:
    """The `weights` of a mesh or node with `count` morph targets, or none."""
    return tuple(record.numbers("weights", count) or ()) if count else ()


def _check_count(record: Record, key: str, values: npt.NDArray[Any], count: int) -> None:
    if len(values) != count:
        raise InputError(
            f"'{record.path}' is no valid glTF: {record.where}.{key} has {len(values)} elements for {count} vertices;"
            " export it again."
        )
