"""Between two steps of a playback: parts of the same name move and change shape, others grow or shrink away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...assembly.colors import rgb
from ...assembly.primitive import Pose, Primitive, Quaternion
from ..model.poses import scaled_parameters, to_vector
from .playback import Frame

SMALLEST_SHARE = 0.03
"""Parts that are smaller than this share of their size are not there yet, or no longer."""


def tween(before: Frame, after: Frame, share: float) -> Frame:
    """Interpolate between two steps.

    Args:
        before, after: the steps.
        share: of the way from one to the other, 0 to 1; at the end it is `after` itself.
    """
    if share >= 1.0:
        return after
    old = {part.name: part for part in before.assembly.primitives}
    new = {part.name: part for part in after.assembly.primitives}
    parts = [
        mixed(old[name], part, share) if name in old else _resized(part, share)
        for name, part in new.items()
        if name in old or share > SMALLEST_SHARE
    ]
    parts += [
        _resized(part, 1.0 - share)
        for name, part in old.items()
        if name not in new and 1.0 - share > SMALLEST_SHARE
    ]
    # What surrounds the parts and the caption go first, then come those of the next step.
    shown = before if share < 0.5 else after
    return replace(
        shown,
        assembly=replace(after.assembly, primitives=tuple(parts)),
        strength=abs(1.0 - 2.0 * share) * shown.strength,
    )


def mixed(old: Primitive, new: Primitive, share: float) -> Primitive:
    """A part on its way from one shape and place to another, `share` of the way done; families must be the same."""
    if old.family != new.family:
        return new
    if old == new:
        return new

    def mix(a: object, b: object) -> np.ndarray:
        return (1.0 - share) * np.asarray(a, np.float64) + share * np.asarray(b, np.float64)

    parameters = {}
    for name, value in new.parameters.items():
        between = mix(old.parameters[name], value)
        parameters[name] = to_vector(between) if between.ndim else float(between)
    turn = np.asarray(old.pose.rotation)
    # A quaternion and its negative are the same turn: take the nearer one.
    turn = mix(turn if turn @ np.asarray(new.pose.rotation) >= 0.0 else -turn, new.pose.rotation)
    w, x, y, z = (float(value) for value in turn / np.linalg.norm(turn))
    rotation: Quaternion = (w, x, y, z)
    pose = Pose(to_vector(mix(old.pose.translation, new.pose.translation)), rotation)
    color = np.round(255.0 * mix(rgb(old.color), rgb(new.color))).astype(int)
    return replace(
        new, pose=pose, parameters=parameters, blend=float(mix(old.blend, new.blend)),
        color=f"#{color[0]:02x}{color[1]:02x}{color[2]:02x}",
    )  # fmt: skip


def _resized(part: Primitive, share: float) -> Primitive:
    """A part at a share of its size, in its place."""
    return replace(part, parameters=scaled_parameters(part, share), blend=share * part.blend)
