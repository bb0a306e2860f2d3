"""One primitive of an assembly: a family, where it lies, its parameters, how it blends in, its colour.

Numbers are kept as the shortest decimals that name their float32 value, so that what was saved and loaded is
the same object and the same bytes. All is checked when a primitive is made; a message names the field.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from resfit.errors import AssemblyError

from ..kernels.primitives import FAMILIES, Family, Parameter
from ..kernels.rotation import matrix_of
from ..kernels.rows import BLEND, ROTATION, ROW, SHAPES, TRANSLATION, empty_rows
from .colors import PALETTE

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

MAX_NAME = 128
"""Letters in a name: longer ones break file formats that the parts are exported to."""

EXACT_NORM, NEAR_NORM = 1e-6, 1e-2
"""A quaternion whose length is this near 1 is kept to the bit (rounding to float32 moves it by 1e-7), or is
normalised (digits were cut); farther away it is a mistake, and an error."""

_COLOR = re.compile(r"#[0-9a-fA-F]{6}")


@dataclass(frozen=True)
class Pose:
    """Pose of a primitive, in the normalised frame.

    Raises:
        AssemblyError: if a number is not finite, or the rotation is not a unit quaternion.
    """

    translation: Vector = (0.0, 0.0, 0.0)
    """The centre."""
    rotation: Quaternion = (1.0, 0.0, 0.0, 0.0)
    """Unit quaternion (w, x, y, z), local to world."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "translation", _numbers("translation", self.translation, 3))
        object.__setattr__(self, "rotation", _unit_quaternion(_numbers("rotation", self.rotation, 4)))

    def matrix(self) -> np.ndarray:
        """The rotation as a matrix (3, 3) float64: world = matrix @ local + translation."""
        return matrix_of(self.rotation)


@dataclass(frozen=True)
class Primitive:
    """A primitive in the normalised frame; see `kernels/primitives/` for the families and their parameters.

    Raises:
        AssemblyError: if a field is missing, unknown or out of its legal range; the message names it.
    """

    family: str
    name: str
    pose: Pose
    parameters: Mapping[str, float | Vector]
    """Every parameter of the family, by name, a number or three; read-only."""
    blend: float = 0.0
    """Radius of the smooth union with all primitives before this one; 0 is the hard union."""
    color: str = PALETTE[0]
    """`#rrggbb`."""

    def __post_init__(self) -> None:
        if self.family not in FAMILIES:
            raise AssemblyError(f"family is {shown(self.family)}; there are {', '.join(FAMILIES)}")
        _check_name(self.name)
        values = _checked_parameters(FAMILIES[self.family], self.parameters)
        object.__setattr__(self, "parameters", MappingProxyType(values))
        blend = _number("blend", self.blend)
        if blend < 0.0:
            raise AssemblyError(f"blend is {blend:g}; it must be 0 or more")
        object.__setattr__(self, "blend", blend)
        if not (isinstance(self.color, str) and _COLOR.fullmatch(self.color)):
            raise AssemblyError(f"color is {shown(self.color)}; it must look like #4477aa")
        object.__setattr__(self, "color", self.color.lower())

    def __hash__(self) -> int:
        return hash(
            (self.family, self.name, self.pose, tuple(self.parameters.items()), self.blend, self.color)
        )

    def __reduce__(self) -> tuple[Any, ...]:
        # A read-only view cannot be pickled, and worker processes are sent primitives.
        return Primitive, (self.family, self.name, self.pose, dict(self.parameters), self.blend, self.color)

    def row(self) -> np.ndarray:
        """This primitive as one row (ROW,) float32 of `kernels/rows.py`."""
        row = empty_rows(1)[0]
        row[TRANSLATION : TRANSLATION + 3] = self.pose.translation
        row[ROTATION : ROTATION + 4] = self.pose.rotation
        row[SHAPES:BLEND] = FAMILIES[self.family].shape_row(**self.parameters)
        row[BLEND] = self.blend
        return row

    @classmethod
    def from_row(
        cls, family: str, name: str, row: Sequence[float] | np.ndarray, color: str = PALETTE[0]
    ) -> Primitive:
        """The primitive of a row (ROW,) of `kernels/rows.py`; its gate is ignored.

        Raises:
            AssemblyError: if the row holds a value outside the legal range of its field.
        """
        values = np.asarray(row, np.float32)
        if values.shape != (ROW,):
            raise AssemblyError(f"a row has {ROW} numbers, not shape {values.shape}")
        if family not in FAMILIES:
            raise AssemblyError(f"family is {shown(family)}; there are {', '.join(FAMILIES)}")
        w, x, y, z = values[ROTATION : ROTATION + 4].tolist()
        a, b, c = values[TRANSLATION : TRANSLATION + 3].tolist()
        shape = values[SHAPES:BLEND]
        parameters: dict[str, Any] = {}
        for parameter in FAMILIES[family].parameters:
            numbers = shape[FAMILIES[family].columns(parameter.name)].tolist()
            parameters[parameter.name] = numbers if parameter.count > 1 else numbers[0]
        return cls(family, name, Pose((a, b, c), (w, x, y, z)), parameters, float(values[BLEND]), color)


