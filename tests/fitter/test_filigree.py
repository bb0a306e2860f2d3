"""Thin ornaments come back as their wires, and not as the slab that they span."""

from __future__ import annotations

import numpy as np
import trimesh

import resfit


def star(points: int, step: int, radius: float) -> trimesh.Trimesh:
    """A star of straight wires between every `step`th of some points on a circle of radius 1."""
    angles = 2.0 * np.pi * step * np.arange(points + 1) / points
    corners = np.stack([np.cos(angles), np.sin(angles), np.zeros(points + 1)], axis=1)
    wires = [
        trimesh.creation.cylinder(radius, segment=[corners[k], corners[k + 1]], sections=12)
        for k in range(points)
    ]
    return trimesh.util.concatenate(wires)


def test_a_star_of_wires_is_no_slab() -> None:
    result = resfit.fit(star(7, 2, 0.012), preset="fast", per_part="off")
    assert result.metrics["iou"] > 0.5
    assert len(result.assembly.primitives) >= 7
    # Each part is a wire, or a piece of one: long and thin in two ways.
    for part in result.assembly.primitives:
        sizes = np.sort(np.array(part.parameters["size"]) + 2.0 * float(part.parameters["dilation"]))
        assert sizes[1] < 0.3 or sizes[2] < 0.5
