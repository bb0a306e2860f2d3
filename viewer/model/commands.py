"""The keys of the viewer, in the order in which `?` lists them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Command:
    """Something that a key or a button does."""

    name: str
    """`Controller.run` does it by this name."""
    keys: tuple[str, ...]
    """A capital is Shift and the letter; the first one is shown."""
    group: str
    description: str


COMMANDS: tuple[Command, ...] = (
    Command("undo", ("ctrl+z", "u"), "Edit", "undo"),
    Command("redo", ("ctrl+y", "ctrl+Z", "r"), "Edit", "redo"),
    Command("add", ("a",), "Edit", "add a primitive like the selected"),
    Command("duplicate", ("d",), "Edit", "duplicate the selected part"),
    Command("delete", ("Delete", "BackSpace"), "Edit", "delete the selected part"),
    Command("rename", ("F2",), "Edit", "rename the selected part"),
    Command("gizmo", ("g",), "Edit", "handles to move, turn and scale"),
    Command("next", ("n", "Tab"), "Select", "next part"),
    Command("previous", ("p",), "Select", "previous part"),
    Command("deselect", ("Escape",), "Select", "select nothing"),
    Command("hide", ("h",), "Select", "hide or show the selected part"),
    Command("isolate", ("i",), "Select", "show the selected part only, or all"),
    Command("show_all", ("H",), "Select", "show all parts"),
    Command("joined", ("j",), "Show", "smooth joins between parts"),
    Command("edges", ("l",), "Show", "lines along sharp edges"),
    Command("wireframe", ("w",), "Show", "wireframe"),
    Command("labels", ("t",), "Show", "names of the parts"),
    Command("explode", ("e",), "Show", "move the parts apart"),
    Command("section", ("x",), "Show", "cut across x, y, z, or not"),
    Command("section_back", ("[",), "Show", "move the cut back"),
    Command("section_on", ("]",), "Show", "move the cut on"),
    Command("slice", ("k",), "Show", "signed distances on a plane"),
    Command("mesh", ("m",), "Compare", "input mesh: ghost, outline, beside, off"),
    Command("error", ("c",), "Compare", "distances of the input as colours"),
    Command("residual", ("v",), "Compare", "volume that is missing or too much"),
    Command("samples", ("o",), "Compare", "sample points, by distance"),
    Command("frame", ("f",), "Camera", "see everything"),
    Command("front", ("1",), "Camera", "from the front"),
    Command("side", ("2",), "Camera", "from the side"),
    Command("top", ("3",), "Camera", "from above"),
    Command("up", ("y",), "Camera", "y or z points up"),
    Command("save", ("s", "ctrl+s"), "File", "save the edited assembly.json"),
    Command("export", ("E",), "File", "export, to a GLB unless told otherwise"),
    Command("screenshot", ("S",), "File", "write a picture"),
    Command("help", ("?", "F1"), "File", "this list"),
    Command("quit", ("q", "ctrl+q"), "File", "close"),
)

COMMAND_OF = {command.name: command for command in COMMANDS}
_BY_KEY = {key: command for command in COMMANDS for key in command.keys}


def find_command(key: str) -> Command | None:
    """The command of a key, or None."""
    return _BY_KEY.get(key)
