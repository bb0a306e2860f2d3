"""What the page is told, what may be saved where, what mouse and keys do, and the page in a notebook: no browser."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from viewer_scenes import need_drawing
from web_pages import three

from resfit.errors import InputError
from resfit.viewer.model.documents import open_documents
from resfit.viewer.model.edit_session import EditSession
from resfit.viewer.model.edit_state import PartRef
from resfit.viewer.scene.controller import Controller
from resfit.viewer.web.app import App
from resfit.viewer.web.picture import Picture
from resfit.viewer.web.pointer import Pointer
from resfit.viewer.web.state import is_offered, page_state, save_name, save_path

SIZE = (320, 240)


@pytest.fixture
def controller(tmp_path: Path) -> Iterator[Controller]:
    """Of three parts, off-screen."""
    need_drawing()
    from resfit.viewer.scene.plotter import make_plotter
    from resfit.viewer.scene.scene import Scene

    three().save(tmp_path / "assembly.json")
    documents = open_documents([tmp_path])
    plotter = make_plotter(SIZE, off_screen=True)
    yield Controller(Scene(plotter, EditSession([documents[0].assembly])), documents)
    plotter.close()


def test_state_is_plain(controller: Controller) -> None:
    state = page_state(controller)
    assert json.loads(json.dumps(state)) == state
    assert [row["name"] for row in state["parts"]] == ["left", "middle", "right"]
    assert state["editor"] is None
    assert {row["name"] for row in state["toggles"]}.isdisjoint(
        {"mesh", "error", "residual", "samples", "gizmo"}
    )
    controller.select(PartRef(0, "right"))
    editor = page_state(controller, revision=7)["editor"]
    assert (editor["item"], editor["name"], editor["family"]) == (0, "right", "cuboid")
    groups = {group["name"]: [row["id"] for row in group["rows"]] for group in editor["groups"]}
    assert groups["Shape"][0] == "size.0" and groups["Position"] == [f"translation.{k}" for k in range(3)]
    assert groups["Join"] == ["blend"] and editor["revision"] == 7
    rows = [row for group in editor["groups"] for row in group["rows"]]
    assert all(row["low"] <= row["value"] <= row["high"] for row in rows)
    assert set(page_state(controller, live=True)) == {"status", "message"}


class State(SimpleNamespace):
    """What the page shows; `told` lists the messages about it."""

    def __enter__(self) -> State:
        return self

    def __exit__(self, *_: object) -> None:
        return

    def client_only(self, *_: str) -> None:
        return

    def update(self, values: dict[str, Any]) -> None:
        self.__dict__.update(values)
        if "status" in values:
            self.told.append(values)


class Trame:
    """As much of trame as the page's other half asks for; counts pictures."""

    def __init__(self) -> None:
        self.state, self.controller, self.pictures = State(told=[]), self, 0

    def trigger(self, _: str) -> Callable[[Any], None]:
        return lambda _: None

    def push_content(self, *_: object) -> None:
        self.pictures += 1


@pytest.fixture
def app(controller: Controller) -> App:
    """A page's other half; tests do its rounds."""
    made = App(controller, Trame())
    made.set_streamer(made.server)
    made.server.state.told.clear()
    return made


def sizes(app: App) -> list[float]:
    """First sizes of the parts."""
    parts = app.controller.session.state.assemblies[0].primitives
    return [float(part.parameters["size"][0]) for part in parts]


def test_numbers_go_to_the_part_that_they_name(app: App) -> None:
    app.on_select(0, "left")
    app.on_select(0, "right")
    app.on_type([0, "left"], "size.0", "0,55")
    app.on_slide([0, "middle"], "size.0", 0.4, True)
    app.round()
    assert sizes(app) == [0.55, 0.4, 0.32] and app.controller.session.selected == PartRef(0, "right")
    assert app.server.state.editor["name"] == "right" and app.controller.message == ""
    for _ in range(2):
        app.on_run("undo")
    app.round()
    assert sizes(app) == [0.32, 0.32, 0.32]


def test_numbers_of_parts_that_are_gone_go_nowhere(app: App) -> None:
    app.on_select(0, "left")
    app.on_run("delete")
    app.on_select(0, "right")
    app.round()
    before = app.controller.session.state
    for part in ([0, "left"], [1, "right"], [0], "right", None, [{}, []], {"item": 0}):
        app.on_type(part, "size.0", "0.55")
        app.on_slide(part, "size.0", 0.55, True)
        app.on_rename(part, "other")
        app.round()
        assert app.controller.message == "there is no such part any more."
    for text in ("", "1e", None, "nan"):
        app.on_type([0, "right"], "size.0", text)
        app.round()
        assert "number" in app.controller.message
    assert app.controller.session.state is before
    app.on_type(None, "view.section_at", "0.25")
    app.round()
    assert app.controller.scene.view.section_at == 0.25 and app.controller.session.state is before


