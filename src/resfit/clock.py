"""Cost of a run so far: CPU seconds, wall seconds, memory. Imports nothing heavy, so as to start first."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

MAX_AGE = 3600.0
"""A process said to be older than this when its work begins has a clock that cannot be believed (containers)."""


@dataclass(frozen=True)
class Clock:
    """A moment to count from."""

    cpu: float
    """CPU seconds, user and system, children included, that this process had used up."""
    wall: float
    """Seconds of `time.perf_counter`."""

    @classmethod
    def now(cls) -> Clock:
        """Count from this moment."""
        return cls(_cpu_seconds(), time.perf_counter())

    @classmethod
    def of_process(cls) -> Clock:
        """Count from the start of this process, imports included."""
        return cls(0.0, time.perf_counter() - _age())

    @property
    def cpu_s(self) -> float:
        """CPU seconds since then."""
        return _cpu_seconds() - self.cpu

    @property
    def wall_s(self) -> float:
        """Wall seconds since then."""
        return time.perf_counter() - self.wall


@contextmanager
def timed(timings: dict[str, float], stage: str) -> Iterator[None]:
    """Add the wall time of a block to its stage."""
    begin = time.perf_counter()
    try:
        yield
    finally:
        timings[stage] = timings.get(stage, 0.0) + time.perf_counter() - begin


def peak_mb() -> float:
    """Most memory that this process has held so far, in MB (1e6 bytes).

    VmHWM where the system tells it: `ru_maxrss` is inherited through fork and exec, so a small child of a large
    process would look large.
    """
    try:
        with open("/proc/self/status", encoding="ascii", errors="replace") as stream:
            for line in stream:
                if line.startswith("VmHWM:"):
                    return int(line.split()[1]) * 1024 / 1e6
    except OSError:
        pass
    try:
        import resource
    except ImportError:  # Windows has no such module.
        return 0.0
    import sys

    # Kilobytes, but bytes on macOS.
    return (
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024) / 1e6
    )


def _cpu_seconds() -> float:
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def _age() -> float:
    """Seconds since this process started; 0 where that cannot be told."""
    try:
        with open("/proc/self/stat", encoding="ascii", errors="replace") as stream:
            # The name, in brackets, may hold spaces; field 22 of the whole is the start in ticks since boot.
            ticks = int(stream.read().rpartition(")")[2].split()[19])
        age = time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError, AttributeError):
        return 0.0
    return age if 0.0 <= age < MAX_AGE else 0.0
