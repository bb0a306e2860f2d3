"""Layout of the desktop window's panel beside the scene, as plain shapes and texts: nothing here draws.

Colours and order are those of the page. Places are in pixels from the window's upper left corner; all text is shown
as it is, never interpreted.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

from ...kernels.primitives import FAMILIES
from ..model.commands import COMMAND_OF, COMMANDS
from ..model.edit_state import PartRef
from ..model.parameters import Slider
from ..scene.controller import Controller

Color = tuple[int, int, int, int]

WIDTH = 330
PAD = 16
PAPER, LINE, INK, MUTED = "#f7f8f9", "#d3d7dc", "#23272e", "#6a717b"
ACCENT, CHOSEN, BUTTON, ON, TRACK = "#3b6ea8", "#ffe9c9", "#e6e9ed", "#ffd9a3", "#d4d8dd"

LIST_ROW, SLIDER_ROW, HEADING, CHIP = 22, 24, 24, 26
LOWEST_ROW = 17
"""Rows of sliders get no lower than this in low windows."""

LABEL, VALUE = 86, 62
"""Widths of a slider's label and value."""

FILE_BUTTONS = ("undo", "redo", "save", "export", "help")


@dataclass(frozen=True)
class Shape:
    """A filled polygon."""

    points: tuple[tuple[float, float], ...]
    color: Color


@dataclass(frozen=True)
class Text:
    """A line of text; `y` is its middle."""

    x: float
    y: float
    text: str
    size: int = 13
    color: str = INK
    align: Literal["left", "center", "right"] = "left"
    bold: bool = False


@dataclass(frozen=True)
class Spot:
    """A place that does something."""

    x: float
    y: float
    width: float
    height: float
    kind: Literal["slider", "value", "part", "hide", "only", "command", "family", "list", "panel"]
    id: Any = None


@dataclass
class Drawing:
    """Everything, in the order in which it is painted."""

    shapes: list[Shape] = field(default_factory=list)
    texts: list[Text] = field(default_factory=list)
    spots: list[Spot] = field(default_factory=list)

    def at(self, x: float, y: float) -> Spot | None:
        """The last spot that was laid over a place."""
        for spot in reversed(self.spots):
            if spot.x <= x < spot.x + spot.width and spot.y <= y < spot.y + spot.height:
                return spot
        return None

    def box(self, x: float, y: float, width: float, height: float, color: str, radius: float = 0.0) -> None:
        """A rectangle with round corners."""
        corners = ((x + width - radius, y + radius, -90), (x + width - radius, y + height - radius, 0),
                   (x + radius, y + height - radius, 90), (x + radius, y + radius, 180))  # fmt: skip
        steps = (0.0,) if radius <= 0.0 else (0.0, 22.5, 45.0, 67.5, 90.0)
        points = [
            (
                cx + radius * math.cos(math.radians(turn + step)),
                cy + radius * math.sin(math.radians(turn + step)),
            )
            for cx, cy, turn in corners
            for step in steps
        ]
        self.shapes.append(Shape(tuple(points), _color(color)))

    def disc(self, x: float, y: float, radius: float, color: str) -> None:
        """A filled circle."""
        self.box(x - radius, y - radius, 2 * radius, 2 * radius, color, radius)


def lay_out(controller: Controller, width: int, height: int, scroll: int = 0) -> Drawing:
    """Panel, message and help of a window.

    Args:
        controller: what to show.
        width, height: of the window, pixels.
        scroll: rows of the list of parts that are above it.
    """
    drawing, left = Drawing(), max(0, width - WIDTH)
    drawing.box(left, 0, WIDTH, height, PAPER)
    drawing.box(left, 0, 1, height, LINE)
    drawing.spots.append(Spot(left, 0, WIDTH, height, "panel"))
    drawing.texts.append(Text(left + PAD, 22, shorten(controller.title, WIDTH - 2 * PAD, 16), 16, bold=True))
    drawing.texts.append(Text(left + PAD, 43, shorten(controller.status, WIDTH - 2 * PAD, 13), 13, MUTED))
    drawing.box(left, 58, WIDTH, 1, LINE)
    # From the bottom up: buttons, switches, sliders; what is left is for the list.
    bottom = _buttons(drawing, controller, left, height - 10)
    rows = controller.sliders()
    headings = len(dict.fromkeys(slider.group for slider in rows)) + 1
    room = bottom - 62 - 3 * LIST_ROW - headings * HEADING - 20
    families = controller.session.selected is None
    row = max(LOWEST_ROW, min(SLIDER_ROW, room / max(1, len(rows))))
    top = bottom - len(rows) * row - headings * HEADING - 14 - (HEADING + 2 * CHIP if families else 0)
    count = len(controller.session.refs())
    list_height = max(3 * LIST_ROW, min(top - 66, count * LIST_ROW + 6))
    _parts(drawing, controller, left, 64, list_height, scroll)
    below = 64 + list_height + 4
    drawing.box(left, below, WIDTH, 1, LINE)
    below = _sliders(drawing, controller, rows, left, below + 6, row)
    if families:
        _families(drawing, left, below)
    _message(drawing, controller, left, height)
    if controller.help:
        _help(drawing, left, height)
    return drawing


