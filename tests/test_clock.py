"""What a run has cost: seconds by stage, of the process, and memory."""

from __future__ import annotations

import subprocess
import sys
import time

import pytest

from resfit import clock
from resfit.clock import Clock, timed


def test_stages_add_up_even_where_they_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = iter([1.0, 3.0, 10.0, 14.0, 20.0, 21.0])
    monkeypatch.setattr(time, "perf_counter", lambda: next(ticks))
    timings: dict[str, float] = {}
    with timed(timings, "load"):
        pass
    with timed(timings, "fit"):
        pass
    with pytest.raises(KeyError), timed(timings, "load"):
        raise KeyError
    assert timings == {"load": 3.0, "fit": 4.0}


def test_a_process_is_counted_from_its_start(monkeypatch: pytest.MonkeyPatch) -> None:
    now = time.perf_counter()
    monkeypatch.setattr(clock, "_age", lambda: 5.0)
    monkeypatch.setattr(time, "perf_counter", lambda: now)
    assert Clock.of_process().wall_s == pytest.approx(5.0) and Clock.now().wall_s == 0.0
    assert Clock.of_process().cpu == 0.0 and Clock.of_process().cpu_s > 0.0


def test_an_age_that_cannot_be_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """In some containers the boot of another machine is counted from."""
    assert 0.0 <= clock._age() < clock.MAX_AGE
    monkeypatch.setattr(clock, "MAX_AGE", 0.0)
    assert clock._age() == 0.0


def test_peak_memory_counts_what_was_freed() -> None:
    """In a process of its own: this one may have held more before."""
    code = (
        "from resfit.clock import peak_mb\nbefore = peak_mb()\nblock = bytearray(60_000_000)\n"
        "block[::4096] = b'x' * len(block[::4096])\ndel block\nprint(peak_mb() - before)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert 50.0 < float(run.stdout) < 70.0
