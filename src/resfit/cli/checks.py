"""The single checks of `resfit doctor`. None raises: what fails is the answer.

What can take the whole process down with it (VTK without a display, browsers) is tried in a child process.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from resfit.errors import ResfitError
from resfit.extras import command_for, requirements, run_command
from resfit.viewer.scene.opengl_check import PACKAGES, SECONDS, finish_child, probe_rendering, start_child

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


PURPOSES = {
    "gltf": "GLB and glTF files with Draco compression",
    "video": "films as MP4",
    "web": "resfit view --web",
    "compare": "resfit compare with CoACD and V-HACD, --decompose coacd",
    "browser": "tests of pages, in a headless Chromium",
    "test": "tests, lint and type checks",
}
"""What each extra of pyproject.toml is for."""

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
        ("packages", _packages, "in the checkout: make install"),
        ("devices", lambda: _devices(device), "use --device cpu"),
        ("kernel cache", _kernel_cache, "set WARP_CACHE_PATH to a folder that can be written"),
        (
            "kernels",
            lambda: _kernels(device),
            run_command("-m", "pip", "install", "--force-reinstall", "warp-lang"),
        ),
    ]
    if warm:
        core.append(("warm", lambda: _warm(device), ""))
    checks = [_tried(name, probe, fix, core=True) for name, probe, fix in core]
    checks.append(_tried("ray tracer", lambda: _ray_tracer(device), "try --device cpu"))
    checks.append(_tried("OpenGL", _opengl, f"for windows and films, on Linux: install {PACKAGES}"))
    checks += [_extra(name, purpose) for name, purpose in PURPOSES.items()]
    return checks


def _tried(name: str, probe: Callable[[], str], fix: str, core: bool = False) -> Check:
    try:
        return Check(name, True, probe(), fix, core)
    except ResfitError as error:
        return Check(name, False, str(error), fix, core)
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        return Check(name, False, reason[:200], fix, core)


def _extra(name: str, purpose: str) -> Check:
    """Check of the packages of an extra; of the one for pages, also that its browser starts."""
    wanted = requirements(name)
    missing = _missing(wanted)
    if missing:
        return Check(name, False, f"{purpose}: {', '.join(missing)} not installed", command_for(name))
    there = f"{purpose}: {', '.join(f'{package} {version(package)}' for package in wanted)}"
    if name != "browser":
        return Check(name, True, there)
    tried = _tried(
        name, lambda: _child(CHROMIUM_PROBE), run_command("-m", "playwright", "install", "chromium")
    )
    return replace(tried, detail=f"{there}, {tried.detail}")


def _missing(packages: Iterable[str]) -> list[str]:
    """Those that are not installed."""
    missing = []
    for package in packages:
        try:
            version(package)
        except PackageNotFoundError:
            missing.append(package)
    return missing


def _packages() -> str:
    """Versions of what fitting rests on.

    Raises:
        RuntimeError: if anything that resfit requires is missing.
    """
    missing = _missing(requirements())
    if missing:
        raise RuntimeError(f"{', '.join(missing)} not installed")
    names = ("resfit", "warp-lang", "numpy", "scipy", "trimesh")
    return ", ".join(f"{name} {version(name)}" for name in names)


def _kernel_cache() -> str:
    import warp as wp

    from resfit.kernels.runtime.launch import start

    start()
    folder = Path(wp.config.kernel_cache_dir or "")
    return f"{sum(1 for _ in folder.glob('wp_*'))} compiled modules in {folder}"


def _devices(device: str) -> str:
    import warp as wp

    from resfit.kernels.runtime.cores import core_count
    from resfit.kernels.runtime.launch import choose_device

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
    from resfit.kernels.precompile import precompile_kernels
    from resfit.kernels.runtime.launch import choose_device

    begin = time.perf_counter()
    precompile_kernels(choose_device(device))
    return f"every kernel is compiled; {time.perf_counter() - begin:.1f} s"


def _ray_tracer(device: str) -> str:
    import numpy as np

    from resfit.kernels.render.camera import Camera
    from resfit.kernels.render.raytrace import render_assembly

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


def _opengl() -> str:
    probe = probe_rendering()
    if not probe.works:
        raise RuntimeError(probe.detail)
    return probe.detail


def _child(code: str) -> str:
    """Run Python code in another process and return the last line that it prints."""
    return finish_child(start_child(code), CHILD_SECONDS)
