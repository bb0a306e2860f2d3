"""State of a page, as plain values that go over the wire, and what may be saved where: no trame here.

Names of parts and files stay text all the way: the page's template only ever inserts them as such.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from resfit.errors import InputError, ResfitError

from ...assembly.assembly import Assembly
from ...assembly.primitive import shown
from ...kernels.primitives import FAMILIES
from ..model.commands import COMMAND_OF, Command
from ..model.edit_state import PartRef
from ..model.parameters import Slider
from ..model.view_options import COMPARING
from ..scene.controller import Controller

ELSEWHERE = ("gizmo", "rename", "export", "screenshot", "help", "quit")
"""Commands of the window that the page has no use for, or offers in another way."""

UNITS = {"length": "len", "ratio": "", "degrees": "°"}
LONG_UNITS = {"length": "normalised units", "ratio": "a ratio", "degrees": "degrees"}

MAX_FILE_NAME = 100


def is_offered(name: str) -> bool:
    """True if a page may run a command."""
    return name in COMMAND_OF and name not in ELSEWHERE


def page_state(controller: Controller, revision: int = 0, live: bool = False) -> dict[str, Any]:
    """Everything that the page shows beside the picture.

    Args:
        controller: of the scene.
        revision: another one each time. The page moves its own copies of the values: what is sent later counts, even if
            it equals what was sent before.
        live: whether a slider is being dragged: it knows its own value best, and the lists stay as they are.
    """
    state: dict[str, Any] = {"status": controller.status, "message": controller.message}
    if live:
        return state
    session, view = controller.session, controller.scene.view
    selected = session.selected
    return {
        **state,
        "title": controller.title,
        "parts": part_rows(controller),
        "editor": None if selected is None else editor(controller, selected, revision),
        "view_rows": [{**row, "revision": revision} for row in view_rows(controller)],
        "toggles": toggle_rows(controller),
        "up": controller.scene.camera.up,
        "can_undo": session.can_undo,
        "can_redo": session.can_redo,
        "changed": session.changed,
        "families": sorted(FAMILIES),
        "exploded": bool(view.explode),
    }


def part_rows(controller: Controller) -> list[dict[str, Any]]:
    """The list of parts."""
    session = controller.session
    return [
        {
            "item": ref.item,
            "name": ref.name,
            "color": session.part(ref).color,
            "hidden": ref in session.state.hidden,
            "selected": ref == session.selected,
            "owner": controller.documents[ref.item].title if len(controller.documents) > 1 else "",
        }
        for ref in session.refs()
    ]


def editor(controller: Controller, ref: PartRef, revision: int = 0) -> dict[str, Any]:
    """A part and its sliders by group, in their order."""
    part = controller.session.part(ref)
    groups: dict[str, list[dict[str, Any]]] = {}
    for slider in controller.session.editor.sliders(ref):
        groups.setdefault(slider.group, []).append(slider_row(slider))
    return {
        "item": ref.item, "name": ref.name, "family": part.family, "revision": revision,
        "groups": [{"name": name, "rows": rows} for name, rows in groups.items()],
    }  # fmt: skip


def slider_row(slider: Slider) -> dict[str, Any]:
    """One slider."""
    low, high = slider.range
    about = f"{slider.description}: {low:g} to {high:g}, {LONG_UNITS[slider.unit]}"
    return {
        "id": slider.id, "label": slider.label, "unit": UNITS[slider.unit], "about": about, "low": low, "high": high,
        "step": slider.step, "value": float(f"{slider.value:.6g}"),
    }  # fmt: skip


def view_rows(controller: Controller) -> list[dict[str, Any]]:
    """Sliders of the view: those of what is switched on."""
    view = controller.scene.view
    wanted = {"view.explode": bool(view.explode), "view.section_at": view.section is not None or view.slice}
    return [slider_row(slider) for slider in controller.view_sliders() if wanted.get(slider.id)]


def toggle_rows(controller: Controller) -> list[dict[str, Any]]:
    """Rows of the switches."""
    view, compares = controller.scene.view, any(controller.scene.comparisons)
    labels = {
        "joined": "union",
        "section": f"section {view.section or ''}".strip(),
        "mesh": f"input: {view.mesh}",
    }

    def row(command: Command, on: bool) -> dict[str, Any]:
        return {
            "name": command.name, "label": labels.get(command.name, command.name), "on": on,
            "about": f"{command.description} [{command.keys[0]}]",
        }  # fmt: skip

    return [
        row(command, on)
        for command, on in controller.toggles()
        if is_offered(command.name) and (compares or command.name not in COMPARING)
    ]


def save_folder(controller: Controller) -> Path:
    """The only folder that a page may write to: that of the assembly, or of `--output`."""
    return (controller.save_path or controller.documents[0].path).absolute().parent


def save_name(controller: Controller) -> str:
    """Default name of the saved file on a page."""
    if controller.save_path is not None:
        return controller.save_path.name
    return f"{controller.documents[0].path.stem.removesuffix('_edited')}_edited.json"


def save_path(folder: Path, name: str) -> Path:
    """Path of a saved file of that name.

    Args:
        folder: the only one that is written to.
        name: what was typed.

    Raises:
        InputError: if it is no plain name of a JSON file, or something else than an assembly has it.
    """
    name = name.strip()
    if not name.lower().endswith(".json"):
        name += ".json"
    bad = not name.isprintable() or any(letter in name for letter in '/\\:*?"<>|') or name.startswith(".")
    if bad or len(name) > MAX_FILE_NAME:
        raise InputError(
            f"{shown(name)} is no name for a file; give one without folders, such as edited.json."
        )
    path = folder / name
    if path.is_symlink():
        raise InputError(f"{shown(name)} is a link to somewhere else; give another name.")
    if path.exists():
        try:
            Assembly.load(path)
        except (ResfitError, OSError):
            raise InputError(f"{shown(name)} is there and is no assembly; give another name.") from None
    return path
