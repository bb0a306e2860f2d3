"""An assembly: primitives in a list, folded left into one smooth union, placed in a mesh's frame."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from resfit.errors import AssemblyError

from ..kernels.rows import ROW
from .atomic_write import write_bytes
from .document import (
    FORMAT,
    MAX_BYTES,
    VERSION,
    AssemblyDocument,
    PrimitiveDocument,
    ProvenanceDocument,
    TransformDocument,
    format_document,
    parse,
)
from .primitive import Pose, Primitive, shown
from .provenance import Provenance
from .transform import Transform

if TYPE_CHECKING:
    import trimesh

    from ..kernels.field.evaluate import PrimitiveSet


@dataclass(frozen=True)
class Assembly:
    """Primitives in the normalised frame, and the transform to the mesh's own frame.

    Raises:
        AssemblyError: if two primitives have the same name.
    """

    primitives: tuple[Primitive, ...] = ()
    """In the order of the union; the first one's blend is unused."""
    transform: Transform = field(default_factory=Transform)
    """mesh = scale * normalised + translation."""
    provenance: Provenance = field(default_factory=Provenance)
    _sets: dict[str, Any] = field(default_factory=dict, init=False, repr=False, compare=False)
    """Primitives on a device, by the device's name: made on first use."""

    def __post_init__(self) -> None:
        primitives = tuple(self.primitives)
        first: dict[str, int] = {}
        for index, primitive in enumerate(primitives):
            if primitive.name in first:
                raise AssemblyError(
                    f"primitives[{index}].name is {shown(primitive.name)}, as is that of"
                    f" primitives[{first[primitive.name]}]; names must differ"
                )
            first[primitive.name] = index
        object.__setattr__(self, "primitives", primitives)

    def __reduce__(self) -> tuple[Any, ...]:
        # What lies on a device stays in this process.
        return Assembly, (self.primitives, self.transform, self.provenance)

    @classmethod
    def load(cls, path: str | Path) -> Assembly:
        """Read an assembly.json.

        Raises:
            AssemblyError: if it cannot be read or is not valid: one sentence that names file and field.
        """
        try:
            if os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path):
                # A pipe might never end.
                raise AssemblyError(f"{path} is no regular file; give an assembly.json")
            with open(path, "rb") as stream:
                content = stream.read(MAX_BYTES + 1)
        except IsADirectoryError:
            raise AssemblyError(f"{path} is a folder; give the assembly.json in it") from None
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "the name is not a valid path"
            raise AssemblyError(f"cannot read {path}: {reason}") from error
        try:
            return cls.from_json(content)
        except AssemblyError as error:
            raise AssemblyError(f"{path}: {error}") from error

    @classmethod
    def from_json(cls, content: bytes) -> Assembly:
        """The assembly of the bytes of a file.

        Raises:
            AssemblyError: if they are not valid: one sentence that names the field.
        """
        return _from_document(parse(content))

    def save(self, path: str | Path) -> None:
        """Write an assembly.json, at once; an assembly always gives the same bytes.

        Raises:
            InputError: if the file cannot be written.
        """
        write_bytes(path, self.to_json())

    def to_json(self) -> bytes:
        """The bytes of this assembly's file."""
        return format_document(_to_document(self))

    def rows(self) -> npt.NDArray[np.float32]:
        """All primitives as rows (K, ROW) of `kernels/rows.py`, normalised frame."""
        rows = [primitive.row() for primitive in self.primitives]
        return np.stack(rows) if rows else np.zeros((0, ROW), np.float32)

    @classmethod
    def from_rows(
        cls,
        rows: npt.ArrayLike,
        families: Iterable[str],
        colors: Iterable[str],
        transform: Transform | None = None,
        provenance: Provenance | None = None,
    ) -> Assembly:
        """The assembly of rows (K, ROW) of `kernels/rows.py`, its parts named part_00, part_01, ...

        Raises:
            AssemblyError: if a row holds a value outside the legal range of its field.
        """
        primitives = tuple(
            Primitive.from_row(family, f"part_{index:02d}", row, color)
            for index, (row, family, color) in enumerate(
                zip(np.asarray(rows, np.float32).reshape(-1, ROW), families, colors, strict=True)
            )
        )
        return cls(primitives, transform or Transform(), provenance or Provenance())

    def renamed(self, names: Sequence[str]) -> Assembly:
        """The same with other names, one a primitive.

        Raises:
            AssemblyError: if two are the same, or one is no name.
        """
        parts = tuple(replace(part, name=name) for part, name in zip(self.primitives, names, strict=True))
        return replace(self, primitives=parts)

    def top(self, count: int, gains: Sequence[float]) -> Assembly:
        """The `count` primitives with the largest gains (one a primitive), in their order, with their names."""
        ranked = sorted(range(len(self.primitives)), key=lambda index: -gains[index])[: max(count, 0)]
        return replace(self, primitives=tuple(self.primitives[index] for index in sorted(ranked)))

    def on_device(self, device: str = "auto") -> PrimitiveSet:
        """The primitives, ready for the functions of `kernels`, normalised frame.

        Raises:
            DeviceError: if there is no such device.
        """
        from ..kernels.field.evaluate import PrimitiveSet
        from ..kernels.runtime.launch import choose_device

        chosen = choose_device(device)
        if chosen.alias not in self._sets:
            families = [primitive.family for primitive in self.primitives]
            self._sets[chosen.alias] = PrimitiveSet(self.rows(), families, chosen)
        return self._sets[chosen.alias]

    def sdf(self, points: npt.ArrayLike, device: str = "auto") -> npt.NDArray[np.float32]:
        """Signed distance of the smooth union, negative inside.

        Args:
            points: query points, (n, 3), mesh units, in the input mesh's own frame.
            device: `auto`, `cpu`, `cuda:0`.

        Returns:
            (n,), mesh units; of an empty assembly, a number far larger than the mesh.

        Raises:
            InputError: if the points are not (n, 3) numbers.
            DeviceError: if there is no such device.
        """
        from ..kernels.field.evaluate import evaluate_assembly

        local, beyond = self.transform.to_field(points)
        distance = evaluate_assembly(self.on_device(device), local)
        return self.transform.to_mesh_distance(distance, beyond)

    def primitive_sdf(self, points: npt.ArrayLike, device: str = "auto") -> npt.NDArray[np.float32]:
        """Signed distance of each primitive alone, negative inside.

        Args:
            points: query points, (n, 3), mesh units, in the input mesh's own frame.
            device: `auto`, `cpu`, `cuda:0`.

        Returns:
            (n, K), mesh units.

        Raises:
            InputError: if the points are not (n, 3) numbers.
            DeviceError: if there is no such device.
        """
        from ..kernels.field.evaluate import evaluate_primitives

        local, beyond = self.transform.to_field(points)
        distance = evaluate_primitives(self.on_device(device), local)
        return np.ascontiguousarray(self.transform.to_mesh_distance(distance, beyond).T)

    def to_mesh(self, resolution: int = 128, device: str = "auto") -> trimesh.Trimesh:
        """The surface of the smooth union as one mesh, in the mesh's own frame.

        Args:
            resolution: cells along the longest side of the normalised frame.
            device: `auto`, `cpu`, `cuda:0`.
        """
        from .surface import union_mesh

        return union_mesh(self.primitives, self.transform, resolution, device)

    def part_meshes(self, resolution: int = 64, device: str = "auto") -> list[trimesh.Trimesh]:
        """The surface of each primitive alone, in the mesh's own frame; names are in `metadata["name"]`.

        Args:
            resolution: cells along the longest side of each primitive.
            device: `auto`, `cpu`, `cuda:0`.
        """
        from .surface import part_meshes

        return part_meshes(self.primitives, self.transform, resolution, device)


