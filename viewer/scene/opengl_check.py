"""Can this machine draw? Asked in a child process, because VTK without OpenGL or X crashes and does not raise."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass

from resfit.children import python_command
from resfit.errors import ResfitError

SECONDS = 60.0
"""Starting VTK on software OpenGL, or a browser, takes up to 20 s on a slow machine."""

PACKAGES = "libx11-6 libegl1 libgl1"
"""Debian's and Ubuntu's names of what VTK needs and minimal systems lack."""

FIX = f"on Linux install {PACKAGES} (as Debian calls them), or open the page that resfit export A.json A.html writes"

OFF_SCREEN_VARIABLE, OFF_SCREEN_CLASS = "VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow"
"""Without an X server VTK's default window falls back to EGL with warnings, and without libX11 it crashes."""

CODE = """
import pyvista
plotter = pyvista.Plotter(off_screen={off_screen}, window_size=(64, 64))
plotter.add_mesh(pyvista.Sphere())
plotter.show(interactive=False, auto_close=False)
image = plotter.screenshot(return_img=True)
assert image.std() > 1.0, "the picture is empty"
print("VTK", ".".join(map(str, pyvista.vtk_version_info)))
"""


class DisplayError(ResfitError):
    """This machine cannot show or draw pictures: the message says what to install."""

    exit_code = 2


@dataclass(frozen=True)
class Probe:
    """Result of a one-frame render."""

    works: bool
    detail: str
    """VTK's version, or what went wrong."""


def has_display() -> bool:
    """True if a window could be opened here at all."""
    if not sys.platform.startswith("linux"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def render_environment(off_screen: bool) -> dict[str, str]:
    """Variables to set before VTK is loaded; those that the user has set stay."""
    headless = off_screen and sys.platform.startswith("linux") and not has_display()
    return (
        {OFF_SCREEN_VARIABLE: OFF_SCREEN_CLASS} if headless and OFF_SCREEN_VARIABLE not in os.environ else {}
    )


def start_child(code: str, environment: Mapping[str, str] | None = None) -> subprocess.Popen[str]:
    """Begin to run Python code in another process; `finish_child` has what it prints.

    Args:
        code: what to run.
        environment: variables to set beside those that are set here.
    """
    return subprocess.Popen(
        python_command("-c", code),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        env={**os.environ, **(environment or {})},
    )


def finish_child(process: subprocess.Popen[str], seconds: float = SECONDS) -> str:
    """The last line that a child printed.

    Raises:
        RuntimeError: if it failed, crashed or took too long: the reason, in a few words.
    """
    try:
        output, complaints = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise RuntimeError(f"no answer within {seconds:g} s") from None
    if process.returncode < 0:
        raise RuntimeError(f"the process crashed (signal {-process.returncode})")
    if process.returncode:
        # The line of the exception; some packages put boxes of advice behind it.
        lines = [line for line in complaints.splitlines() if "Error: " in line] or ["it failed"]
        raise RuntimeError(lines[-1].partition("Error: ")[2] or lines[-1])
    return (output.splitlines() or ["works"])[-1]


def start_probe(off_screen: bool = True) -> subprocess.Popen[str]:
    """Begin to render one frame in another process; `finish_probe` has the answer."""
    return start_child(CODE.format(off_screen=off_screen), render_environment(off_screen))


def finish_probe(process: subprocess.Popen[str], seconds: float = SECONDS) -> Probe:
    """Wait for the answer of `start_probe`; never raises."""
    try:
        return Probe(True, finish_child(process, seconds))
    except RuntimeError as error:
        return Probe(False, str(error))


def probe_rendering(off_screen: bool = True) -> Probe:
    """Render one frame in another process: a second or a few."""
    return finish_probe(start_probe(off_screen))


def require(probe: Probe) -> None:
    """Refuse to go on where nothing can be drawn.

    Raises:
        DisplayError: one sentence with what to install.
    """
    if not probe.works:
        raise DisplayError(f"VTK cannot draw on this machine ({probe.detail}): {FIX}.")


def prepare(off_screen: bool) -> None:
    """Set what VTK reads from the environment; call before pyvista is imported for the first time."""
    os.environ.update(render_environment(off_screen))
