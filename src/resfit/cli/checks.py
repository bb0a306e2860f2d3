"""The single checks of `resfit doctor`. None raises: what fails is the answer.

What can take the whole process down with it (VTK without a display, browsers) is tried in a child process.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from resfit.errors import ResfitError
from resfit.viewer.probe import PACKAGES, SECONDS, finish_child, probe_rendering, start_child

CHILD_SECONDS = SECONDS


@dataclass(frozen=True)
class Check:
    """One line of the report."""

    name: str
    ok: bool
    detail: str
    fix: str = ""
    """What to do where it is not ok: one line."""
    core: bool = False
    """Whether fitting and exporting need it."""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


OPTIONAL = (
    # package, what for, how to get it
    ("coacd", "compare with CoACD", "pip install coacd"),
    ("mujoco", "check exported physics models", "pip install mujoco"),
    ("usd-core", "export USD", "pip install usd-core"),
    ("build123d", "export STEP", "pip install build123d"),
    ("trame", "view in a browser", "pip install trame trame-vtk"),
    ("ray", "batches on a cluster", "pip install ray"),
)

CHROMIUM_PROBE = """
import shutil
from playwright.sync_api import sync_playwright
found = [path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))]
with sync_playwright() as playwright:
    browser = playwright.chromium.launch(executable_path=found[0] if found else None, args=["--no-sandbox"])
    print("Chromium", browser.version)
    browser.close()
"""


def run_checks(device: str, warm: bool) -> list[Check]:
    """All checks, the core first.

    Args:
        device: `auto` (the CPU), `cpu`, `cuda:0`.
        warm: compile every kernel module too.
    """
    core: list[tuple[str, Callable[[], str], str]] = [
        ("python", lambda: f"{platform.python_version()} on {platform.system()} {platform.machine()}", ""),
        ("resfit", _packages, "pip install resfit"),
        ("devices", lambda: _devices(device), "use --device cpu"),
        ("kernels", lambda: _kernels(device), "pip install --force-reinstall warp-lang"),
    ]
    if warm:
        core.append(("warm", lambda: _warm(device), ""))
    checks = [_tried(name, probe, fix, core=True) for name, probe, fix in core]
    checks.append(_tried("ray tracer", lambda: _ray_tracer(device), "try --device cpu"))
    checks.append(_tried("pyvista", _pyvista, f"on Linux: install {PACKAGES}"))
    browser = "pip install playwright && playwright install --with-deps chromium"
    checks.append(_tried("chromium", lambda: _child(CHROMIUM_PROBE), browser))
    for package, purpose, fix in OPTIONAL:
        checks.append(_optional(package, purpose, fix))
    return checks


def _tried(name: str, probe: Callable[[], str], fix: str, core: bool = False) -> Check:
    try:
        return Check(name, True, probe(), fix, core)
    except ResfitError as error:
        return Check(name, False, str(error), fix, core)
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        return Check(name, False, reason[:200], fix, core)


def _optional(package: str, purpose: str, fix: str) -> Check:
    try:
        return Check(package, True, f"{version(package)}, {purpose}", fix)
    except PackageNotFoundError:
        return Check(package, False, f"not installed, {purpose}", fix)


def _packages() -> str:
    names = ("resfit", "warp-lang", "numpy", "scipy", "trimesh")
    return ", ".join(f"{name} {version(name)}" for name in names)


def _devices(device: str) -> str:
    import warp as wp

    from resfit.kernels.cores import core_count
    from resfit.kernels.launch import choose_device

    chosen = choose_device(device)
    names = [f"{found.alias} ({found.name})" for found in wp.get_devices()]
    return f"uses {chosen.alias}; present: {', '.join(names)}; {core_count()} CPU cores"


def _kernels(device: str) -> str:
    """Compile or load one kernel and compare one distance that is known."""
    begin = time.perf_counter()
    distance = float(_box().sdf([[1.0, 0.0, 0.0]], device=device)[0])
    if abs(distance - 0.5) > 1e-6:
        raise RuntimeError(f"a distance of 0.5 came out as {distance}")
    return f"a distance is right; {time.perf_counter() - begin:.2f} s, compiling included"


def _warm(device: str) -> str:
    from resfit.kernels.launch import choose_device
    from resfit.kernels.warm import warm_kernels

    begin = time.perf_counter()
    warm_kernels(choose_device(device))
    return f"every kernel is compiled; {time.perf_counter() - begin:.1f} s"


def _ray_tracer(device: str) -> str:
    import numpy as np

    from resfit.kernels.camera import Camera
    from resfit.kernels.raytrace import render_assembly

    assembly = _box()
    camera = Camera((2.0, 3.0, 4.0))
    image = render_assembly(assembly.on_device(device), np.array([[1.0, 0.5, 0.2]]), camera, 32, 32)
    if not float(np.std(image)) > 1.0:
        raise RuntimeError("the picture is empty")
    return "a picture was rendered without OpenGL"


def _box() -> Any:
    from resfit.assembly.assembly import Assembly
    from resfit.assembly.primitive import Pose, Primitive

    return Assembly((Primitive("cuboid", "box", Pose(), {"size": (1.0, 1.0, 1.0)}),))


def _pyvista() -> str:
    probe = probe_rendering()
    if not probe.works:
        raise RuntimeError(probe.detail)
    return probe.detail


def _child(code: str) -> str:
    """Run Python code in another process and return the last line that it prints."""
    return finish_child(start_child(code), CHILD_SECONDS)
