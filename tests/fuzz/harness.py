"""A worker process with limits, and what became of each case that it tried.

A campaign is a stream of named cases and a function that tries one. The worker runs the function: it may raise
`InputError` (refused, as it should be) and nothing else. Crashes, hangs and the memory that it took are seen from
outside. Needs Linux: the memory is that of /proc.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import resource
import shutil
import signal
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from resfit.errors import InputError

OK, REFUSED, SKIPPED = "ok", "refused", "skipped"
RAW, WRONG, CRASH, HANG, MEMORY = "raw", "wrong", "crash", "hang", "memory"
"""Faults: another exception, a result that is not right, a process that died, did not end or took too much."""

FAULTS = (RAW, WRONG, CRASH, HANG, MEMORY)
START_SECONDS = 120.0
"""For a worker's imports, on a machine that does other things too."""

LONG_MESSAGE = 600
"""Letters; a refusal is one sentence."""


class Wrong(Exception):
    """A result that is not as it should be."""


class Skip(Exception):
    """A case that cannot be tried here; the text says what is missing."""


@dataclass(frozen=True)
class Case:
    """One input."""

    name: str
    data: bytes = b""
    """What the input file holds, if there is one."""
    suffix: str = ""
    """Of that file, without a dot."""


@dataclass(frozen=True)
class Campaign:
    """A stream of cases and what tries them."""

    name: str
    cases: Callable[[random.Random], Iterator[Case]]
    """All cases, those made by hand in random order; it need not end."""
    attempt: Callable[[Case, Path], str | None]
    """Tries a case in an empty folder, and returns what is worth telling; importable by its name."""
    hang_s: float = 30.0
    """Seconds after which a case is given up, on a machine that has nothing else to do."""
    memory: float = 2.0e9
    """Bytes of resident memory that a case may take."""
    address_space: int = 16 << 30
    """Bytes of the worker and, each for itself, of the processes that it starts."""
    weight: float = 1.0
    """Its share of the time, compared with others."""
    unavailable: Callable[[], str] = lambda: ""
    """Why it cannot run here; nothing if it can."""


@dataclass(frozen=True)
class Outcome:
    """What became of a case."""

    kind: str
    text: str = ""
    where: str = ""
    """The places in the source that an exception passed, the innermost first."""
    seconds: float = 0.0
    memory: float = 0.0
    """Most bytes of resident memory."""

    @property
    def fault(self) -> bool:
        """Whether something is to be mended."""
        return self.kind in FAULTS


class Worker:
    """A process that tries cases one after the other; a new one takes over when it has died."""

    def __init__(self, campaign: Campaign) -> None:
        """Nothing is started before the first case."""
        self.campaign = campaign
        self._process: Any = None
        self._pipe: Connection
        self._base = Path(tempfile.mkdtemp(prefix="resfit-fuzz-"))
        # Processes of other users take part in some cases.
        self._base.chmod(0o755)

    def run(self, case: Case) -> Outcome:
        """Try one case."""
        if self._process is None:
            self._process = self._start()
        begin = time.monotonic()
        try:
            self._pipe.send(case)
            there = self._pipe.poll(self.campaign.hang_s)
            found = (
                self._pipe.recv() if there else Outcome(HANG, f"not done after {self.campaign.hang_s:g} s")
            )
        except (EOFError, OSError):
            self._process.join(10.0)
            found = Outcome(CRASH, f"the process ended with {exit_name(self._process.exitcode)}")
        seconds = time.monotonic() - begin
        found = Outcome(found.kind, found.text, found.where, seconds, found.memory)
        if found.kind in (OK, REFUSED) and found.memory > self.campaign.memory:
            found = Outcome(
                MEMORY, f"{found.memory / 1e9:.1f} GB, then {found.kind}", "", seconds, found.memory
            )
        if found.kind in (HANG, CRASH, MEMORY):
            # What is left of it may still hold memory.
            self._stop()
        return found

    def close(self) -> None:
        """End the process and all that it started, and remove their files."""
        self._stop()
        shutil.rmtree(self._base, ignore_errors=True)

    def _start(self) -> Any:
        """A new process, which waits for cases."""
        context = multiprocessing.get_context("spawn")
        self._pipe, far = context.Pipe()
        campaign = self.campaign
        arguments = (far, campaign.attempt, campaign.address_space, self._base)
        process = self._process = context.Process(target=serve, args=arguments)
        process.start()
        far.close()
        try:
            ready = self._pipe.poll(START_SECONDS) and self._pipe.recv()
        except EOFError:
            ready = False
        if not ready:
            self._stop()
            raise RuntimeError(f"the worker of '{campaign.name}' does not start")
        return process

    def _stop(self) -> None:
        if self._process is None:
            return
        for number in (*descendants(self._process.pid), self._process.pid):
            try:
                os.kill(number, signal.SIGKILL)
            except ProcessLookupError:
                continue
        self._process.join()
        self._pipe.close()
        self._process = None
        for path in self._base.iterdir():
            shutil.rmtree(path, ignore_errors=True)