def test_renamed_parts_are_known_by_their_old_names(app: App) -> None:
    app.on_select(0, "left")
    app.on_rename([0, "left"], "wing")
    app.on_rename([0, "left"], "arm")
    app.on_type([0, "left"], "size.0", "0.55")
    app.round()
    assert app.controller.session.selected == PartRef(0, "arm") and sizes(app) == [0.55, 0.32, 0.32]
    app.on_rename([0, "middle"], "left")
    app.on_type([0, "left"], "size.0", "0.4")
    app.round()
    assert sizes(app) == [0.55, 0.4, 0.32]


def test_changes_are_told_once(app: App) -> None:
    trame = app.server
    told = trame.state.told

    def after_round() -> tuple[int, int]:
        told.clear()
        trame.pictures = 0
        app.round()
        return len(told), trame.pictures

    app.on_select(0, "left")
    assert after_round() == (1, 1)
    app.on_type([0, "left"], "size.0", "0.55")
    assert after_round() == (1, 1) and told[0]["editor"]["groups"][0]["rows"][0]["value"] == 0.55
    app.on_interaction("", {"type": "MouseWheel", "spinY": 1.0})
    assert after_round() == (0, 1)
    app.on_type([0, "left"], "size.0", "none")
    assert after_round() == (1, 1) and told[0]["message"] == "that is no number."
    app.on_type([0, "left"], "size.0", "0.6")
    assert b'"size": [0.6, ' in app.text().encode()
    assert after_round() == (1, 1)
    app.controller.select(None)
    assert after_round() == (1, 1) and told[0]["editor"] is None
    assert after_round() == (0, 1)


def test_selections_are_answered_even_if_refused(app: App) -> None:
    for name in ("left", "nobody", "right"):
        app.on_select(0, name)
    assert app.server.state.answered == 0
    app.round()
    assert app.server.state.answered == 3 and app.server.state.editor["name"] == "right"


def test_drags_end_with_whatever_else_is_done(app: App) -> None:
    app.on_select(0, "left")
    for value in (0.4, 0.5):
        app.on_slide([0, "left"], "size.0", value, False)
        app.round()
    assert "editor" not in app.server.state.told[-1]
    app.on_interaction("", {"type": "MouseWheel", "spinY": 1.0})
    app.on_slide([0, "left"], "size.0", 0.6, False)
    app.on_slide([0, "right"], "size.0", 0.7, False)
    app.on_select(0, "right")
    app.round()
    assert sizes(app) == [0.6, 0.32, 0.7]
    assert app.server.state.told[-1]["editor"]["name"] == "right"
    app.on_run("undo")
    app.round()
    assert sizes(app) == [0.6, 0.32, 0.32]
    app.on_run("undo")
    app.round()
    assert sizes(app) == [0.32, 0.32, 0.32]


def test_view_sliders_come_with_what_they_move(controller: Controller) -> None:
    assert page_state(controller)["view_rows"] == []
    controller.run("explode")
    controller.run("section")
    assert [row["id"] for row in page_state(controller)["view_rows"]] == ["view.explode", "view.section_at"]


def test_only_some_commands_are_offered() -> None:
    assert is_offered("undo") and is_offered("save")
    assert not any(is_offered(name) for name in ("quit", "screenshot", "export", "changed", "__init__", ""))


@pytest.mark.parametrize(
    "name",
    [
        "../a.json",
        "/a.json",
        "a/b.json",
        "a\\b.json",
        "..",
        ".hidden.json",
        "c:a.json",
        "a\nb.json",
        "x" * 200,
    ],
)
def test_names_that_go_elsewhere_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError):
        save_path(tmp_path, name)


def test_save_path(tmp_path: Path) -> None:
    assert save_path(tmp_path, " edited ") == tmp_path / "edited.json"
    three().save(tmp_path / "mine.json")
    assert save_path(tmp_path, "mine.json") == tmp_path / "mine.json"
    (tmp_path / "report.json").write_text("{}")
    with pytest.raises(InputError, match="no assembly"):
        save_path(tmp_path, "report.json")
    (tmp_path / "link.json").symlink_to(tmp_path.parent / "elsewhere.json")
    with pytest.raises(InputError, match="link"):
        save_path(tmp_path, "link.json")


