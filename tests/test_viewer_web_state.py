"""What the page is told, what may be saved where, what mouse and keys do, and the page in a notebook: no browser."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from viewer_scenes import need_drawing
from web_pages import three

from resfit.errors import InputError
from resfit.viewer.controller import Controller
from resfit.viewer.documents import open_documents
from resfit.viewer.edits import EditSession, PartRef
from resfit.viewer.web.picture import Picture
from resfit.viewer.web.pointer import Pointer
from resfit.viewer.web.state import is_offered, page_state, save_name, save_path

SIZE = (320, 240)


@pytest.fixture
def controller(tmp_path: Path) -> Iterator[Controller]:
    """Of three parts, off-screen."""
    need_drawing()
    from resfit.viewer.scene import Scene
    from resfit.viewer.stage import make_plotter

    three().save(tmp_path / "assembly.json")
    documents = open_documents([tmp_path])
    plotter = make_plotter(SIZE, off_screen=True)
    yield Controller(Scene(plotter, EditSession([documents[0].assembly])), documents)
    plotter.close()


def test_state_is_plain(controller: Controller) -> None:
    state = page_state(controller)
    assert json.loads(json.dumps(state)) == state
    assert [row["name"] for row in state["parts"]] == ["left", "middle", "right"]
    assert state["selected"] is None and state["groups"] == []
    assert {row["name"] for row in state["toggles"]}.isdisjoint(
        {"mesh", "error", "residual", "samples", "gizmo"}
    )
    controller.select(PartRef(0, "right"))
    state = page_state(controller, revision=7)
    groups = {group["name"]: [row["id"] for row in group["rows"]] for group in state["groups"]}
    assert groups["Shape"][0] == "size.0" and groups["Position"] == [f"translation.{k}" for k in range(3)]
    assert groups["Join"] == ["blend"] and {group["revision"] for group in state["groups"]} == {7}
    rows = [row for group in state["groups"] for row in group["rows"]]
    assert all(row["low"] <= row["value"] <= row["high"] for row in rows)
    assert set(page_state(controller, live=True)) == {"status", "message"}


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

    markup, address, content = asyncio.run(shown())
    assert markup.startswith("<iframe") and address.startswith("http://127.0.0.1:")
    assert address.partition("token=")[2] in markup and "300px" in markup
    assert content == three().to_json()


@pytest.mark.slow
def test_history_is_looked_at_without_editing() -> None:
    need_drawing()
    from playback_fits import small_fit

    from resfit.viewer.scene import Scene
    from resfit.viewer.stage import make_plotter
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
