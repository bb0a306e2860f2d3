"""The window off-screen: keys, clicks, sliders and handles as VTK's own events, and the panel's layout."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from viewer_scenes import chain, need_drawing

from resfit.assembly.assembly import Assembly
from resfit.viewer.desktop.desktop import Desktop
from resfit.viewer.desktop.gizmo import HANDLES, Handle, dragged
from resfit.viewer.desktop.panel_layout import WIDTH, Drawing, lay_out, shorten
from resfit.viewer.model.commands import COMMANDS
from resfit.viewer.model.documents import Document
from resfit.viewer.model.edit_session import EditSession
from resfit.viewer.model.edit_state import PartRef
from resfit.viewer.model.text_entry import Entry
from resfit.viewer.scene.camera import OrbitCamera
from resfit.viewer.scene.controller import Controller
from resfit.viewer.scene.scene import Scene

SIZE = (900, 700)


@pytest.fixture
def desktop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desktop]:
    """A window that is not shown, in an empty folder, on a chain of four parts."""
    need_drawing()
    from resfit.viewer.scene.plotter import make_plotter

    monkeypatch.chdir(tmp_path)
    path = tmp_path / "chain.json"
    assembly = chain()
    assembly.save(path)
    plotter = make_plotter(SIZE, off_screen=True)
    scene = Scene(plotter, EditSession([assembly]), camera=OrbitCamera(azimuth=0.0, elevation=0.0))
    made = Desktop(Controller(scene, [Document(assembly, path, "chain")]))
    made.plotter.show(auto_close=False)
    made.resize()
    scene.frame()
    made.tick()
    yield made
    plotter.close()


def press(desktop: Desktop, name: str, code: str = "", control: bool = False, shift: bool = False) -> None:
    """A key as the window system would report it."""
    interactor = desktop.interactor
    interactor.SetEventInformation(0, 0, int(control), int(shift), code or "\0", 0, name)
    interactor.InvokeEvent("KeyPressEvent")
    desktop.tick()


def mouse(desktop: Desktop, event: str, x: float, y: float) -> None:
    """A mouse event at a pixel from the upper left corner."""
    desktop.interactor.SetEventInformation(round(x), SIZE[1] - 1 - round(y), 0, 0, "\0", 0, None)
    desktop.interactor.InvokeEvent(event)
    desktop.tick()


def drag(
    desktop: Desktop, begin: tuple[float, float], end: tuple[float, float], release: bool = True
) -> None:
    """Press, move in steps, release."""
    mouse(desktop, "LeftButtonPressEvent", *begin)
    for share in (0.3, 0.7, 1.0):
        x, y = (a + share * (b - a) for a, b in zip(begin, end, strict=True))
        mouse(desktop, "MouseMoveEvent", x, y)
    if release:
        mouse(desktop, "LeftButtonReleaseEvent", *end)


def middle(drawing: Drawing, kind: str, name: object) -> tuple[float, float]:
    """The middle of the spot of a kind with an id."""
    spot = next(spot for spot in drawing.spots if (spot.kind, spot.id) == (kind, name))
    return spot.x + spot.width / 2, spot.y + spot.height / 2


def on_screen(desktop: Desktop, point: np.ndarray) -> tuple[float, float]:
    """Pixel from the upper left corner where a point of the scene is drawn."""
    renderer = desktop.plotter.renderer
    renderer.SetWorldPoint(*point, 1.0)
    renderer.WorldToDisplay()
    x, y, _ = renderer.GetDisplayPoint()
    return x, SIZE[1] - 1 - y


def test_a_click_picks_and_a_drag_orbits(desktop: Desktop) -> None:
    session, ref = desktop.controller.session, desktop.controller.session.refs()[1]
    place = on_screen(desktop, np.asarray(session.part(ref).pose.translation))
    drag(desktop, place, (place[0] + 60, place[1]))
    assert session.selected is None and desktop.scene.camera.azimuth == pytest.approx(-24.0)
    desktop.scene.camera.azimuth = 0.0
    desktop.tick()
    desktop.redraw()
    desktop.tick()
    mouse(desktop, "LeftButtonPressEvent", *place)
    mouse(desktop, "LeftButtonReleaseEvent", *place)
    assert session.selected == ref
    assert any(actor.GetVisibility() for actor in desktop.gizmo.actors.values())
    press(desktop, "Escape")
    assert session.selected is None
    assert not any(actor.GetVisibility() for actor in desktop.gizmo.actors.values())


def test_a_slider_is_dragged_live_and_undone_in_one_step(desktop: Desktop) -> None:
    controller, session = desktop.controller, desktop.controller.session
    before = session.state
    controller.select(session.refs()[0])
    desktop.tick()
    x, y = middle(desktop.panel.drawing, "slider", "size.0")
    drag(desktop, (x, y), (x + 30, y), release=False)
    value = session.part(session.refs()[0]).parameters["size"][0]
    assert value > 1.0
    assert desktop.scene.parts.parts[session.refs()[0]].body.GetXRange()[1] > 0.0
    mouse(desktop, "LeftButtonReleaseEvent", x + 30, y)
    press(desktop, "z", control=True)
    assert session.state is before and not session.can_undo
    press(desktop, "Z", control=True, shift=True)
    assert session.part(session.refs()[0]).parameters["size"][0] == value


def test_no_slider_does_anything_before_it_is_touched(desktop: Desktop) -> None:
    before = desktop.controller.session.state
    for ref in desktop.controller.session.refs():
        desktop.controller.select(ref)
        desktop.tick()
    assert desktop.controller.session.state is before and not desktop.controller.session.can_undo


@pytest.mark.parametrize(
    ("handle", "moved"),
    [(Handle("move", 0), "translation"), (Handle("stretch", 0), "size"), (Handle("turn", 2), "rotation")],
)
def test_handles_move_stretch_and_turn(desktop: Desktop, handle: Handle, moved: str) -> None:
    session = desktop.controller.session
    ref = session.refs()[0]
    desktop.controller.select(ref)
    desktop.tick()
    before = session.part(ref)
    frame = desktop.gizmo.actors[handle].user_matrix
    local = {"move": (0.93, 0, 0), "stretch": (1.22, 0, 0), "turn": (0.55, 0.55, 0)}[handle.kind]
    place = on_screen(desktop, frame[:3, :3] @ np.asarray(local) + frame[:3, 3])
    drag(desktop, place, (place[0] + 25, place[1] + (12 if handle.kind == "turn" else 0)))
    after = session.part(ref)
    changed = {
        "translation": before.pose.translation != after.pose.translation,
        "size": before.parameters["size"] != after.parameters["size"],
        "rotation": before.pose.rotation != after.pose.rotation,
    }
    assert changed == {name: name == moved for name in changed}
    assert session.can_undo


def test_keys_edit_show_and_hide(desktop: Desktop) -> None:
    session, controller = desktop.controller.session, desktop.controller
    press(desktop, "n", "n")
    assert session.selected == session.refs()[0]
    press(desktop, "d", "d")
    assert len(session.refs()) == 5 and session.selected == session.refs()[1]
    press(desktop, "Delete")
    assert len(session.refs()) == 4
    press(desktop, "d", "d")
    assert "no part is selected" in controller.message
    press(desktop, "a", "a")
    assert session.part(session.refs()[-1]).family == "superfrustum"
    press(desktop, "h", "h")
    assert session.refs()[-1] in session.state.hidden
    press(desktop, "H", "H", shift=True)
    assert not session.state.hidden
    press(desktop, "i", "i")
    assert len(session.state.hidden) == 4
    press(desktop, "m", "m")
    assert "--target" in controller.message
    press(desktop, "question", "?")
    assert controller.help
    press(desktop, "q", "q")
    assert not controller.closing and "not saved" in controller.message
    controller.run("quit")
    assert controller.closing


def test_values_and_names_can_be_typed(desktop: Desktop) -> None:
    session = desktop.controller.session
    desktop.controller.select(session.refs()[0])
    desktop.tick()
    place = middle(desktop.panel.drawing, "value", "size.1")
    mouse(desktop, "LeftButtonPressEvent", *place)
    mouse(desktop, "LeftButtonReleaseEvent", *place)
    for letter in "0.75":
        press(desktop, letter, letter)
    press(desktop, "Return")
    assert session.part(session.refs()[0]).parameters["size"][1] == 0.75
    press(desktop, "F2")
    for letter in "$x$|<b>":
        press(desktop, "", letter)
    press(desktop, "Return")
    assert session.selected == PartRef(0, "$x$|<b>") == session.refs()[0]
    assert "$x$|<b>" in [text.text for text in desktop.panel.drawing.texts]
    mouse(desktop, "LeftButtonPressEvent", *place)
    mouse(desktop, "LeftButtonReleaseEvent", *place)
    press(desktop, "x", "x")
    press(desktop, "Return")
    assert desktop.controller.message == '"x" is no number.'


def test_saving_never_touches_what_was_opened(desktop: Desktop, tmp_path: Path) -> None:
    controller, original = desktop.controller, (tmp_path / "chain.json").read_bytes()
    controller.session.editor.set_value(controller.session.refs()[0], "size.0", 0.9)
    press(desktop, "s", "s")
    assert (tmp_path / "chain.json").read_bytes() == original
    saved = Assembly.load(tmp_path / "chain_edited.json")
    assert saved == controller.session.state.assemblies[0] and not controller.session.changed
    press(desktop, "E", "E", shift=True)
    assert (tmp_path / "chain_edited.glb").stat().st_size > 1000
    press(desktop, "S", "S", shift=True)
    assert (tmp_path / "chain_01.png").stat().st_size > 1000


def test_the_wheel_zooms_over_the_scene_and_scrolls_over_the_panel(desktop: Desktop) -> None:
    distance = desktop.scene.camera.distance
    mouse(desktop, "MouseWheelForwardEvent", 200, 300)
    assert desktop.scene.camera.distance == pytest.approx(0.9 * distance)
    mouse(desktop, "MouseWheelForwardEvent", SIZE[0] - 50, 100)
    assert desktop.scene.camera.distance == pytest.approx(0.9 * distance)


@pytest.mark.parametrize("size", [(1360, 860), (900, 640), (2560, 1400)])
def test_nothing_in_the_panel_overlaps(desktop: Desktop, size: tuple[int, int]) -> None:
    for selected in (None, desktop.controller.session.refs()[3]):
        desktop.controller.select(selected)
        drawing = lay_out(desktop.controller, *size)
        spots = [spot for spot in drawing.spots if spot.kind not in ("panel", "list")]
        for k, a in enumerate(spots):
            assert (
                size[0] - WIDTH <= a.x and a.x + a.width <= size[0] and a.y >= 0 and a.y + a.height <= size[1]
            ), a
            for b in spots[k + 1 :]:
                apart = (
                    a.x + a.width <= b.x + 1e-6 or b.x + b.width <= a.x + 1e-6
                    or a.y + a.height <= b.y + 1e-6 or b.y + b.height <= a.y + 1e-6
                )  # fmt: skip
                assert apart, (a, b)
        lines = [text for text in drawing.texts if text.x >= size[0] - WIDTH and text.align == "left"]
        assert len({(round(text.x), round(text.y)) for text in lines}) == len(lines)


def test_every_command_has_its_own_key() -> None:
    keys = [key for command in COMMANDS for key in command.keys]
    assert len(set(keys)) == len(keys)


def test_handles_follow_rays_whatever_the_pose() -> None:
    camera = OrbitCamera(azimuth=20.0, elevation=30.0)
    matrix = np.diag([2.0, 2.0, 2.0, 1.0])
    matrix[:3, 3] = 0.3, 0.1, -0.2
    view = camera.view()
    for handle in HANDLES:
        begin = camera.ray(420, 300, (800, 600))
        assert np.allclose(dragged(handle, matrix, begin, begin, view.axes[2]), matrix, atol=1e-9)
        moved = dragged(handle, matrix, begin, camera.ray(455, 330, (800, 600)), view.axes[2])
        assert np.linalg.det(moved[:3, :3]) > 0.0
        if handle.kind in ("move", "free"):
            assert np.allclose(moved[:3, :3], matrix[:3, :3])
        if handle.kind == "turn":
            assert np.allclose(moved[:3, 3], matrix[:3, 3])
            assert np.allclose(moved[:3, :3] @ moved[:3, :3].T, 4.0 * np.eye(3))


def test_long_texts_are_cut_and_entries_typed() -> None:
    assert len(shorten("x" * 500, 100, 13)) <= 14
    entry = Entry("size.0", "size x", "0.5").typed("1").typed(".").typed("5").typed("Shift_L")
    assert entry.text == "1.5" and entry.number() == 1.5 and entry.typed("BackSpace").text == "1."
    assert json.dumps(entry.text)
