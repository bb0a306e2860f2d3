"""Features of surface points for IntraPrim and InterPrim, made by whatever the user has.

They may come from another environment altogether: from a command that reads and writes NumPy files, or from an
installed package that registers a function under the entry-point group `resfit.features`.
"""

from __future__ import annotations

import shlex
import subprocess
import tempfile
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import numpy as np

from resfit.errors import InputError

GROUP = "resfit.features"
"""Entry points: functions of a mesh's path and points (n, 3), mesh units, that return features (n, d), or points and
features of their own choice."""

POINT_COUNT = 8192
"""Points on the target's surface that features are asked for."""

COMMAND_SECONDS = 3600.0
"""A command that loads a network and extracts features takes minutes at most."""

FIELDS = ("{mesh}", "{points}", "{out}")

Features = tuple[np.ndarray, np.ndarray]
"""Points (n, 3), mesh units, and their features (n, d)."""
FeatureFunction = Callable[[Path, np.ndarray], Any]


def make_features(source: Any, mesh: Any, points: np.ndarray) -> Features:
    """Features on a target's surface.

    Args:
        source: points and features as a pair of arrays; a function as an entry point's; the name of an entry point; a
            .npz file with arrays `points` and `features`; or a command, in which {mesh}, {points} and {out} stand for
            the mesh's file, a .npy file of points, and the .npy file that it is to write (or .npz with both arrays).
        mesh: the target, a path or a trimesh object.
        points: (n, 3) on its surface, mesh units: where features are wanted.

    Raises:
        InputError: if the source cannot be used or fails.
    """
    if isinstance(source, tuple | list) and len(source) == 2:
        return _checked(source, points, "the features")
    if callable(source):
        return _called(source, mesh, points, getattr(source, "__name__", "the function"))
    if not isinstance(source, str | Path):
        raise InputError(f"features cannot come from a {type(source).__name__}; give points and features.")
    text = str(source)
    if "{out}" in text:
        return _run(text, mesh, points)
    if text.endswith(".npz"):
        return _checked(_load(Path(text)), points, f"'{text}'")
    names = sorted(entry.name for entry in entry_points(group=GROUP))
    if text not in names:
        known = f"installed are {', '.join(names)}" if names else f"no package here registers one ({GROUP})"
        raise InputError(
            f"'{text}' is neither a command with {{mesh}}, {{points}} and {{out}}, nor a .npz file, nor an installed"
            f" source of features; {known}."
        )
    (entry,) = [found for found in entry_points(group=GROUP) if found.name == text][:1]
    return _called(entry.load(), mesh, points, text)


def _called(function: FeatureFunction, mesh: Any, points: np.ndarray, name: str) -> Features:
    with tempfile.TemporaryDirectory() as folder:
        try:
            result = function(_mesh_file(mesh, Path(folder)), points)
        except Exception as error:
            raise InputError(f"{name} made no features: {error or type(error).__name__}") from error
    return _checked(result, points, name)


def _run(template: str, mesh: Any, points: np.ndarray) -> Features:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        values = {"{points}": folder / "points.npy", "{out}": folder / "features.npy"}
        values["{mesh}"] = _mesh_file(mesh, folder)
        np.save(values["{points}"], points)
        try:
            command = shlex.split(template)
        except ValueError as error:
            raise InputError(f"the command for features cannot be understood ({error}).") from error
        for field in FIELDS:
            command = [word.replace(field, str(values[field])) for word in command]
        try:
            done = subprocess.run(
                command,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=COMMAND_SECONDS,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise InputError(f"the command for features did not run: {error}") from error
        if done.returncode:
            lines = done.stderr.strip().splitlines() or ["it said nothing"]
            raise InputError(f"the command for features ended with exit code {done.returncode}: {lines[-1]}")
        both = values["{out}"].with_suffix(".npz")
        return _checked(_load(both if both.exists() else values["{out}"]), points, "the command")


def _mesh_file(mesh: Any, folder: Path) -> Path:
    """The file of a mesh; one in memory is written to `folder`."""
    if isinstance(mesh, str | Path):
        return Path(mesh).resolve()
    import trimesh

    path = folder / "mesh.glb"
    scene = mesh if isinstance(mesh, trimesh.Scene) else trimesh.Scene(mesh)
    scene.export(path)
    return path


def _load(path: Path) -> Any:
    try:
        loaded = np.load(path, allow_pickle=False)
        return (loaded["points"], loaded["features"]) if path.suffix == ".npz" else loaded
    except (OSError, ValueError, KeyError, EOFError) as error:
        raise InputError(
            f"there are no features in '{path}': give an array (n, d) in a .npy file, or `points` and `features` in a"
            " .npz file."
        ) from error


def _checked(result: Any, points: np.ndarray, name: str) -> Features:
    """Points and features of the answer of a source; without points of its own, those it was asked for."""
    where, features = result if isinstance(result, tuple | list) and len(result) == 2 else (points, result)
    where, features = np.asarray(where), np.asarray(features)
    if where.ndim != 2 or where.shape[1:] != (3,) or features.ndim != 2 or len(where) != len(features):
        raise InputError(
            f"{name} gave features of shape {features.shape} at points of shape {where.shape}; give (n, d) at (n, 3)."
        )
    if not len(where) or not np.isfinite(np.asarray(where, np.float64)).all():
        raise InputError(f"{name} gave no points, or points that are not finite numbers.")
    return where.astype(np.float64), features
