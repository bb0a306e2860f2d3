"""The node trees of a glTF file: names, transforms, and the order in which nodes are placed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from operator import itemgetter

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from .gltf_accessors import Accessors
from .gltf_buffers import INSTANCING, Document
from .gltf_record import Record

Matrices = npt.NDArray[np.float64]

IDENTITY = np.eye(4)
IDENTITY.flags.writeable = False


class Nodes:
    """The nodes of a document, each with its transform to the scene. They are walked without recursion."""

    def __init__(self, document: Document) -> None:
        """Read all nodes, those outside the scene as well: they may be joints.

        Raises:
            InputError: if they form no trees, or a field has no valid value.
        """
        self.document = document
        self.records = document.root.records("nodes")
        self._meshes = document.root.records("meshes")
        self._children = [record.indices("children", self.records) for record in self.records]
        self.parents = self._find_parents()
        self.worlds = self._multiply()
        """Transforms to the scene, one (4, 4) a node."""
        self.meshes = [record.index("mesh", self._meshes) for record in self.records]
        """The mesh of each node, or None."""
        self.names = unique_names(
            record.name() or (self._meshes[mesh].name() if mesh is not None else "") or str(number)
            for number, (record, mesh) in enumerate(zip(self.records, self.meshes, strict=True))
        )
        """Names of nodes, else of their meshes, else numbers; made different where they are not."""

    def placed(self) -> list[int]:
        """The nodes of the scene to be shown, depth first, the last of several children first.

        That is the stated scene, else the first, else all trees. Nodes of other scenes are said to be left out.
        """
        scenes = self.document.root.records("scenes")
        shown = self.document.root.index("scene", scenes)
        roots = scenes[shown or 0].indices("nodes", self.records) if scenes else []
        for root in roots:
            if self.parents[root] >= 0:
                raise self._no_tree(root)
        if len(set(roots)) < len(roots):
            raise self._no_tree(max(Counter(roots).items(), key=itemgetter(1))[0])
        found = self._walk(roots or [node for node, parent in enumerate(self.parents) if parent < 0])
        inside = set(found)
        others = sum(mesh is not None and node not in inside for node, mesh in enumerate(self.meshes))
        self._note(
            others,
            "node with a mesh outside the default scene",
            "nodes with meshes outside the default scene",
        )
        if self.records:
            self._note(
                len(self._meshes) - len(set(self.meshes) - {None}),
                "mesh without a node",
                "meshes without nodes",
            )
        return found

    def _note(self, count: int, one: str, several: str) -> None:
        if count:
            said = f"1 {one} was" if count == 1 else f"{count} {several} were"
            self.document.notes[f"{said} left out."] = None

    def _find_parents(self) -> list[int]:
        parents = [-1] * len(self.records)
        for parent, children in enumerate(self._children):
            for child in children:
                if parents[child] >= 0:
                    raise self._no_tree(child)
                parents[child] = parent
        return parents

    def _walk(self, roots: list[int]) -> list[int]:
        found, stack = [], list(roots)
        while stack:
            node = stack.pop()
            found.append(node)
            stack.extend(self._children[node])
        return found

    def _multiply(self) -> list[Matrices]:
        order = self._walk([node for node, parent in enumerate(self.parents) if parent < 0])
        if len(order) < len(self.records):
            raise self._no_tree(next(iter(set(range(len(self.records))) - set(order))))
        worlds = [IDENTITY] * len(self.records)
        for node in order:
            local, parent = _local_transform(self.records[node]), self.parents[node]
            above = IDENTITY if parent < 0 else worlds[parent]
            worlds[node] = above if local is IDENTITY else local if above is IDENTITY else above @ local
        return worlds

    def _no_tree(self, node: int) -> InputError:
        return InputError(
            f"'{self.document.path}' is no valid glTF: its nodes form no trees, for nodes[{node}] is reached twice or"
            " never; export it again."
        )


def _local_transform(record: Record) -> Matrices:
    """The transform (4, 4) of a node to its parent."""
    keys = record.value.keys() & {"matrix", "translation", "rotation", "scale"}
    if not keys:
        return IDENTITY
    found = IDENTITY
    if "matrix" in keys:
        found = np.reshape(record.numbers("matrix", 16) or (), (4, 4)).T
        if np.abs(found[3] - IDENTITY[3]).max() > 1e-4:
            raise record.invalid("matrix", "an affine transform")
    shift, turn, scale = (
        record.numbers("translation", 3),
        record.numbers("rotation", 4),
        record.numbers("scale", 3),
    )
    return (
        found
        @ _trs_transforms(*(None if value is None else np.array([value]) for value in (shift, turn, scale)))[
            0
        ]
    )


def _trs_transforms(shifts: Matrices | None, turns: Matrices | None, scales: Matrices | None) -> Matrices:
    """Transforms (n, 4, 4) that scale, turn and shift, in that order.

    Args:
        shifts: (n, 3), or None.
        turns: (n, 4) quaternions x, y, z, w of any length but 0, or None.
        scales: (n, 3), or None.
    """
    count = max((len(values) for values in (shifts, turns, scales) if values is not None), default=1)
    found = np.tile(IDENTITY, (count, 1, 1))
    if shifts is not None:
        found[:, :3, 3] = shifts
    if turns is not None:
        found = found @ _rotations(turns)
    if scales is not None:
        factors = np.zeros((count, 4, 4))
        factors[:, range(3), range(3)] = scales
        factors[:, 3, 3] = 1.0
        found = found @ factors
    return found


def instance_transforms(record: Record, accessors: Accessors) -> Matrices | None:
    """Transforms (n, 4, 4) of the instances of a node to the node; None where it has no instances.

    Raises:
        InputError: if they differ in number.
    """
    extension = record.extension(INSTANCING)
    if extension is None:
        return None
    attributes = extension.record("attributes")
    values = []
    for key, kind in (("TRANSLATION", "VEC3"), ("ROTATION", "VEC4"), ("SCALE", "VEC3")):
        index = attributes.index(key, accessors.records)
        values.append(None if index is None else accessors.numbers(index, kind))
    if len({len(value) for value in values if value is not None}) > 1:
        raise InputError(
            f"'{record.path}' is no valid glTF: the attributes of {extension.where} differ in number; export it again."
        )
    # A transform has the size of about six vertices.
    accessors.document.take(6 * max((len(value) for value in values if value is not None), default=1))
    return _trs_transforms(*values)


def unique_names(names: Iterable[str]) -> list[str]:
    """The same names, those that came before with a number behind: `leg`, `leg_1`, `leg_2`."""
    taken: set[str] = set()
    counts: dict[str, int] = {}
    found = []
    for name in names:
        chosen = name
        while chosen in taken:
            counts[name] = counts.get(name, 0) + 1
            chosen = f"{name}_{counts[name]}"
        taken.add(chosen)
        found.append(chosen)
    return found


def _rotations(turns: Matrices) -> Matrices:
    """Rotations (n, 4, 4) by quaternions (n, 4), x, y, z, w; one of length 0 turns nothing."""
    quaternions = turns[:, [3, 0, 1, 2]]
    squares = np.einsum("ni,ni->n", quaternions, quaternions)
    length = np.sqrt(2.0 / np.where(squares > 0.0, squares, np.inf))
    unit = quaternions * length[:, None]
    q = unit[:, :, None] * unit[:, None, :]
    found = np.zeros((len(turns), 4, 4))
    found[:, 0, 0] = 1.0 - q[:, 2, 2] - q[:, 3, 3]
    found[:, 0, 1] = q[:, 1, 2] - q[:, 3, 0]
    found[:, 0, 2] = q[:, 1, 3] + q[:, 2, 0]
    found[:, 1, 0] = q[:, 1, 2] + q[:, 3, 0]
    found[:, 1, 1] = 1.0 - q[:, 1, 1] - q[:, 3, 3]
    found[:, 1, 2] = q[:, 2, 3] - q[:, 1, 0]
    found[:, 2, 0] = q[:, 1, 3] - q[:, 2, 0]
    found[:, 2, 1] = q[:, 2, 3] + q[:, 1, 0]
    found[:, 2, 2] = 1.0 - q[:, 1, 1] - q[:, 2, 2]
    found[:, 3, 3] = 1.0
    return found
