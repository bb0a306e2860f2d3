"""`resfit fit --view`: what the window is told and makes of it, and that it cannot disturb the fit."""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playback_fits import ARGUMENTS, run_cli, small_fit
from viewer_scenes import need_drawing

from resfit.viewer.playback import fit_window_client
from resfit.viewer.playback.fit_window_client import LiveView
from resfit.viewer.scene.opengl_check import DisplayError

WRITES_DOWN = "import sys; open(sys.argv[1], 'w').write(sys.stdin.read())"
CLOSES_EARLY = (
    "import sys; sys.stdin.readline(); sys.stdin.readline(); open(sys.argv[1], 'w').write('closed')"
)
NEVER_READS = "import sys, time; open(sys.argv[1], 'w').write('there'); time.sleep(60)"


@pytest.fixture
def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Makes a window of a few lines of Python; what it writes is in the file that is returned."""

    def make(code: str) -> Path:
        path = tmp_path / "window.txt"
        monkeypatch.setattr(fit_window_client, "require_screen", lambda: None)
        monkeypatch.setattr(
            fit_window_client, "window_command", lambda: [sys.executable, "-c", code, str(path)]
        )
        return path

    return make


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[dict[str, Any]]]:
    """The folder of a fit that was watched, and what the window was told."""
    base = tmp_path_factory.mktemp("watched")
    command = [sys.executable, "-c", WRITES_DOWN, str(base / "window.txt")]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fit_window_client, "require_screen", lambda: None)
        patch.setattr(fit_window_client, "window_command", lambda: command)
        assert fit_with_view(base / "fit") == 0
    return base / "fit", events_of(base / "window.txt")


def fit_with_view(folder: Path) -> int:
    return run_cli("fit", small_fit().mesh, "-o", folder, *ARGUMENTS, "--view")


def events_of(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_the_window_is_told_every_stage_and_the_result(watched) -> None:
    folder, events = watched
    assert [event["event"] for event in (events[0], events[-1])] == ["begin", "final"]
    assert events[0]["mesh"] == str(small_fit().mesh) and events[0]["family"] == "superfrustum"
    steps = events[1:-1]
    assert {event["event"] for event in steps} == {"step"}
    stages = [event["stage"] for event in steps]
    assert stages[0] == "reading the mesh" and {"decomposing", "refining", "pruning"} <= set(stages)
    rounds = [event["round"] for event in steps]
    assert rounds == sorted(rounds)
    assert np.shape(steps[-1]["rows"])[0] >= 1
    assert events[-1]["assembly"].encode() == (folder / "assembly.json").read_bytes()


def test_a_window_changes_nothing_about_the_fit(stand_in, tmp_path: Path) -> None:
    alone = (small_fit().folder / "assembly.json").read_bytes()
    path = stand_in(CLOSES_EARLY)
    assert fit_with_view(tmp_path / "early") == 0
    assert path.read_text() == "closed"
    assert (tmp_path / "early" / "assembly.json").read_bytes() == alone


def test_a_window_that_hangs_holds_nothing_up(stand_in, tmp_path: Path) -> None:
    path = stand_in(NEVER_READS)
    view = LiveView(small_fit().mesh, "superfrustum", "y")
    rows = np.zeros((64, 17), np.float32)
    for number in range(200):
        view.show("refining", number, 200, rows, 0.5, 0.5)
    while not path.exists():
        threading.Event().wait(0.02)
    view.close()
    view.show("refining", 1, 1, rows, 0.5, 0.5)
    assert view.closed


def test_a_fit_that_fails_closes_the_window(stand_in, tmp_path: Path) -> None:
    stand_in(NEVER_READS)
    mesh = tmp_path / "none.ply"
    mesh.write_text("no mesh")
    assert run_cli("fit", mesh, "-o", tmp_path / "fit", "--view") == 2


def test_interrupting_keeps_the_best_so_far_and_then_closes_the_window(stand_in, tmp_path: Path) -> None:
    told = stand_in(WRITES_DOWN)
    send = threading.Timer(0.0, lambda: None)
    shown = LiveView.show

    def show_then_interrupt(self: LiveView, *values: Any) -> None:
        shown(self, *values)
        if values[0] == "pruning" and not send.finished.is_set():
            send.finished.set()
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(LiveView, "show", show_then_interrupt)
        assert fit_with_view(tmp_path / "fit") == 4
    assert events_of(told)[-1]["status"].startswith("interrupted")
    assert (tmp_path / "fit" / "assembly.json").is_file()


def test_without_a_screen_nothing_is_begun(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(fit_window_client, "has_display", lambda: False)
    mesh = small_fit().mesh
    capsys.readouterr()
    assert run_cli("fit", mesh, "-o", tmp_path / "fit", "--view") == DisplayError.exit_code == 2
    complaint = capsys.readouterr().err
    assert "there is no screen" in complaint and "--video" in complaint and complaint.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_the_window_draws_what_it_is_told_and_ends_with_the_result(watched) -> None:
    need_drawing()
    from resfit.viewer.playback.fit_window import LiveSteps, follow, make_player
    from resfit.viewer.scene.screenshot import grab

    events = watched[1]
    waiting: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
    player, steps = make_player(events[0], off_screen=True), LiveSteps(events[0]["family"])
    try:
        assert player.scene.scene.view.mesh == "ghost"
        player.draw()
        before = grab(player.plotter)
        for event in events[1:]:
            waiting.put(event)
        waiting.put(None)
        follow(player, steps, waiting)
        assert not player.closing
        assert len(player.frames) == len(events) and player.at == len(events) - 1
        assert player.frames[-1].assembly == small_fit().assembly
        assert player.scene.scene.view.mesh == "off"
        player.draw()
        assert np.abs(grab(player.plotter).astype(int) - before).max() > 60
    finally:
        player.plotter.close()


def test_a_window_whose_fit_is_gone_closes() -> None:
    need_drawing()
    from resfit.viewer.playback.fit_window import LiveSteps, follow, make_player

    begin = {"mesh": "/nowhere.ply", "title": "nowhere.ply", "family": "superfrustum", "up": "z"}
    waiting: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
    player = make_player(begin, off_screen=True)
    try:
        waiting.put(
            {
                "event": "step",
                "stage": "sampling",
                "round": 0,
                "rounds": 9,
                "rows": None,
                "iou": 0,
                "objective": 0,
            }
        )
        waiting.put(None)
        follow(player, LiveSteps("superfrustum"), waiting)
        assert player.frames[-1].title == "sampling" and player.closing
    finally:
        player.plotter.close()