def _from_document(document: AssemblyDocument) -> Assembly:
    primitives = []
    for index, entry in enumerate(document.primitives):
        try:
            pose = Pose(_triple(entry.translation), _quadruple(entry.rotation))
            primitives.append(
                Primitive(entry.family, entry.name, pose, entry.parameters, entry.blend, entry.color)
            )
        except AssemblyError as error:
            raise AssemblyError(f"primitives[{index}].{error}") from error
    transform = Transform(document.transform.scale, _triple(document.transform.translation))
    return Assembly(tuple(primitives), transform, Provenance(**document.provenance.model_dump()))


def _to_document(assembly: Assembly) -> AssemblyDocument:
    primitives = [
        PrimitiveDocument(
            family=primitive.family,
            name=primitive.name,
            translation=list(primitive.pose.translation),
            rotation=list(primitive.pose.rotation),
            parameters=dict(primitive.parameters),
            blend=primitive.blend,
            color=primitive.color,
        )
        for primitive in assembly.primitives
    ]
    transform = TransformDocument(
        scale=assembly.transform.scale, translation=list(assembly.transform.translation)
    )
    origin = assembly.provenance
    provenance = ProvenanceDocument(
        resfit=origin.resfit,
        warp=origin.warp,
        seed=origin.seed,
        options=dict(origin.options),
        input_sha256=origin.input_sha256,
    )
    return AssemblyDocument(
        format=FORMAT, version=VERSION, transform=transform, primitives=primitives, provenance=provenance
    )


def _triple(values: list[float]) -> tuple[float, float, float]:
    x, y, z = values
    return x, y, z


def _quadruple(values: list[float]) -> tuple[float, float, float, float]:
    w, x, y, z = values
    return w, x, y, z
