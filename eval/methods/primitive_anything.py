"""The JSON of PrimitiveAnything (Ye et al., SIGGRAPH 2025) as an assembly. Untested against the tool itself.

What is public about the tool's output: a primitive is a class (cuboid, elliptical cylinder or ellipsoid), a scale, a
rotation by Euler angles in x-y-z order, and a translation (section 3 of the paper, arXiv 2505.04622); the file is a
list of objects with `type_id` or `type_name`, `location`, `rotation` (degrees), `scale`, or an object that holds such a
list; the ids are those of the shapes CubeBevel, SphereSharp and CylinderSharp. Beside the JSON the tool's demo writes a
GLB with one coloured mesh a primitive, which the method `file` takes as it is.

What is not public is taken to be so, and may be changed by options: a shape of scale 1 spans [-1, 1] (`unit`, its half
extent); the cylinder stands along z (`axis`); the angles turn about fixed axes (`euler`: xyz fixed, XYZ moving); and,
since the tool normalises its input and does not say how to go back, the primitives' common box is laid over the mesh's,
centre on centre, longest side on longest side (`align`: bounds or none). `align` helps a result that is off in
size: where the tool's GLB is at hand in the mesh's frame, prefer it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from resfit.errors import InputError

from ...assembly.assembly import Assembly
from ...assembly.colors import palette_color
from ...assembly.primitive import Pose, Primitive
from ...assembly.transform import NORMALISED_SIDE, Transform
from ...kernels.rotation import quaternion_of

TYPE_IDS = {1101002001034001: "cuboid", 1101002001034002: "cylinder", 1101002001034010: "ellipsoid"}

WORDS = {
    "cub": "cuboid",
    "box": "cuboid",
    "cylinder": "cylinder",
    "sphere": "ellipsoid",
    "ellipsoid": "ellipsoid",
}
"""What a `type_name` contains."""

DEFAULTS: dict[str, Any] = {"unit": 1.0, "axis": "z", "euler": "xyz", "align": "bounds"}

TURNS = {"z": np.eye(3), "x": np.eye(3)[:, [1, 2, 0]], "y": np.eye(3)[:, [2, 0, 1]]}
"""Axes of a superquadric, in columns, whose local z is the named axis of the tool's shape."""


def read_primitives(document: Any, mesh_path: Path, options: Mapping[str, Any]) -> Assembly:
    """The assembly of a decoded JSON file, in the frame of a mesh.

    Args:
        document: a list of primitives, or an object with one list of objects in it.
        mesh_path: the mesh that was decomposed, for its bounding box.
        options: `unit`, `axis`, `euler`, `align`, see above.

    Raises:
        InputError: if this is no such file, or an option makes no sense.
    """
    if options["axis"] not in TURNS or options["euler"] not in ("xyz", "XYZ"):
        raise InputError("axis must be x, y or z, and euler xyz or XYZ.")
    if options["align"] not in ("bounds", "none") or not options["unit"] > 0.0:
        raise InputError("align must be bounds or none, and unit above 0.")
    entries = _entries(document)
    parts = [_part(number, entry, options) for number, entry in enumerate(entries)]
    low = np.min([centre - reach for _, centre, _, _, reach in parts], axis=0)
    high = np.max([centre + reach for _, centre, _, _, reach in parts], axis=0)
    middle, scale = 0.5 * (low + high), NORMALISED_SIDE / float((high - low).max())
    primitives = []
    for number, (kind, centre, axes, size, _) in enumerate(parts):
        pose = Pose(_numbers(scale * (centre - middle)), _quaternion(axes))
        family, shape = _shape(kind, scale * size)
        primitives.append(Primitive(family, f"part_{number:02d}", pose, shape, 0.0, palette_color(number)))
    if options["align"] == "none":
        return Assembly(tuple(primitives), Transform(1.0 / scale, _numbers(middle)))
    from ...shape.load import load_mesh

    vertices = load_mesh(mesh_path).vertices
    return Assembly(tuple(primitives), Transform.from_bounds(vertices.min(axis=0), vertices.max(axis=0)))


def _entries(document: Any) -> list[dict[str, Any]]:
    """The primitives' own objects."""
    lists = [document] if isinstance(document, list) else []
    if isinstance(document, dict):
        lists = [value for value in document.values() if isinstance(value, list)]
    for found in lists:
        if found and all(isinstance(entry, dict) and "scale" in entry for entry in found):
            return found
    raise InputError("the JSON holds no list of primitives with type, location, rotation and scale.")


def _part(
    number: int, entry: Mapping[str, Any], options: Mapping[str, Any]
) -> tuple[str, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Kind, centre (3,), axes (3, 3) in columns, full extents (3,) along them, half extents of the box around it."""
    from scipy.spatial.transform import Rotation

    kind = _kind(number, entry)
    try:
        centre, angles, scale = (
            np.array([float(value) for value in entry[name]]) for name in ("location", "rotation", "scale")
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"primitive {number} lacks numbers for location, rotation or scale.") from error
    if {len(centre), len(angles), len(scale)} != {3} or not np.isfinite([centre, angles, scale]).all():
        raise InputError(
            f"primitive {number} must have three finite numbers each of location, rotation and scale."
        )
    axes = Rotation.from_euler(options["euler"], angles, degrees=True).as_matrix()
    size = 2.0 * options["unit"] * np.abs(scale)
    turn = TURNS[options["axis"]] if kind == "cylinder" else TURNS["z"]
    axes, size = axes @ turn, size @ turn
    return kind, centre, axes, size, np.abs(axes) @ (0.5 * size)


def _kind(number: int, entry: Mapping[str, Any]) -> str:
    identity = entry.get("type_id")
    if isinstance(identity, int) and identity in TYPE_IDS:
        return TYPE_IDS[identity]
    name = str(entry.get("type_name", "")).lower()
    for word, kind in WORDS.items():
        if word in name:
            return kind
    raise InputError(f"primitive {number} is of an unknown kind: type_id {identity!r}, type_name {name!r}.")


def _shape(kind: str, size: np.ndarray) -> tuple[str, dict[str, Any]]:
    """Family and parameters. A superquadric of exponents 0 and 1 is an elliptical cylinder along z."""
    if kind == "cuboid":
        return "cuboid", {"size": _numbers(size)}
    return "superquadric", {"size": _numbers(size), "exponents": (0.0 if kind == "cylinder" else 1.0, 1.0)}


def _numbers(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _quaternion(axes: np.ndarray) -> tuple[float, float, float, float]:
    w, x, y, z = (float(value) for value in quaternion_of(axes))
    return w, x, y, z