def shown(value: Any) -> str:
    """`value` for a message: JSON on one line, ASCII, cut where it gets long."""
    try:
        text = json.dumps(value)
    except (TypeError, ValueError, RecursionError):
        text = ascii(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _checked_parameters(family: Family, given: Any) -> dict[str, float | Vector]:
    if not isinstance(given, Mapping):
        raise AssemblyError(f"parameters must be an object with the parameters of a {family.name}")
    names = [parameter.name for parameter in family.parameters]
    for name in given:
        if name not in names:
            raise AssemblyError(
                f"parameters has an unknown field {shown(name)}; a {family.name} has {', '.join(names)}"
            )
    values = {}
    for parameter in family.parameters:
        if parameter.name not in given:
            raise AssemblyError(f"parameters.{parameter.name} is missing")
        values[parameter.name] = _checked_parameter(parameter, given[parameter.name])
    return values


def _checked_parameter(parameter: Parameter, value: Any) -> Any:
    path = f"parameters.{parameter.name}"
    low, high = parameter.legal
    numbers = (_number(path, value),) if parameter.count == 1 else _numbers(path, value, parameter.count)
    for index, number in enumerate(numbers):
        if not low <= number <= high:
            place = path if parameter.count == 1 else f"{path}[{index}]"
            allowed = (
                f"it must be {low:g} or more" if math.isinf(high) else f"it must lie in [{low:g}, {high:g}]"
            )
            raise AssemblyError(f"{place} is {number:g}; {allowed}")
    return numbers[0] if parameter.count == 1 else numbers


def _number(path: str, value: Any) -> float:
    """`value` as the shortest decimal of its float32 value."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.integer | np.floating):
        raise AssemblyError(f"{path} is {shown(value)}; it must be a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    # Above this float32 rounds to infinity.
    if not abs(number) < 3.4028235e38:
        raise AssemblyError(f"{path} must be a finite number of float32 size")
    single = np.float32(number)
    short = float(str(single))
    return (short if np.float32(short) == single else float(single)) + 0.0


def _numbers(path: str, value: Any, count: int) -> Any:
    """`value` as a tuple of `count` numbers."""
    if (
        isinstance(value, str | bytes | Mapping)
        or not hasattr(value, "__len__")
        or not hasattr(value, "__getitem__")
    ):
        raise AssemblyError(f"{path} is {shown(value)}; it must be a list of {count} numbers")
    if len(value) != count:
        raise AssemblyError(f"{path} has {len(value)} values; it must have {count}")
    return tuple(_number(f"{path}[{index}]", value[index]) for index in range(count))


def _unit_quaternion(quaternion: Quaternion) -> Quaternion:
    norm = math.hypot(*quaternion)
    if norm == 0.0:
        raise AssemblyError("rotation is zero; it must be a unit quaternion [w, x, y, z]")
    if abs(norm - 1.0) > NEAR_NORM:
        raise AssemblyError(f"rotation has length {norm:.4g}; it must be a unit quaternion [w, x, y, z]")
    if abs(norm - 1.0) <= EXACT_NORM:
        return quaternion
    return _numbers("rotation", [value / norm for value in quaternion], 4)


def _check_name(name: Any) -> None:
    if not isinstance(name, str) or not name.strip() or len(name) > MAX_NAME or not name.isprintable():
        raise AssemblyError(f"name is {shown(name)}; it must be 1 to {MAX_NAME} printable characters")
