"""What `resfit view` does: open assemblies, and show them in a window, on a page or in one picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from resfit.errors import InputError

from .camera import OrbitCamera
from .comparison import Comparison
from .documents import Document, open_documents
from .edits import EditSession
from .probe import DisplayError, finish_probe, has_display, prepare, require, start_probe
from .screenshot import check_picture, render_picture, write_picture
from .view import COMPARING, TOGGLES, View

if TYPE_CHECKING:
    from .controller import Controller

LESS = {"parts": "joined", "plain": "edges"}
"""Words for what is shown unless told otherwise: each part alone, no lines along edges."""


@dataclass(frozen=True)
class Request:
    """What to show, and how at first."""

    paths: Sequence[Path]
    target: Path | None = None
    save_path: Path | None = None
    exports: Sequence[Path] = ()
    show: Sequence[str] = ()
    """Some of `show_names`."""
    explode: float = 0.0
    up: Literal["y", "z"] = "y"
    azimuth: float = OrbitCamera.azimuth
    elevation: float = OrbitCamera.elevation
    size: tuple[int, int] | None = None
    """Width and height, pixels."""
    device: str = "auto"


def show_names() -> list[str]:
    """What may be asked to be shown: switches, modes of the input mesh, axes of sections."""
    switches = [name for name in TOGGLES if name not in ("joined", "edges", "mesh", "section", "explode")]
    return [*switches, *LESS, "ghost", "outline", "beside", "x", "y", "z"]


def first_view(request: Request, camera: OrbitCamera) -> View:
    """How a request wants things shown.

    Raises:
        InputError: if it asks for something that there is not.
    """
    changes: dict[str, Any] = {"explode": request.explode, "across": camera.across()}
    for name in request.show:
        if name in LESS:
            changes[LESS[name]] = False
        elif name in ("ghost", "outline", "beside"):
            changes["mesh"] = name
        elif name in ("x", "y", "z"):
            changes["section"] = name
        elif name in show_names():
            changes[name] = True
        else:
            raise InputError(f"--show {name}: there is no such thing; choose from {', '.join(show_names())}.")
    if not 0.0 <= request.explode <= 4.0:
        raise InputError(f"--explode {request.explode:g} is out of range; it must lie in [0, 4].")
    return replace(View(), **changes)


def open_session(
    request: Request,
) -> tuple[list[Document], EditSession, list[Comparison | None]]:
    """Read everything that a request names; the same mesh is read once.

    Raises:
        InputError: if something cannot be read.
    """
    documents = open_documents(list(request.paths), request.target)
    loaded = {
        document.mesh: Comparison(document.mesh, request.device)
        for document in documents
        if document.mesh is not None
    }
    comparisons = [None if document.mesh is None else loaded[document.mesh] for document in documents]
    return documents, EditSession([document.assembly for document in documents]), comparisons


def save_screenshot(request: Request, path: Path) -> None:
    """Write one picture of what is asked for; needs no screen.

    Raises:
        InputError: if something cannot be read or written.
        DisplayError: if nothing can be drawn here.
    """
    size = request.size or (1280, 800)
    check_picture(path, size)
    camera = read_camera(request)
    view = first_view(request, camera)
    probe = start_probe(off_screen=True)
    try:
        _, session, comparisons = open_session(request)
        check_compared(view, comparisons)
    finally:
        # While files are read; a child that is still at it must not outlive us.
        answer = finish_probe(probe)
    require(answer)
    write_picture(render_picture(session, comparisons, view, camera, size, request.device), path)


def open_window(request: Request) -> None:
    """Show what is asked for until the window is closed.

    Raises:
        InputError: if something cannot be read.
        DisplayError: if there is no screen, or nothing can be drawn on it.
    """
    first_view(request, read_camera(request))
    open_documents(list(request.paths), request.target)
    if not has_display():
        raise DisplayError(
            "there is no screen to open a window on; write a picture with --screenshot FILE, or use --web."
        )
    controller = _open(request, off_screen=False)
    from .desktop import Desktop

    Desktop(controller).run()


def open_page(request: Request, host: str, port: int) -> None:
    """Serve a page with what is asked for until it is interrupted.

    Args:
        request: what to show.
        host: name or address of this machine to listen at.
        port: 0 takes a free one.

    Raises:
        InputError: if something cannot be read, the extra `web` is missing, or nothing can listen there.
        DisplayError: if nothing can be drawn here.
    """
    from .web.extra import require_web

    require_web()
    controller = _open(request, off_screen=True)
    from .web.serve import serve

    try:
        serve(controller, host, port)
    finally:
        controller.scene.plotter.close()


def _open(request: Request, off_screen: bool) -> Controller:
    """Everything of a request behind one controller; what cannot be read is said before anything is drawn."""
    camera = read_camera(request)
    view = first_view(request, camera)
    probe = start_probe(off_screen)
    try:
        documents, session, comparisons = open_session(request)
        check_compared(view, comparisons)
    finally:
        answer = finish_probe(probe)
    require(answer)
    prepare(off_screen)
    from .controller import Controller
    from .desktop import SIZE
    from .scene import Scene
    from .stage import make_plotter

    plotter = make_plotter(request.size or SIZE, off_screen, title=f"resfit · {documents[0].title}")
    scene = Scene(plotter, session, comparisons, view, camera, request.device)
    return Controller(scene, documents, request.save_path, request.exports)


def read_camera(request: Request) -> OrbitCamera:
    """Where a request looks from.

    Raises:
        InputError: if it cannot look from there.
    """
    if not abs(request.elevation) < 90.0:
        raise InputError(f"--elevation {request.elevation:g} is out of range; it must be within -90 to 90.")
    return OrbitCamera(request.up, request.azimuth, request.elevation)


def check_compared(view: View, comparisons: Sequence[Comparison | None]) -> None:
    """Refuse a view that needs an input mesh where there is none.

    Raises:
        InputError: if so.
    """
    if any(comparisons):
        return
    defaults = {field.name: field.default for field in fields(View)}
    for name in COMPARING:
        if getattr(view, name) != defaults[name]:
            raise InputError(f"{name} needs the input mesh, and none was found; give it with --target MESH.")
