"""What keys, sliders, buttons and clicks do: no window here, so that a desktop window and a page can share it.

A window shows what `sliders`, `status` and `message` say, calls the methods below, and draws again when `on_change` is
called. While something is dragged everything is coarse; `settle` makes it fine, and the edit one step of undo.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from resfit.errors import InputError, ResfitError

from ...assembly.primitive import Primitive, shown
from ...exports.by_suffix import check_path, export_assembly
from ...kernels.primitives import DEFAULT_FAMILY
from ..model.commands import COMMAND_OF, COMMANDS, Command, find_command
from ..model.documents import Document
from ..model.edit_session import PartRef, State
from ..model.parameters import Slider
from ..model.poses import to_vector
from ..model.text_entry import Entry
from ..model.view_options import COMPARING, SWITCHES, TOGGLES, is_on, switched
from .scene import Scene


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
        self.exports = tuple(exports)
        self.message = ""
        self.iou: float | None = None
        self.entry: Entry | None = None
        self.gizmo = True
        self.help = False
        self.closing = False
        self.on_change: Callable[[], None] = lambda: None
        self._held: Primitive | None = None
        self._warned: State | None = None
        self._measure(live=False)

    # What there is to show

    @property
    def item(self) -> int:
        """The assembly that is edited: that of the selected part, else the first."""
        return self.session.selected.item if self.session.selected else 0

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
            return self.session.sliders(self.session.selected)
        return self.view_sliders()

    def view_sliders(self) -> tuple[Slider, ...]:
        """How far parts are apart, and where the section lies."""
        view = self.scene.view
        return (
            Slider("view.explode", "View", "explode", "ratio", "how far parts are moved apart", (0.0, 1.0),
                   (0.0, 4.0), 0.01, view.explode),
            Slider("view.section_at", "View", "section", "ratio", "where the plane of sections and slices lies",
                   (0.0, 1.0), (0.0, 1.0), 0.005, view.section_at),
        )  # fmt: skip

    def toggles(self) -> tuple[tuple[Command, bool], ...]:
        """What can be switched, and whether it is on."""
        view = self.scene.view
        found = [(command, is_on(view, command.name)) for command in COMMANDS if command.name in TOGGLES]
        return (*found, (COMMAND_OF["gizmo"], self.gizmo))

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
            if name in SWITCHES:
                self._switch(name)
            else:
                getattr(self, f"do_{name}")()
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
                self.scene.view = replace(self.scene.view, **{slider_id.removeprefix("view."): value})
            else:
                self.session.set_value(ref or self._chosen(), slider_id, value)
        except ResfitError as error:
            self.message = str(error)
        self.changed(live=True)

    def hold(self) -> None:
        """Begin to drag the gizmo."""
        self._held = self.session.part(self._chosen())

    def drag(self, matrix: np.ndarray) -> None:
        """Place the selected part by its gizmo.

        Args:
            matrix: (4, 4), takes the local frame that the part had at `hold` to the scene's.
        """
        ref = self._chosen()
        placed = self.scene.arrangement.placed[ref.item].matrix
        try:
            self.session.place(ref, np.linalg.solve(placed, matrix), self._held)
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
        matrix = self.scene.arrangement.placed[self.item].matrix
        place = (self.scene.camera.target - matrix[:3, 3]) / matrix[0, 0]
        self.session.add(self.item, family, to_vector(np.clip(place, -1.0, 1.0)))
        self.message = f"added a {family}"
        self.changed()

    # Commands

    def do_undo(self) -> None:
        self.message = "undone" if self.session.undo() else "nothing to undo"

    def do_redo(self) -> None:
        self.message = "redone" if self.session.redo() else "nothing to redo"

    def do_duplicate(self) -> None:
        self.message = f"{shown(self.session.duplicate(self._chosen()).name)} is the copy"

    def do_delete(self) -> None:
        self.session.delete(self._chosen())

    def do_add(self) -> None:
        selected = self.session.selected
        self.add(self.session.part(selected).family if selected else DEFAULT_FAMILY)

    def do_rename(self) -> None:
        ref = self._chosen()
        self.entry = Entry("name", "name", ref.name)

    def do_hide(self) -> None:
        self.session.hide(self._chosen())

    def do_isolate(self) -> None:
        self.session.isolate(self._chosen())

    def do_show_all(self) -> None:
        self.session.show_all()

    def do_next(self) -> None:
        self._go(1)

    def do_previous(self) -> None:
        self._go(-1)

    def do_deselect(self) -> None:
        self.help = False
        self.session.select(None)

    def do_gizmo(self) -> None:
        self.gizmo = not self.gizmo

    def do_frame(self) -> None:
        self.scene.frame()

    def do_front(self) -> None:
        self._look_from(0.0, 0.0)

    def do_side(self) -> None:
        self._look_from(90.0, 0.0)

    def do_top(self) -> None:
        self._look_from(0.0, 88.0)

    def do_up(self) -> None:
        self.scene.camera.up = "z" if self.scene.camera.up == "y" else "y"
        self.scene.frame()

    def do_save(self) -> None:
        self.session.commit()
        written = []
        for item, assembly in enumerate(self.session.state.assemblies):
            path = self._edited(item, ".json") if self.save_path is None or item else self.save_path
            assembly.save(path)
            written.append(str(path))
        self.session.mark_saved()
        self.message = f"saved {', '.join(written)}"

    def do_export(self) -> None:
        paths = self.exports or (Path(f"{self.title}_edited.glb"),)
        for path in paths:
            check_path(path)
        for path in paths:
            export_assembly(self.session.state.assemblies[self.item], path)
        self.message = f"exported {', '.join(map(str, paths))}"

    def do_screenshot(self) -> None:
        from .screenshot import render_picture, write_picture

        scene = self.scene
        width, height = scene.plotter.renderer.GetSize()
        image = render_picture(
            self.session, scene.comparisons, scene.view, scene.camera, (2 * width, 2 * height), framed=False
        )
        path = next(
            path for k in range(1, 10_000) if not (path := Path(f"{self.title}_{k:02d}.png")).exists()
        )
        write_picture(image, path)
        self.message = f"wrote {path}"

    def do_help(self) -> None:
        self.help = not self.help

    def do_quit(self) -> None:
        if self.session.changed and self._warned is not self.session.state:
            self._warned = self.session.state
            self.message = "not saved: s saves, the same key again closes all the same"
        else:
            self.closing = True

    # How

    def _chosen(self) -> PartRef:
        if self.session.selected is None:
            raise InputError("no part is selected; click one first.")
        return self.session.selected

    def _switch(self, name: str) -> None:
        if name in COMPARING and not any(self.scene.comparisons):
            raise InputError("there is no input mesh to compare with; give one with --target.")
        before = self.scene.view
        self.scene.view = view = switched(before, name, self.scene.camera.across())
        if name == "explode" or ("beside" in (before.mesh, view.mesh) and before.mesh != view.mesh):
            self.scene.sync()
            self.scene.frame()
        if name == "mesh":
            self.message = f"input mesh: {view.mesh}"
        if name == "residual" and view.residual:
            self.message = "red is missing, blue is too much"

    def _go(self, step: int) -> None:
        refs = self.session.refs()
        if refs:
            at = refs.index(self.session.selected) if self.session.selected else (-1 if step > 0 else 0)
            self.session.select(refs[(at + step) % len(refs)])

    def _look_from(self, azimuth: float, elevation: float) -> None:
        self.scene.camera.azimuth, self.scene.camera.elevation = azimuth, elevation
        self.scene.frame()

    def _edited(self, item: int, suffix: str) -> Path:
        path = self.documents[item].path
        stem = path.stem.removesuffix("_edited")
        return path.with_name(f"{stem}_edited{suffix}")

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
                    self.session.rename(self._chosen(), entry.text)
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
