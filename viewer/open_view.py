"""Entry point of `resfit view`: open assemblies, and show them in a window, on a page or in one picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .model.documents import open_documents
from .scene.opengl_check import DisplayError, finish_probe, has_display, prepare, require, start_probe
from .scene.request import Request, check_compared, first_view, open_session, read_camera
from .scene.screenshot import check_picture, render_picture, write_picture

if TYPE_CHECKING:
    from .scene.controller import Controller


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
    from .desktop.desktop import Desktop

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
    from .desktop.desktop import SIZE
    from .scene.controller import Controller
    from .scene.plotter import make_plotter
    from .scene.scene import Scene

    plotter = make_plotter(request.size or SIZE, off_screen, title=f"resfit · {documents[0].title}")
    scene = Scene(plotter, session, comparisons, view, camera, request.device)
    return Controller(scene, documents, request.save_path, request.exports)
