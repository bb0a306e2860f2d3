"""Accessors of glTF files as NumPy arrays: strided, sparse, normalised, or left out."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from .gltf_buffers import Document
from .gltf_record import Record

COMPONENTS = {
    code: np.dtype(kind)
    for code, kind in (
        (5120, "<i1"),
        (5121, "<u1"),
        (5122, "<i2"),
        (5123, "<u2"),
        (5125, "<u4"),
        (5126, "<f4"),
    )
}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
TOLERANCE = 0.01
"""Share of its size by which an accessor may miss its stated bounds: exporters round them, and compress afterwards."""

Floats = npt.NDArray[np.float64]


class Accessors:
    """The accessors of a document. Each is checked against the bytes that are there before it is made an array."""

    def __init__(self, document: Document) -> None:
        """Take the accessors; none is read yet."""
        self.document = document
        self.records = document.root.records("accessors")
        self._stored: dict[int, npt.NDArray[Any]] = {}

    def stored(self, index: int, kind: str) -> npt.NDArray[Any]:
        """The components as they are stored, (count, width), read-only.

        Args:
            index: of the accessor.
            kind: the `type` that it has to have, as `VEC3`.

        Raises:
            InputError: if it is of another type, or its data is not there.
        """
        record = self.records[index]
        if record.text("type") != kind:
            raise record.invalid("type", f'"{kind}"')
        if index not in self._stored:
            dtype, count, width = _component(record), record.integer("count"), WIDTHS[kind]
            if "bufferView" in record.value:
                found = self._elements(record, dtype, count, width)
            else:
                # Each element is used by a byte of something else at least: an index, or another attribute.
                if count > self.document.size():
                    raise InputError(
                        f"'{record.path}' is no valid glTF: {record.where} claims {count} elements without data, more"
                        " than the file has bytes; export it again."
                    )
                found = np.zeros((count, width), dtype)
            if "sparse" in record.value:
                found = self._replaced(record.record("sparse"), found)
            self._stored[index] = found
        return self._stored[index]

    def numbers(self, index: int, kind: str) -> Floats:
        """The components, (count, width), integers scaled to -1..1 or 0..1 where the accessor is normalised."""
        return self.scaled(index, self.stored(index, kind))

    def scaled(self, index: int, stored: npt.NDArray[Any]) -> Floats:
        """The same of components that are taken out already."""
        values = stored.astype(np.float64)
        normalised = self.records[index].value.get("normalized", False)
        if not isinstance(normalised, bool):
            raise self.records[index].invalid("normalized", "true or false")
        if normalised and stored.dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(stored.dtype).max, -1.0)
        return values

    def indices(self, index: int) -> npt.NDArray[np.int64]:
        """Unsigned integers, (count,).

        Raises:
            InputError: if it holds anything else.
        """
        stored = self.stored(index, "SCALAR")
        if stored.dtype.kind != "u":
            raise self.records[index].invalid("componentType", "5121, 5123 or 5125 (unsigned integers)")
        return stored[:, 0].astype(np.int64)

    def misses_bounds(self, index: int, points: npt.NDArray[Any]) -> bool:
        """True if the `min` and `max` of an accessor are not those of its points.

        Args:
            index: of the accessor.
            points: (n, 3), as stored or as decoded.
        """
        record = self.records[index]
        if len(points) == 0 or "min" not in record.value or "max" not in record.value:
            return False
        try:
            stated = np.array([record.numbers("min", 3), record.numbers("max", 3)])
        except InputError:
            return True
        columns = np.ascontiguousarray(points.T)
        stored = np.stack([columns.min(axis=1), columns.max(axis=1)])
        # Bounds are those of the stored integers; some exporters state them after scaling.
        for found in (stored.astype(np.float64), self.scaled(index, stored)):
            room = TOLERANCE * max(np.ptp(found, axis=0).max(), 1e-5 * np.abs(found).max())
            # Coordinates that are not finite are refused elsewhere.
            if not (np.abs(found - stated) > room).any():
                return False
        return True

    def _elements(self, record: Record, dtype: np.dtype[Any], count: int, width: int) -> npt.NDArray[Any]:
        """A view (count, width) of the bytes that a record points at with `bufferView` and `byteOffset`."""
        view = record.integer("bufferView", high=len(self.document.view_records) - 1)
        data, stride = self.document.view(view)
        start, item = record.integer("byteOffset", 0), dtype.itemsize * width
        step = stride or item
        if step < item:
            raise self.document.view_records[view].invalid("byteStride", f"an integer from {item}")
        end = start + (count - 1) * step + item if count else start
        if end > len(data):
            raise InputError(
                f"'{record.path}' is no valid glTF: {record.where} ends at byte {end} of a bufferView of {len(data)};"
                " export it again."
            )
        if not count:
            return np.zeros((0, width), dtype)
        found = np.ndarray((count, width), dtype, data, start, (step, dtype.itemsize))
        found.flags.writeable = False
        return found

    def _replaced(self, record: Record, base: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """`base` with those elements replaced that a `sparse` object lists."""
        count = record.integer("count", high=len(base))
        places = record.record("indices")
        kind = _component(places)
        if kind.kind != "u":
            raise places.invalid("componentType", "5121, 5123 or 5125 (unsigned integers)")
        chosen = self._elements(places, kind, count, 1)[:, 0]
        if count and int(chosen.max()) >= len(base):
            raise InputError(
                f"'{record.path}' is no valid glTF: {record.where} replaces element {int(chosen.max())} of"
                f" {len(base)}; export it again."
            )
        found = base.copy()
        found[chosen] = self._elements(record.record("values"), base.dtype, count, base.shape[1])
        return found


def _component(record: Record) -> np.dtype[Any]:
    code = record.integer("componentType")
    if code not in COMPONENTS:
        raise record.invalid("componentType", f"one of {', '.join(map(str, COMPONENTS))}")
    return COMPONENTS[code]
