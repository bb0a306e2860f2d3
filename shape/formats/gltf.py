"""glTF 2.0 files, .glb and .gltf: every mesh where its node, its skin or its instances place it.

Materials, textures, cameras, lights and animations are left aside.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from .gltf_accessors import Accessors, Floats
from .gltf_buffers import Document
from .gltf_meshes import Mesh, Meshes, Primitive, morph_weights
from .gltf_nodes import IDENTITY, Nodes, instance_transforms, unique_names
from .mesh_file import MeshFile, Piece

PIECE_COST = 50
"""Vertices and faces that a piece counts for at least: it takes memory and time of its own."""


def read(path: Path) -> MeshFile:
    """The default scene of a glTF file.

    A mesh of several primitives gives as many pieces of one name. Skinned meshes are in the pose of the file's nodes,
    morph targets have their default weights.

    Raises:
        InputError: if the file is damaged or no valid glTF, or needs an extension or decoder that is not there.
    """
    with np.errstate(all="ignore"):
        return _Scene(Document(path)).file()


class _Scene:
    """Pieces of a scene, gathered in the traversal of its nodes."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.accessors = Accessors(document)
        self.meshes = Meshes(document, self.accessors)
        self.nodes = Nodes(document)
        self.skins = document.root.records("skins")
        self._joints: dict[int, Floats] = {}
        self.pieces: list[Piece] = []
        self.points = self.lines = 0

    def file(self) -> MeshFile:
        """The scene's content; of a file without nodes all meshes as they are."""
        for node in self.nodes.placed():
            index = self.nodes.meshes[node]
            if index is not None:
                self._place(node, index)
        if not self.nodes.records:
            names = unique_names(record.name() or str(k) for k, record in enumerate(self.meshes.records))
            for index, name in enumerate(names):
                mesh = self.meshes.mesh(index)
                self._add(name, mesh, [_morphed(each, mesh.weights) for each in mesh.primitives], IDENTITY)
        return MeshFile(
            tuple(self.pieces), "resfit", self.points, self.lines, tuple(self.document.notes), unit="m"
        )

    def _place(self, node: int, index: int) -> None:
        """Place the mesh of a node, once or at each of its instances."""
        record, name, world = self.nodes.records[node], self.nodes.names[node], self.nodes.worlds[node]
        mesh = self.meshes.mesh(index)
        weights = morph_weights(record, mesh.targets) or mesh.weights
        self.document.take(len(weights))
        points = [_morphed(primitive, weights) for primitive in mesh.primitives]
        skin = record.index("skin", self.skins)
        instances = instance_transforms(record, self.accessors)
        if skin is not None:
            if all(primitive.joints is not None for primitive in mesh.primitives):
                self._add_skinned(name, mesh, points, self._joint_transforms(skin))
                return
            self.document.notes[f"'{name}' has a skin but no joints, and was placed by its node."] = None
        if instances is None:
            self._add(name, mesh, points, world)
            return
        for number, instance in enumerate(instances, 1):
            self._add(f"{name}.{number}" if len(instances) > 1 else name, mesh, points, world @ instance)

    def _add(self, name: str, mesh: Mesh, points: list[Floats], matrix: Floats) -> None:
        """Add the pieces of a mesh, each moved by one transform."""
        self._count(mesh)
        still = np.array_equal(matrix, IDENTITY)
        mirrored = not still and np.linalg.det(matrix[:3, :3]) < 0.0
        for primitive, vertices in zip(mesh.primitives, points, strict=True):
            moved = vertices if still else vertices @ matrix[:3, :3].T + matrix[:3, 3]
            self._append(name, moved, primitive, mirrored)

    def _add_skinned(self, name: str, mesh: Mesh, points: list[Floats], transforms: Floats) -> None:
        """Add the pieces of a mesh, each vertex moved by its joints."""
        self._count(mesh)
        for primitive, vertices in zip(mesh.primitives, points, strict=True):
            blended = self._blend(primitive, transforms)
            mirrored = np.median(np.sign(np.linalg.det(blended[:, :, :3]))) < 0.0
            moved = np.einsum("nij,nj->ni", blended[:, :, :3], vertices) + blended[:, :, 3]
            self._append(name, moved, primitive, bool(mirrored))

    def _append(self, name: str, vertices: Floats, primitive: Primitive, mirrored: bool) -> None:
        # A mirroring transform turns the surface inside out, unless its triangles turn with it.
        faces = primitive.faces[:, ::-1] if mirrored else primitive.faces
        self.pieces.append(Piece(name, vertices, faces))

    def _count(self, mesh: Mesh) -> None:
        self.document.take(sum(max(primitive.size, PIECE_COST) for primitive in mesh.primitives))
        self.points += mesh.points
        self.lines += mesh.lines

    def _joint_transforms(self, skin: int) -> Floats:
        """Transforms (k, 4, 4) of the joints of a skin from the mesh to the scene."""
        if skin not in self._joints:
            self._joints[skin] = self._multiply_joints(skin)
        return self._joints[skin]

    def _multiply_joints(self, skin: int) -> Floats:
        record = self.skins[skin]
        joints = record.indices("joints", self.nodes.records)
        if not joints:
            raise record.invalid("joints", "a list of nodes")
        worlds = np.stack([self.nodes.worlds[joint] for joint in joints])
        index = record.index("inverseBindMatrices", self.accessors.records)
        if index is None:
            return worlds
        binds = self.accessors.numbers(index, "MAT4")
        if len(binds) < len(joints):
            raise InputError(
                f"'{record.path}' is no valid glTF: {record.where} has {len(joints)} joints but {len(binds)} inverse"
                " bind matrices; export it again."
            )
        return worlds @ binds[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)

    def _blend(self, primitive: Primitive, transforms: Floats) -> npt.NDArray[np.float64]:
        """The transform (3, 4) of each vertex: the mean of those of its joints by their weights."""
        joints, weights = primitive.joints, primitive.weights
        assert joints is not None and weights is not None
        # Joints without a weight are often left at any number.
        joints = np.where(weights == 0.0, 0, joints)
        if joints.min(initial=0) < 0 or joints.max(initial=0) >= len(transforms):
            raise InputError(
                f"a vertex of '{self.document.path}' names a joint that is not there; the file is damaged, export it"
                " again."
            )
        blended = np.zeros((len(joints), 3, 4))
        for joint, weight in zip(joints.T, weights.T, strict=True):
            blended += weight[:, None, None] * transforms[joint, :3]
        total = weights.sum(axis=1)[:, None, None]
        # Vertices without weights follow their first joint.
        return np.where(total > 0.0, blended / total, transforms[joints[:, 0], :3])


def _morphed(primitive: Primitive, weights: tuple[float, ...]) -> Floats:
    """The positions (n, 3) of a primitive, displaced by its morph targets."""
    found = primitive.positions
    for target, weight in zip(primitive.targets, weights, strict=False):
        if target is not None and weight:
            found = found + weight * target
    return found
