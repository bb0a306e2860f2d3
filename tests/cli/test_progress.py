"""How a fit in progress is shown: JSON lines for programs, a bar for people, and what is guessed of the time left."""

from __future__ import annotations

import json
import sys
import time

import pytest

from resfit.cli.progress import SURE_SHARE, BarReporter, JsonReporter, Reporter, make_reporter
from resfit.fitter.progress import TARGET_SHARE, Progress

HALF = Progress("refine", 2, 4, 1, 0.87654321, 0.91, 0.5)


def test_rounds_share_what_the_target_leaves() -> None:
    assert Progress("x", 1, 1, 0, 0.0, 0.0, 0.0).after_target().fraction == TARGET_SHARE
    assert HALF.after_target().fraction == pytest.approx(0.55)
    assert Progress("x", 1, 1, 0, 0.0, 0.0, 1.0).after_target().fraction == 1.0


def test_time_left_follows_from_the_share_once_it_is_sure(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    with Reporter() as reporter:
        now[0] = 106.0
        assert reporter.elapsed == 6.0
        assert reporter.left(0.25) == pytest.approx(18.0) and reporter.left(1.0) == 0.0
        assert reporter.left(0.99 * SURE_SHARE) is None


def test_a_line_of_json_for_each_event(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [10.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    with JsonReporter() as reporter:
        reporter.tell("start", mesh="a.stl")
        now[0] = 12.0
        reporter.show(HALF)
    assert [json.loads(line) for line in capsys.readouterr().err.splitlines()] == [
        {"event": "start", "elapsed_s": 0.0, "mesh": "a.stl"},
        {
            "event": "progress", "elapsed_s": 2.0, "stage": "refine", "round": 2, "rounds": 4, "primitive_count": 1,
            "objective": 0.876543, "iou": 0.91, "fraction": 0.5, "left_s": 2.0,
        },
    ]  # fmt: skip


def test_the_bar_says_stage_and_parts() -> None:
    with BarReporter() as reporter:
        reporter.show(HALF)
        (task,) = reporter.bar.tasks
        assert task.description == "refining" and task.completed == 0.5
        assert task.fields["found"] == "1 part, IoU 0.910"
        reporter.tell("stopping")
        assert task.description == "stopping" and task.fields["left"] == ""


def test_a_bar_only_where_somebody_sees_it(monkeypatch: pytest.MonkeyPatch) -> None:
    assert type(make_reporter("json")) is JsonReporter and type(make_reporter("none")) is Reporter
    for terminal, kind in ((True, BarReporter), (False, Reporter)):
        monkeypatch.setattr(sys.stderr, "isatty", lambda terminal=terminal: terminal, raising=False)
        assert type(make_reporter("auto")) is kind
