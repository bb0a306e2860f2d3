"""View commands of keys: what is drawn, the comparison with the input mesh, and where the camera stands."""

from __future__ import annotations

from dataclasses import replace

from resfit.errors import InputError

from ..model.commands import COMMANDS, Command
from ..model.parameters import Slider
from ..model.view_options import COMPARING, TOGGLES, is_on, switched
from .scene import Scene


class ViewActions:
    """Commands on the view and the camera of a scene."""

    def __init__(self, scene: Scene) -> None:
        """Act on a scene."""
        self._scene = scene

    def sliders(self) -> tuple[Slider, ...]:
        """Sliders of the explosion and of the section plane."""
        view = self._scene.view
        return (
            Slider("view.explode", "View", "explode", "ratio", "how far parts are moved apart", (0.0, 1.0),
                   (0.0, 4.0), 0.01, view.explode),
            Slider("view.section_at", "View", "section", "ratio", "where the plane of sections and slices lies",
                   (0.0, 1.0), (0.0, 1.0), 0.005, view.section_at),
        )  # fmt: skip

    def set_value(self, slider_id: str, value: float) -> None:
        """Set the number of one of the sliders."""
        self._scene.view = replace(self._scene.view, **{slider_id.removeprefix("view."): value})

    def toggles(self) -> tuple[tuple[Command, bool], ...]:
        """Switches, and whether each is on."""
        view = self._scene.view
        return tuple((command, is_on(view, command.name)) for command in COMMANDS if command.name in TOGGLES)

    def switch(self, name: str) -> str | None:
        """Do one of `SWITCHES`; what there is to say about it.

        Raises:
            InputError: if it needs an input mesh and there is none.
        """
        scene = self._scene
        if name in COMPARING and not any(scene.comparisons):
            raise InputError("there is no input mesh to compare with; give one with --target.")
        before = scene.view
        scene.view = view = switched(before, name, scene.camera.across())
        if name == "explode" or ("beside" in (before.mesh, view.mesh) and before.mesh != view.mesh):
            scene.sync()
            scene.frame()
        if name == "mesh":
            return f"input mesh: {view.mesh}"
        if name == "residual" and view.residual:
            return "red is missing, blue is too much"
        return None

    def frame(self) -> None:
        self._scene.frame()

    def front(self) -> None:
        self._look_from(0.0, 0.0)

    def side(self) -> None:
        self._look_from(90.0, 0.0)

    def top(self) -> None:
        self._look_from(0.0, 88.0)

    def up(self) -> None:
        camera = self._scene.camera
        camera.up = "z" if camera.up == "y" else "y"
        self._scene.frame()

    def _look_from(self, azimuth: float, elevation: float) -> None:
        self._scene.camera.azimuth, self._scene.camera.elevation = azimuth, elevation
        self._scene.frame()
