"""Running a command as a child and measuring what it costs: wall and CPU seconds, memory.

A process of its own for each fit: what one method leaves behind (threads, caches, a crash) costs no other one anything.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

POLL_SECONDS = 0.01
"""Between two looks at a child's memory. That is a high-water mark: only growth since the last look is lost."""

TAIL_BYTES = 20_000
"""Of what a child wrote on stdout and stderr, so much is kept."""


@dataclass(frozen=True)
class ChildRun:
    """Exit status and cost of a child process."""

    exit_code: int
    """Negative: the signal that ended it."""
    timed_out: bool
    wall_s: float
    cpu_s: float
    """User and system, of the child and of its own children."""
    peak_mb: float
    """Most memory that the child and its children held together, MB (1e6 bytes)."""
    stdout: str
    stderr: str

    @property
    def complaint(self) -> str:
        """Error message in one line."""
        if self.timed_out:
            return "it took too long"
        lines = [line.strip() for line in self.stderr.splitlines() if line.strip()]
        ours = [line.removeprefix("resfit: ") for line in lines if line.startswith("resfit: ")]
        said = (ours or lines or [""])[-1][:300]
        if self.exit_code < 0:
            return f"it crashed ({_signal_name(-self.exit_code)})" + (f": {said}" if said else "")
        return said or f"it ended with exit code {self.exit_code} and said nothing"


def _signal_name(number: int) -> str:
    """SIGSEGV for 11."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def run_measured(command: Sequence[str], timeout: float | None = None) -> ChildRun:
    """Run a command to its end.

    Args:
        command: program and arguments.
        timeout: wall seconds after which the child and all its children are killed; None waits for ever.
    """
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as errors:
        begin = time.perf_counter()
        # A session of its own, so that its children can be ended with it.
        child = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=out, stderr=errors, start_new_session=os.name == "posix"
        )
        try:
            timed_out, cpu_s, peak_mb = _watch(child, begin, timeout)
        finally:
            if child.returncode is None:
                _kill(child)
                child.wait()
        wall_s = time.perf_counter() - begin
        texts = [_tail(stream) for stream in (out, errors)]
    exit_code = child.returncode if child.returncode is not None else -signal.SIGKILL
    return ChildRun(exit_code, timed_out, wall_s, cpu_s, peak_mb, *texts)


def _watch(child: subprocess.Popen[bytes], begin: float, timeout: float | None) -> tuple[bool, float, float]:
    """Wait for a child: whether it had to be killed, CPU seconds, peak MB."""
    timed_out, peak = False, 0
    while True:
        if hasattr(os, "wait4"):
            peak = max(peak, _tree_bytes(child.pid))
            process, status, usage = os.wait4(child.pid, os.WNOHANG)
            if process:
                child.returncode = os.waitstatus_to_exitcode(status)
                # Where there is no /proc. On Linux this one may be the parent's, inherited through fork and exec.
                peak = peak or usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
                return timed_out, usage.ru_utime + usage.ru_stime, peak / 1e6
        elif child.poll() is not None:
            return timed_out, 0.0, 0.0
        if timeout is not None and not timed_out and time.perf_counter() - begin > timeout:
            timed_out = True
            _kill(child)
        time.sleep(POLL_SECONDS)


def _kill(child: subprocess.Popen[bytes]) -> None:
    """End a child that has not been waited for, and all that it started."""
    if os.name == "posix":
        try:
            os.killpg(child.pid, signal.SIGKILL)
        except ProcessLookupError:
            return
    else:
        child.kill()


def _tree_bytes(pid: int) -> int:
    """High-water marks of a process and its descendants together; 0 where the system does not tell."""
    total = 0
    try:
        for line in Path(f"/proc/{pid}/status").read_text(errors="replace").splitlines():
            if line.startswith("VmHWM:"):
                total = int(line.split()[1]) * 1024
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except (OSError, ValueError):
        return total
    return total + sum(_tree_bytes(int(child)) for child in children)


def _tail(stream) -> str:
    size = stream.seek(0, os.SEEK_END)
    stream.seek(max(0, size - TAIL_BYTES))
    return stream.read().decode("utf-8", errors="replace")
