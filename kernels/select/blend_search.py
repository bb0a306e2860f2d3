"""Trial blend radii of one primitive: the smooth union with each, from its primitives' distances.

At a point only few primitives can change the union: those nearer, by the widest blend, than all before them. The rest
are left out once and for all, without any change of the values.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..field.combine import smooth_minimum_double
from ..runtime.buffers import Buffer
from ..runtime.launch import VECTOR_OPTIONS, launch
from ..runtime.launch_graph import LaunchGraph
from .objective_sums import BARE_C, SUMS, SUMS_C

wp.set_module_options(VECTOR_OPTIONS)

CHUNK = 256
"""Points a thread sums over."""
CHUNK_C = wp.constant(CHUNK)


@wp.kernel
def list_active_kernel(
    first: int,
    values: wp.array[float],
    widest: wp.array[float],
    point_count: int,
    # outputs
    out_ids: wp.array[int],
    out_values: wp.array[float],
    out_next: wp.array[int],
):
    """List the primitives after the first that can change the union at one point, in order, and their values there.

    The list ends with a number that no primitive has.
    """
    i = first + wp.tid()
    count = widest.shape[0]
    at = i * count
    nearest = values[i]
    for k in range(1, count):
        value = values[k * point_count + i]
        if value < nearest + widest[k]:
            out_ids[at] = k
            out_values[at] = value
            at += 1
        nearest = wp.min(nearest, value)
    out_ids[at] = count
    out_next[i] = out_ids[i * count]


@wp.struct
class Blended:
    """Points of a union: their active primitives and values from `list_active_kernel`, and how they are summed."""

    ids: wp.array[int]
    values: wp.array[float]
    kind: wp.array[int]
    weight: wp.array[wp.float64]
    bare: wp.array[int]


@wp.kernel
def try_blends_kernel(
    first: int,
    number: wp.array[int],
    choices: wp.array[wp.float64],
    blends: wp.array[wp.float64],
    points: Blended,
    # outputs
    out_next: wp.array[int],
    out_place: wp.array[int],
    out_prefix: wp.array[wp.float64],
    out_sums: wp.array[wp.float64],
):
    """Sum, for each choice of the blend of primitive `number`, the points of a chunk where that choice matters.

    Points move on: `out_next` is the next primitive that counts, `out_place` its place in their list, `out_prefix` the
    union before it.
    """
    chunk = first + wp.tid()
    k = number[0]
    count = blends.shape[0]
    choice_count = choices.shape[0]
    widest = wp.float64(0.0)
    for choice in range(choice_count):
        widest = wp.max(widest, choices[choice])
    store = chunk * choice_count * SUMS_C
    for entry in range(choice_count * SUMS_C):
        out_sums[store + entry] = wp.float64(0.0)
    for i in range(chunk * CHUNK_C, wp.min(points.weight.shape[0], (chunk + 1) * CHUNK_C)):
        at = i * count + out_place[i]
        if out_next[i] == k - 1:
            out_prefix[i] = smooth_minimum_double(out_prefix[i], wp.float64(points.values[at]), blends[k - 1])
            at += 1
            out_place[i] = out_place[i] + 1
            out_next[i] = points.ids[at]
        if out_next[i] != k:
            continue
        value = wp.float64(points.values[at])
        prefix = out_prefix[i]
        # A point that lies in either is in the union whatever the blend.
        if wp.min(value, prefix) >= wp.float64(0.0) and wp.abs(value - prefix) < widest:
            for choice in range(choice_count):
                union = smooth_minimum_double(prefix, value, choices[choice])
                later = at + 1
                while points.ids[later] < count:
                    union = smooth_minimum_double(
                        union, wp.float64(points.values[later]), blends[points.ids[later]]
                    )
                    later += 1
                if union < wp.float64(0.0):
                    sums = store + choice * SUMS_C
                    out_sums[sums + points.kind[i]] = out_sums[sums + points.kind[i]] + points.weight[i]
                    if points.bare[i] != 0:
                        out_sums[sums + BARE_C] = out_sums[sums + BARE_C] + wp.float64(1.0)


class BlendTrials:
    """A smooth union of primitives in a row, at points, whose blends are tried one after another.

    Attributes:
        blends: (primitive_count,) float64, those of the moment; the first is unused.
    """

    def __init__(
        self,
        values: np.ndarray,
        blends: np.ndarray,
        widest: float,
        choice_count: int,
        kind: np.ndarray,
        weight: np.ndarray,
        bare: np.ndarray,
        device: wp.Device,
    ):
        """Begin with the second primitive.

        Args:
            values: (primitive_count, n) distances.
            blends: (primitive_count,).
            widest: at least as wide as any choice.
            choice_count: of the blends that are tried at a time.
            kind, weight: of the points, (n,); see `objective_sums`.
            bare: (n,), which points of the box no primitive holds.
            device: where to try.
        """
        count, self.point_count = values.shape
        self.device = device
        self.blends, self.number = Buffer(count, np.float64, device), Buffer(1, np.int32, device)
        self.choices = Buffer(choice_count, np.float64, device)
        self.blends.host[:] = blends
        self.next = wp.empty(self.point_count, dtype=int, device=device)
        self.points = Blended()
        self.points.ids = wp.empty(values.size, dtype=int, device=device)
        self.points.values = wp.empty(values.size, dtype=float, device=device)
        self.points.kind, self.points.bare = (
            wp.array(given.astype(np.int32), dtype=int, device=device) for given in (kind, bare)
        )
        self.points.weight = wp.array(weight, dtype=wp.float64, device=device)
        limits = np.maximum(blends, widest).astype(np.float32)
        launch(
            list_active_kernel,
            self.point_count,
            [
                *(wp.array(given, dtype=float, device=device) for given in (values.ravel(), limits)),
                self.point_count,
            ],
            [self.points.ids, self.points.values, self.next],
            device,
            seconds_per_thread=2e-9 * count,
        )
        self.place = wp.zeros(self.point_count, dtype=int, device=device)
        self.prefix = wp.array(values[0].astype(np.float64), dtype=wp.float64, device=device)
        self.chunks = -(-self.point_count // CHUNK)
        self.sums = Buffer(self.chunks * choice_count * SUMS, np.float64, device)
        self.run = LaunchGraph(self._launch, device, capture=False)

    def _launch(self) -> None:
        launch(
            try_blends_kernel,
            self.chunks,
            [
                self.number.array,
                self.choices.array,
                self.blends.array,
                self.points,
            ],
            [self.next, self.place, self.prefix, self.sums.array],
            self.device,
            seconds_per_thread=5e-6,
        )

    def sums_of(self, number: int, choices: Sequence[float] | np.ndarray) -> np.ndarray:
        """Sums over the union with each choice of the blend of a primitive, those of all others as in `blends`.

        Points are left out to which that blend makes no difference. Primitives are asked for in order, none left out.

        Returns:
            (choices, SUMS) float64, columns as in `Sums`, `twice` 0.
        """
        self.number.host[0], self.choices.host[:] = number, choices
        for buffer in (self.number, self.choices, self.blends):
            buffer.upload()
        self.run()
        return self.sums.download().reshape(self.chunks, -1, SUMS).sum(0)