def serve(
    pipe: Connection, attempt: Callable[[Case, Path], str | None], address_space: int, base: Path
) -> None:
    """The worker: answer each case with its outcome, until the other end of the pipe is closed."""
    # A session of its own: Ctrl-C at a terminal is for the parent to handle.
    os.setsid()
    # Below nohup and in some services it is ignored, and so it would be by all that is started here.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (address_space, hard))
    with open(os.devnull, "r+b") as sink:
        for descriptor in (0, 1, 2):
            os.dup2(sink.fileno(), descriptor)
    # What cases and the processes that they start put aside goes with the worker.
    os.environ["TMPDIR"] = tempfile.tempdir = str(base)
    pipe.send(True)
    while True:
        try:
            case = pipe.recv()
        except EOFError:
            return
        folder = Path(tempfile.mkdtemp(dir=base))
        folder.chmod(0o777)
        forget_peak()
        found = tried(attempt, case, folder)
        pipe.send(Outcome(found.kind, found.text, found.where, 0.0, peak_memory()))
        shutil.rmtree(folder, ignore_errors=True)


def tried(attempt: Callable[[Case, Path], str | None], case: Case, folder: Path) -> Outcome:
    """The outcome of a case in this process."""
    try:
        return Outcome(OK, attempt(case, folder) or "")
    except InputError as error:
        text = str(error)
        if "\n" in text.strip() or len(text) > LONG_MESSAGE:
            return Outcome(WRONG, f"refused by more than one sentence: {text[:300]!r}", "long message")
        return Outcome(REFUSED, text)
    except Skip as error:
        return Outcome(SKIPPED, str(error))
    except Wrong as error:
        return Outcome(WRONG, str(error))
    except MemoryError as error:
        return Outcome(MEMORY, f"MemoryError: {error}", places(error))
    except BaseException as error:
        return Outcome(RAW, f"{type(error).__name__}: {' '.join(str(error).split())[:300]}", places(error))


def places(error: BaseException) -> str:
    """file:line of where an exception was raised, and of our own code on the way there."""
    frames = traceback.extract_tb(error.__traceback__)
    here = str(Path(__file__).parent)
    ours = [
        frame
        for frame in frames[:-1]
        if not any(part in frame.filename for part in ("site-packages", "/lib/python", here))
    ]
    return " < ".join(
        f"{Path(frame.filename).name}:{frame.lineno}" for frame in (*frames[-1:], *ours[-2:][::-1])
    )


def descendants(process: int) -> list[int]:
    """Numbers of the processes below one, the youngest first: those too that lead a session of their own."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            # The name, in brackets, may hold spaces.
            parents[int(entry.parent.name)] = int(
                entry.read_text(errors="replace").rpartition(")")[2].split()[1]
            )
        except (OSError, IndexError):
            continue
    found, level = [], {process}
    while level:
        level = {child for child, parent in parents.items() if parent in level}
        found = [*sorted(level), *found]
    return found


def patience() -> float:
    """How much longer things take on a machine as busy as this one is now; at most four times."""
    return min(4.0, max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1)))


def exit_name(code: int | None) -> str:
    """How a process ended, in words."""
    if code is not None and code < 0:
        return signal.Signals(-code).name
    return f"exit code {code}"


def forget_peak() -> None:
    """Count the most memory of this process anew."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def peak_memory() -> float:
    """Most resident bytes of this process since then."""
    for line in Path("/proc/self/status").read_text(errors="replace").splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) * 1024.0
    return 0.0
