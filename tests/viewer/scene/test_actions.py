"""What commands do to parts, to the view and to files, each by itself: nothing is drawn."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from viewer_scenes import chain

from resfit.assembly.assembly import Assembly
from resfit.errors import InputError
from resfit.kernels.primitives import DEFAULT_FAMILY
from resfit.viewer.model.commands import COMMANDS
from resfit.viewer.model.documents import Document
from resfit.viewer.model.edit_session import EditSession
from resfit.viewer.model.view_options import SWITCHES, View
from resfit.viewer.scene.camera import OrbitCamera
from resfit.viewer.scene.controller import Controller
from resfit.viewer.scene.file_actions import FileActions
from resfit.viewer.scene.part_actions import PartActions
from resfit.viewer.scene.view_actions import ViewActions


@pytest.fixture
def scene() -> Any:
    """What actions ask of a scene, without a window."""
    calls: list[str] = []
    return SimpleNamespace(
        session=EditSession([chain()]),
        arrangement=SimpleNamespace(placed=[SimpleNamespace(matrix=np.diag([2.0, 2.0, 2.0, 1.0]))]),
        camera=OrbitCamera(),
        comparisons=[None],
        view=View(),
        calls=calls,
        frame=lambda: calls.append("frame"),
        sync=lambda live=False: calls.append("sync"),
    )


def test_every_command_does_something(scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only a command without a meaning would raise KeyError; those that lack a choice or a mesh say so."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(FileActions, "screenshot", lambda self, item: "wrote a picture")
    assembly = scene.session.state.assemblies[0]
    controller = Controller(scene, [Document(assembly, tmp_path / "chain.json", "chain")])
    for command in COMMANDS:
        controller.run(command.name)
    assert controller.closing and (tmp_path / "chain_edited.json").exists()


def test_parts_are_chosen_in_turn_and_acted_on(scene: Any) -> None:
    session = scene.session
    actions = PartActions(session, scene)
    with pytest.raises(InputError, match="no part is selected"):
        actions.delete()
    actions.previous()
    assert session.selected == session.refs()[-1]
    actions.next()
    assert session.selected == session.refs()[0]
    actions.isolate()
    assert len(session.state.hidden) == 3
    assert actions.duplicate().endswith("is the copy") and session.selected == session.refs()[1]
    actions.delete()
    assert actions.add() == f"added a {DEFAULT_FAMILY}"
    assert [actions.undo() for _ in range(5)][-1] == "nothing to undo"
    assert session.state.assemblies[0] == chain()


def test_handles_place_in_the_frame_of_the_assembly(scene: Any) -> None:
    session = scene.session
    session.select(session.refs()[0])
    held = session.part(session.refs()[0])
    matrix = np.diag([2.0, 2.0, 2.0, 1.0])
    matrix[:3, 3] = (0.4, 0.0, 0.0)
    PartActions(session, scene).place(matrix, held)
    part = session.part(session.refs()[0])
    assert part.pose.translation == pytest.approx((0.2, 0.0, 0.0)) and part.parameters == held.parameters


def test_views_are_switched_and_framed_where_things_move(scene: Any) -> None:
    actions = ViewActions(scene)
    with pytest.raises(InputError, match="--target"):
        actions.switch("mesh")
    scene.comparisons = [object()]
    assert actions.switch("mesh") == "input mesh: ghost" and not scene.calls
    assert actions.switch("explode") is None and scene.calls == ["sync", "frame"]
    assert {command.name: on for command, on in actions.toggles()}["explode"]
    actions.set_value("view.explode", 0.0)
    assert not scene.view.explode
    actions.side()
    assert scene.camera.azimuth == 90.0
    assert {command.name for command, _ in actions.toggles()} < set(SWITCHES)


def test_files_are_written_and_changes_guarded(scene: Any, tmp_path: Path) -> None:
    session, assembly = scene.session, scene.session.state.assemblies[0]
    files = FileActions(session, scene, [Document(assembly, tmp_path / "a.json", "a")], [tmp_path / "a.glb"])
    assert files.may_close()
    session.delete(session.refs()[0])
    assert not files.may_close() and files.may_close()
    assert files.save(None) == f"saved {tmp_path / 'a_edited.json'}"
    assert Assembly.load(tmp_path / "a_edited.json") == session.state.assemblies[0] and not session.changed
    assert files.export(0) == f"exported {tmp_path / 'a.glb'}" and (tmp_path / "a.glb").exists()