def list_rows(drawing: Drawing) -> int:
    """Number of parts that the list of a drawing shows at once."""
    return sum(spot.kind == "part" for spot in drawing.spots)


def slider_value(spot: Spot, slider: Slider, x: float) -> float:
    """The value under a pixel of a slider's spot, in steps of the slider."""
    low, high = slider.range
    share = min(1.0, max(0.0, (x - spot.x - 7) / max(spot.width - 14, 1.0)))
    return min(high, max(low, low + round(share * (high - low) / slider.step) * slider.step))


def shorten(text: str, width: float, size: int) -> str:
    """`text` cut so that it takes about `width` pixels at most."""
    letters = max(1, int(width / (0.56 * size)))
    return text if len(text) <= letters else text[: letters - 1] + "…"


def _parts(
    drawing: Drawing, controller: Controller, left: float, top: float, height: float, scroll: int
) -> None:
    session = controller.session
    refs, many = session.refs(), len(session.state.assemblies) > 1
    rows = int(height // LIST_ROW)
    scroll = max(0, min(scroll, len(refs) - rows))
    drawing.spots.append(Spot(left, top, WIDTH, height, "list"))
    for k, ref in enumerate(refs[scroll : scroll + rows]):
        y = top + k * LIST_ROW
        if ref == session.selected:
            drawing.box(left + 8, y, WIDTH - 16, LIST_ROW, CHOSEN, 5)
        hidden = ref in session.state.hidden
        drawing.disc(left + 22, y + LIST_ROW / 2, 6, session.part(ref).color)
        name = f"{ref.item + 1} · {ref.name}" if many else ref.name
        text = shorten(name, WIDTH - 150, 13)
        drawing.texts.append(Text(left + 36, y + LIST_ROW / 2, text, 13, "#a9afb7" if hidden else INK))
        drawing.spots.append(Spot(left + 8, y, WIDTH - 100, LIST_ROW, "part", ref))
        for kind, label, x in (("hide", "show" if hidden else "hide", 64), ("only", "only", 26)):
            drawing.texts.append(Text(left + WIDTH - x, y + LIST_ROW / 2, label, 11, MUTED, "center"))
            drawing.spots.append(Spot(left + WIDTH - x - 18, y, 36, LIST_ROW, kind, ref))  # type: ignore[arg-type]
    if len(refs) > rows:
        size = max(18.0, height * rows / len(refs))
        at = top + (height - size) * scroll / max(1, len(refs) - rows)
        drawing.box(left + WIDTH - 6, at, 4, size, "#c9cdd3", 2)


def _sliders(
    drawing: Drawing, controller: Controller, rows: Iterable[Slider], left: float, top: float, height: float
) -> float:
    """Sliders with their headings; returns where they end."""
    selected: PartRef | None = controller.session.selected
    title, side = ("View", "")
    if selected is not None:
        title, side = selected.name, controller.session.part(selected).family
    scale = controller.session.state.assemblies[controller.item].transform.scale
    drawing.texts.append(Text(left + PAD, top + 12, shorten(title, WIDTH - 150, 14), 14, bold=True))
    drawing.texts.append(Text(left + WIDTH - PAD, top + 12, side, 12, MUTED, "right"))
    y, group = top + HEADING, "View"
    for slider in rows:
        if slider.group != group:
            group = slider.group
            drawing.texts.append(Text(left + PAD, y + 14, group.upper(), 10, MUTED, bold=True))
            units = {"degrees": "degrees"}.get(slider.unit, f"length × {scale:.4g} mesh units")
            drawing.texts.append(Text(left + WIDTH - PAD, y + 14, units, 10, MUTED, "right"))
            y += HEADING
        _slider(drawing, controller, slider, left, y, height)
        y += height
    return y + 8


def _slider(
    drawing: Drawing, controller: Controller, slider: Slider, left: float, top: float, height: float
) -> None:
    middle, begin, width = top + height / 2, left + PAD + LABEL, WIDTH - 2 * PAD - LABEL - VALUE - 10
    low, high = slider.range
    share = (slider.value - low) / max(high - low, 1e-12)
    knob = begin + 7 + min(1.0, max(0.0, share)) * (width - 14)
    drawing.texts.append(Text(left + PAD, middle, slider.label, 12))
    drawing.box(begin + 7, middle - 2, width - 14, 4, TRACK, 2)
    drawing.box(begin + 7, middle - 2, max(knob - begin - 7, 0.0), 4, ACCENT, 2)
    drawing.disc(knob, middle, 6.5, ACCENT)
    drawing.spots.append(Spot(begin, top, width, height, "slider", slider.id))
    x = left + WIDTH - PAD - VALUE
    entry = controller.entry
    typing = entry is not None and entry.id == slider.id
    drawing.box(x, top + 2, VALUE, height - 4, ACCENT if typing else LINE, 4)
    drawing.box(x + 1, top + 3, VALUE - 2, height - 6, "#ffffff", 3)
    shown = (
        f"{entry.text}|" if typing and entry else f"{slider.value:.{1 if slider.unit == 'degrees' else 3}f}"
    )
    drawing.texts.append(Text(x + VALUE - 7, middle, shown, 12, align="right"))
    drawing.spots.append(Spot(x, top, VALUE, height, "value", slider.id))


def _families(drawing: Drawing, left: float, top: float) -> None:
    drawing.texts.append(Text(left + PAD, top + 12, "ADD", 10, MUTED, bold=True))
    width = (WIDTH - 2 * PAD - 6) / 2
    for k, name in enumerate(FAMILIES):
        x, y = left + PAD + (k % 2) * (width + 6), top + HEADING + (k // 2) * CHIP
        _chip(drawing, x, y, width, name, BUTTON, Spot(x, y, width, CHIP - 4, "family", name))


def _buttons(drawing: Drawing, controller: Controller, left: float, bottom: float) -> float:
    """File buttons and switches from the bottom up; returns where they begin."""
    width = (WIDTH - 2 * PAD - 6 * (len(FILE_BUTTONS) - 1)) / len(FILE_BUTTONS)
    top = bottom - CHIP
    for k, name in enumerate(FILE_BUTTONS):
        x = left + PAD + k * (width + 6)
        able = {"undo": controller.session.can_undo, "redo": controller.session.can_redo}.get(name, True)
        spot = Spot(x, top, width, CHIP - 2, "command", name)
        _chip(
            drawing,
            x,
            top,
            width,
            "? keys" if name == "help" else name,
            BUTTON,
            spot,
            INK if able else "#a9afb7",
        )
    drawing.box(left, top - 8, WIDTH, 1, LINE)
    toggles = controller.toggles()
    width = (WIDTH - 2 * PAD - 6 * 3) / 4
    top -= 12 + -(-len(toggles) // 4) * CHIP
    for k, (command, on) in enumerate(toggles):
        x, y = left + PAD + (k % 4) * (width + 6), top + (k // 4) * CHIP
        spot = Spot(x, y, width, CHIP - 4, "command", command.name)
        _chip(drawing, x, y, width, command.name, ON if on else BUTTON, spot)
    drawing.box(left, top - 8, WIDTH, 1, LINE)
    return top - 12


def _chip(
    drawing: Drawing, x: float, y: float, width: float, label: str, color: str, spot: Spot, ink: str = INK
) -> None:
    drawing.box(x, y, width, CHIP - 4, color, 6)
    drawing.texts.append(
        Text(x + width / 2, y + (CHIP - 4) / 2, shorten(label, width, 12), 12, ink, "center")
    )
    drawing.spots.append(spot)


def _message(drawing: Drawing, controller: Controller, left: float, height: float) -> None:
    entry = controller.entry
    text = f"new name: {entry.text}|" if entry is not None and entry.id == "name" else controller.message
    if not text:
        return
    text = shorten(text, left - 60, 13)
    width = min(left - 24, 0.56 * 13 * len(text) + 28)
    drawing.box(12, height - 42, width, 30, "#ffffff", 7)
    drawing.texts.append(Text(24, height - 27, text, 13))


def _help(drawing: Drawing, left: float, height: float) -> None:
    """All keys, group by group, in two columns over the scene."""
    groups: dict[str, list[str]] = {}
    for command in COMMANDS:
        groups.setdefault(command.group, []).append(command.name)
    columns = (("Edit", "Select", "Camera"), ("Show", "Compare", "File"))
    row, lines = 19, max(sum(len(groups[name]) + 2 for name in column) for column in columns)
    width, tall = min(left - 24, 720), lines * row + 46
    x0, y0 = (left - width) / 2, max(8, (height - tall) / 2)
    drawing.box(x0 - 1, y0 - 1, width + 2, tall + 2, LINE, 10)
    drawing.box(x0, y0, width, tall, "#ffffff", 10)
    for k, column in enumerate(columns):
        x, y = x0 + 22 + k * width / 2, y0 + 24
        for group in column:
            drawing.texts.append(Text(x, y, group.upper(), 10, MUTED, bold=True))
            for name in groups[group]:
                y += row
                command = COMMAND_OF[name]
                drawing.texts.append(Text(x, y, _key_text(command.keys[0]), 12, ACCENT, bold=True))
                text = shorten(command.description, width / 2 - 96, 12)
                drawing.texts.append(Text(x + 64, y, text, 12))
            y += 2 * row
    note = "Drag: orbit. Right drag or Shift: pan. Wheel: zoom. Click: pick. Click a value: type it."
    drawing.texts.append(Text(x0 + 22, y0 + tall - 18, note, 12, MUTED))


def _key_text(key: str) -> str:
    if len(key) == 1 and key.isalpha() and key.isupper():
        return f"Shift {key}"
    return key.replace("ctrl+", "Ctrl ").replace("Delete", "Del").replace("Escape", "Esc")


def _color(text: str) -> Color:
    return int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16), 255