def test_proposed_name(controller: Controller) -> None:
    assert save_name(controller) == "assembly_edited.json"
    controller.save_path = Path("/somewhere/mine.json")
    assert save_name(controller) == "mine.json"


def test_pictures_follow_the_page(controller: Controller) -> None:
    picture = Picture(controller.scene)
    assert picture.resize(400, 300) and not picture.resize(400, 300)
    frame = picture.draw(still=False)
    assert (frame.width, frame.height) == (400, 300) and frame.content[:2] == b"\xff\xd8"
    before = picture.pixels().copy()
    controller.select(PartRef(0, "right"))
    controller.slide("translation.1", 0.5)
    picture.draw(still=False)
    assert (np.abs(picture.pixels().astype(int) - before).max(axis=2) > 40).sum() > 500
    assert picture.resize(1e6, 1e6) and picture.draw(still=False).width <= 2560


def test_mouse_and_keys(controller: Controller) -> None:
    picture = Picture(controller.scene)
    pointer = Pointer(controller, picture, lambda action, slot="": action())
    camera = controller.scene.camera
    start = camera.azimuth, camera.distance
    pointer.handle({"type": "LeftButtonPress", "x": 10, "y": 10})
    pointer.handle({"type": "MouseMove", "x": 60, "y": 12})
    pointer.handle({"type": "LeftButtonRelease", "x": 60, "y": 12})
    assert camera.azimuth == pytest.approx(start[0] - 20.0) and controller.session.selected is None
    pointer.handle({"type": "MouseWheel", "spinY": 1.0})
    assert camera.distance > start[1]
    pointer.handle({"type": "StartPinch", "factor": 1.0})
    pointer.handle({"type": "Pinch", "factor": 2.0})
    assert camera.distance < start[1]
    pointer.handle({"type": "keyDown", "key": "n"})
    assert controller.session.selected == PartRef(0, "left")
    pointer.handle({"type": "keyDown", "key": "Backspace"})
    pointer.handle({"type": "keyDown", "key": "z", "controlKey": True})
    assert len(controller.session.refs()) == 3
    pointer.handle({"type": "keyDown", "key": "q"})
    assert not controller.closing
    for broken in ({}, {"type": "MouseWheel"}, {"type": "LeftButtonPress", "x": None}, {"type": "keyDown"}):
        pointer.handle(broken)


@pytest.mark.slow
def test_page_in_a_notebook() -> None:
    pytest.importorskip("trame_vuetify", reason="the extra web is not installed")
    need_drawing()
    from resfit.viewer.web import show

    async def shown() -> tuple[str, str, bytes]:
        made = await show(three(), height=300)
        content = made.assembly.to_json()
        markup, address = made._repr_html_(), made.address
        await made.close()
        return markup, address, content

    # Tests in a browser leave an event loop running on the main thread.
    with ThreadPoolExecutor(1) as thread:
        markup, address, content = thread.submit(lambda: asyncio.run(shown())).result()
    assert markup.startswith("<iframe") and address.startswith("http://127.0.0.1:")
    assert address.partition("token=")[2] in markup and "300px" in markup
    assert content == three().to_json()


@pytest.mark.slow
def test_history_is_looked_at_without_editing() -> None:
    need_drawing()
    from playback_fits import small_fit

    from resfit.viewer.scene.plotter import make_plotter
    from resfit.viewer.scene.scene import Scene
    from resfit.viewer.web.steps import Steps

    documents = open_documents([small_fit().folder])
    plotter = make_plotter(SIZE, off_screen=True)
    scene = Scene(plotter, EditSession([documents[0].assembly]))
    controller = Controller(scene, documents)
    before = controller.session.state
    steps = Steps(controller)
    assert steps.there and steps.state()["step"] is None
    steps.go(3)
    assert controller.message.startswith("Round 1 of")
    assert scene.session is not controller.session and controller.session.state is before
    steps.go(10_000)
    assert steps.at == steps.state()["last_step"] > 3
    assert scene.session.state.assemblies[0] == documents[0].assembly
    steps.leave()
    assert scene.session is controller.session and controller.session.state is before and steps.at is None
    plotter.close()


def test_no_history(controller: Controller) -> None:
    from resfit.viewer.web.steps import Steps

    assert not Steps(controller).there
