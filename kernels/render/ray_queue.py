"""Rays that walk together: where the live ones are, as points for field kernels, and dropping the finished ones."""

# No postponed annotations here: Warp reads the kernels' own.

import numpy as np
import warp as wp

from ..field.points import PointBlocks, padded_count
from ..runtime.launch import PLAIN_OPTIONS, launch
from .camera import Rays

wp.set_module_options(PLAIN_OPTIONS)


@wp.kernel
def keep_rays_kernel(
    first: int,
    ids: wp.array[int],
    live: wp.array[int],
    rank: wp.array[int],
    # outputs
    out_ids: wp.array[int],
):
    """Move a live ray's id to its rank among the live ones."""
    i = first + wp.tid()
    if live[i] != 0:
        out_ids[rank[i] - 1] = ids[i]


@wp.kernel
def place_points_kernel(
    first: int,
    ids: wp.array[int],
    count: int,
    origin: wp.array[wp.vec3],
    direction: wp.array[wp.vec3],
    distance: wp.array[float],
    # outputs
    out_x: wp.array[float],
    out_y: wp.array[float],
    out_z: wp.array[float],
):
    """The point that a live ray has come to; the last one again in the padding."""
    i = first + wp.tid()
    r = ids[wp.min(i, count - 1)]
    p = origin[r] + distance[r] * direction[r]
    out_x[i] = p[0]
    out_y[i] = p[1]
    out_z[i] = p[2]


class RayQueue:
    """The ids of the rays that are not finished yet, in their first order."""

    def __init__(self, rays: Rays, live: wp.array) -> None:
        count = rays.count
        self.rays = rays
        self.live = live
        self.count = count
        self.ids = wp.array(np.arange(count, dtype=np.int32), dtype=int, device=rays.device)
        self._next = wp.empty(count, dtype=int, device=rays.device)
        self._rank = wp.empty(count, dtype=int, device=rays.device)
        self._xyz = [wp.empty(padded_count(count), dtype=float, device=rays.device) for _ in range(3)]
        self.drop_finished()

    def drop_finished(self) -> None:
        """Keep the rays whose entry in `live` is not 0."""
        if not self.count:
            return
        wp.utils.array_scan(self.live[: self.count], self._rank[: self.count], inclusive=True)
        kept = int(self._rank[self.count - 1 : self.count].numpy()[0])
        if kept < self.count:
            launch(
                keep_rays_kernel,
                self.count,
                [self.ids, self.live, self._rank],
                [self._next],
                self.rays.device,
                seconds_per_thread=3e-9,
            )
            self.ids, self._next = self._next, self.ids
            self.count = kept

    def points(self, distance: wp.array) -> PointBlocks:
        """Points of the live rays at their `distance`."""
        size = padded_count(self.count)
        x, y, z = (column[:size] for column in self._xyz)
        launch(
            place_points_kernel,
            size,
            [self.ids, self.count, self.rays.origin, self.rays.direction, distance],
            [x, y, z],
            self.rays.device,
            seconds_per_thread=5e-9,
        )
        return PointBlocks(x, y, z, self.count)
