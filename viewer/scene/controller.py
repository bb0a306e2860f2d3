"""Controller of keys, sliders, buttons and clicks: no window here, so that a window and a page can share it.

A window shows what `sliders`, `status` and `message` say, calls the methods below, and draws again when `on_change` is
called. While something is dragged everything is coarse; `settle` makes it fine, and the edit one step of undo.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from resfit.errors import ResfitError

from ...assembly.primitive import Primitive
from ..model.commands import COMMAND_OF, Command, find_command
from ..model.documents import Document
from ..model.edit_state import PartRef
from ..model.parameters import Slider
from ..model.text_entry import Entry
from ..model.view_options import SWITCHES
from .file_actions import FileActions
from .part_actions import PartActions
from .scene import Scene
from .view_actions import ViewActions


class Controller:
    """One scene and what is done to it.

    Attributes:
        session, scene: what is edited, and what it looks like.
        message: the last thing that was done or went wrong, one sentence.
        iou: of the assembly that is edited against its mesh; None where there is none.
        entry: what is being typed, or None.
        gizmo: whether the handles of the selected part are wanted.
        help: whether the list of keys is wanted.
        closing: whether the window is to close.
        on_change: called after anything changed.
    """

    def __init__(
        self,
        scene: Scene,
        documents: Sequence[Document],
        save_path: Path | None = None,
        exports: Sequence[Path] = (),
    ) -> None:
        """Control a scene.

        Args:
            scene: of the documents' assemblies, in their order.
            documents: where they came from.
            save_path: where to save; beside the file that was opened, `_edited` added to its name, unless given.
            exports: files that the key for exporting writes; one GLB unless given.
        """
        self.scene = scene
        self.session = scene.session
        self.documents = tuple(documents)
        self.save_path = save_path
        self.message = ""
        self.iou: float | None = None
        self.entry: Entry | None = None
        self.gizmo = True
        self.help = False
        self.closing = False
        self.on_change: Callable[[], None] = lambda: None
        self._parts = PartActions(self.session, scene)
        self._view = ViewActions(scene)
        self._files = FileActions(self.session, scene, self.documents, tuple(exports))
        self._commands = self._command_table()
        self._held: Primitive | None = None
        self._measure(live=False)

    def _command_table(self) -> dict[str, Callable[[], str | None]]:
        """Dispatch table of commands but the switches, by name; each says what there is to say."""
        parts, view, files = self._parts, self._view, self._files
        return {
            "undo": parts.undo,
            "redo": parts.redo,
            "add": parts.add,
            "duplicate": parts.duplicate,
            "delete": parts.delete,
            "rename": self._rename,
            "gizmo": self._toggle_gizmo,
            "next": parts.next,
            "previous": parts.previous,
            "deselect": self._deselect,
            "hide": parts.hide,
            "isolate": parts.isolate,
            "show_all": parts.show_all,
            "frame": view.frame,
            "front": view.front,
            "side": view.side,
            "top": view.top,
            "up": view.up,
            "save": lambda: files.save(self.save_path),
            "export": lambda: files.export(self.item),
            "screenshot": lambda: files.screenshot(self.item),
            "help": self._toggle_help,
            "quit": self._quit,
        }

    # What there is to show

    @property
    def item(self) -> int:
        """The assembly that is edited: that of the selected part, else the first."""
        return self._parts.item

    @property
    def title(self) -> str:
        """Name of the assembly that is edited."""
        return self.documents[self.item].title

    @property
    def status(self) -> str:
        """Parts and IoU of the assembly that is edited."""
        count = len(self.session.state.assemblies[self.item].primitives)
        text = f"{count} part" if count == 1 else f"{count} parts"
        text += f" · IoU {self.iou:.3f}" if self.iou is not None else ""
        return text + (" · not saved" if self.session.changed else "")

    def sliders(self) -> tuple[Slider, ...]:
        """Those of the selected part, or of the view where none is."""
        if self.session.selected is not None:
            return self.session.editor.sliders(self.session.selected)
        return self.view_sliders()

    def view_sliders(self) -> tuple[Slider, ...]:
        """Sliders of the explosion and of the section plane."""
        return self._view.sliders()

    def toggles(self) -> tuple[tuple[Command, bool], ...]:
        """Switches, and whether each is on."""
        return (*self._view.toggles(), (COMMAND_OF["gizmo"], self.gizmo))

    # What is done

    def press(self, key: str) -> bool:
        """Do what a key stands for; False if it stands for nothing.

        Args:
            key: such as `d`, `H` (with Shift), `ctrl+z`, `Delete`, `Escape`; while something is typed, also letters.
        """
        if self.entry is not None:
            self._type(key)
            return True
        command = find_command(key)
        if command is None:
            return False
        self.run(command.name)
        return True

    def run(self, name: str) -> None:
        """Do what a command's name says; what goes wrong becomes the message."""
        self.message = ""
        try:
            said = self._view.switch(name) if name in SWITCHES else self._commands[name]()
            self.message = said or ""
        except ResfitError as error:
            self.message = str(error)
        self.changed()

    def changed(self, live: bool = False) -> None:
        """Bring scene and numbers up to date and tell the window."""
        try:
            self.scene.sync(live)
            self._measure(live)
        except ResfitError as error:
            self.message = str(error)
        self.on_change()

    def select(self, ref: PartRef | None) -> None:
        """Choose what is edited."""
        self.session.select(ref)
        self.entry = None
        self.changed()

    def pick(self, x: float, y: float) -> PartRef | None:
        """Select what is drawn at a pixel of the window, counted from its lower left corner."""
        found = self.scene.pick(x, y)
        self.select(found)
        return found

    def slide(self, slider_id: str, value: float, ref: PartRef | None = None) -> None:
        """Set a number while its slider is dragged: of the selected part, unless told of which."""
        self.message = ""
        try:
            if slider_id.startswith("view."):
                self._view.set_value(slider_id, value)
            else:
                self.session.editor.set_value(ref or self._parts.chosen(), slider_id, value)
        except ResfitError as error:
            self.message = str(error)
        self.changed(live=True)

    def hold(self) -> None:
        """Begin to drag the gizmo."""
        self._held = self.session.part(self._parts.chosen())

    def drag(self, matrix: np.ndarray) -> None:
        """Place the selected part by its gizmo.

        Args:
            matrix: (4, 4), takes the local frame that the part had at `hold` to the scene's.
        """
        try:
            self._parts.place(matrix, self._held)
        except ResfitError as error:
            self.message = str(error)
        self.changed(live=True)

    def settle(self) -> None:
        """End a drag: one step of undo, fine surfaces, exact numbers."""
        self._held = None
        self.session.commit()
        self.changed()

    def type_value(self, slider_id: str) -> None:
        """Begin to type the value of a slider."""
        slider = next(found for found in self.sliders() if found.id == slider_id)
        self.entry = Entry(slider_id, slider.label, f"{slider.value:.4g}")
        self.on_change()

    def add(self, family: str) -> None:
        """Add a primitive where the camera looks, and select it."""
        self.message = self._parts.add_family(family)
        self.changed()

    # Commands that change what the window shows beside the scene

    def _rename(self) -> None:
        self.entry = Entry("name", "name", self._parts.chosen().name)

    def _toggle_gizmo(self) -> None:
        self.gizmo = not self.gizmo

    def _deselect(self) -> None:
        self.help = False
        self.session.select(None)

    def _toggle_help(self) -> None:
        self.help = not self.help

    def _quit(self) -> str | None:
        self.closing = self._files.may_close()
        return None if self.closing else "not saved: s saves, the same key again closes all the same"

    # How

    def _type(self, key: str) -> None:
        entry, done = self.entry, False
        if entry is None:
            return
        if key == "Escape":
            self.entry = None
        elif key == "Return":
            self.entry, done = None, True
        else:
            self.entry = entry.typed(key)
        if done:
            self.message = ""
            try:
                if entry.id == "name":
                    self.session.rename(self._parts.chosen(), entry.text)
                else:
                    self.slide(entry.id, entry.number())
                self.settle()
            except ResfitError as error:
                self.message = str(error)
        self.changed()

    def _measure(self, live: bool) -> None:
        comparison = self.scene.comparisons[self.item]
        assembly = self.session.state.assemblies[self.item]
        self.iou = None if comparison is None else comparison.iou(assembly, live)
