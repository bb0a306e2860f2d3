"""The numbers of a part: its sliders, and edits of its shape, place and blend that go on until a commit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ...assembly.primitive import Pose, Primitive, Quaternion, Vector
from .edit_state import PartRef, State
from .parameters import Slider, part_sliders, with_value
from .poses import placed, scaled_parameters, to_angles, to_vector, turned


class PartEditor:
    """Edits of single parts. Each shows at once and is no step of undo by itself.

    Every method raises InputError if there is no such part.
    """

    def __init__(self, state: Callable[[], State], put: Callable[[PartRef, Primitive], None]) -> None:
        """Edit the parts of what `state` gives; `put` takes the edited ones."""
        self._state, self._put = state, put
        # Angles are remembered beside the quaternion made of them: beyond 90 degrees about y others name it too.
        self._turned: tuple[Quaternion, Vector] | None = None

    def sliders(self, ref: PartRef) -> tuple[Slider, ...]:
        """Everything that can be set of a part, with its values."""
        state, part = self._state(), self._part(ref)
        return part_sliders(part, state.index(ref) == 0, self._angles(part))

    def set_value(self, ref: PartRef, slider_id: str, value: float) -> None:
        """Set one number of a part: `size.0`, `taper`, `translation.2`, `rotation.1` (degrees), `blend`.

        Raises:
            InputError: if there is no such number.
        """
        part = self._part(ref)
        angles = self._angles(part)
        made = with_value(part, slider_id, value, angles)
        if slider_id.startswith("rotation."):
            changed = list(angles)
            changed[int(slider_id[-1])] = min(max(value, -360.0), 360.0)
            self._turned = made.pose.rotation, to_vector(changed)
        self._put(ref, made)

    def set_parameter(self, ref: PartRef, name: str, value: float | Vector) -> None:
        """Set a whole parameter of a part's family.

        Raises:
            AssemblyError: if the family has none of that name, or the value is not legal.
        """
        part = self._part(ref)
        self._put(ref, replace(part, parameters={**part.parameters, name: value}))

    def set_blend(self, ref: PartRef, blend: float) -> None:
        """Set the radius with which a part joins those before it, normalised units."""
        self._put(ref, replace(self._part(ref), blend=blend))

    def move(self, ref: PartRef, offset: npt.ArrayLike) -> None:
        """Move a part by `offset` (3,)."""
        part = self._part(ref)
        place = to_vector(np.add(part.pose.translation, offset))
        self._put(ref, replace(part, pose=Pose(place, part.pose.rotation)))

    def rotate(self, ref: PartRef, angles: Vector) -> None:
        """Turn a part about its own centre: about x, then y, then z of the normalised frame, in degrees."""
        part = self._part(ref)
        pose = Pose(part.pose.translation, turned(part.pose.rotation, angles))
        self._put(ref, replace(part, pose=pose))

    def scale(self, ref: PartRef, factors: float | npt.ArrayLike) -> None:
        """Scale a part about its centre along its own axes, by one factor for all its lengths or one an axis (3,)."""
        part = self._part(ref)
        self._put(ref, replace(part, parameters=scaled_parameters(part, factors)))

    def place(self, ref: PartRef, matrix: npt.ArrayLike, base: Primitive | None = None) -> None:
        """Move, turn and stretch a part as a gizmo says.

        Args:
            ref: which part.
            matrix: (4, 4), takes the local frame of `base` to the normalised one: a rotation with scaled columns.
            base: the part as it was when the gizmo was taken hold of; as it is now unless given.

        Raises:
            InputError: if the matrix flattens or mirrors the part.
        """
        self._put(ref, placed(base or self._part(ref), matrix))

    def _part(self, ref: PartRef) -> Primitive:
        return self._state().part(ref)

    def _angles(self, part: Primitive) -> Vector:
        if self._turned is not None and self._turned[0] == part.pose.rotation:
            return self._turned[1]
        return to_angles(part.pose.rotation)
