"""Command-line request to the viewer: files, view and camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

from resfit.errors import InputError

from ..model.comparison import Comparison
from ..model.documents import Document, open_documents
from ..model.edit_session import EditSession
from ..model.view_options import COMPARING, TOGGLES, View
from .camera import OrbitCamera

LESS = {"parts": "joined", "plain": "edges"}
"""Words for what is shown unless told otherwise: each part alone, no lines along edges."""


@dataclass(frozen=True)
class Request:
    """Request to the viewer: files, and how to show them at first."""

    paths: Sequence[Path]
    target: Path | None = None
    save_path: Path | None = None
    exports: Sequence[Path] = ()
    show: Sequence[str] = ()
    """Some of `_show_names`."""
    explode: float = 0.0
    up: Literal["y", "z"] = "y"
    azimuth: float = OrbitCamera.azimuth
    elevation: float = OrbitCamera.elevation
    size: tuple[int, int] | None = None
    """Width and height, pixels."""
    device: str = "auto"


def _show_names() -> list[str]:
    """Names that may be asked to be shown: switches, modes of the input mesh, axes of sections."""
    switches = [name for name in TOGGLES if name not in ("joined", "edges", "mesh", "section", "explode")]
    return [*switches, *LESS, "ghost", "outline", "beside", "x", "y", "z"]


def first_view(request: Request, camera: OrbitCamera) -> View:
    """Initial view of a request.

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
        elif name in _show_names():
            changes[name] = True
        else:
            raise InputError(
                f"--show {name}: there is no such thing; choose from {', '.join(_show_names())}."
            )
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


def read_camera(request: Request) -> OrbitCamera:
    """Camera of a request.

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
