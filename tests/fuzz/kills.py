"""Kills: `resfit fit` ended at random times by SIGKILL, SIGTERM, SIGINT once and twice; half over an earlier result.

Wrong: an output that is neither absent, nor old, nor whole; exit codes other than 0, 4 or the signal; a process that
lives on; temporary files after anything but SIGKILL, and after the next fit there.
"""

from __future__ import annotations

import random
import shutil
import signal
import time
from collections.abc import Iterator
from functools import cache
from itertools import count
from pathlib import Path
from tempfile import mkdtemp

from fuzz.commands import (
    check_code,
    check_said,
    check_whole,
    digests,
    ended,
    fit_command,
    leftovers,
    mesh_in,
    run,
    start,
)
from fuzz.harness import Campaign, Case, Wrong, descendants

KINDS = ("SIGKILL", "SIGTERM", "SIGINT", "SIGINT twice")
STARTED, STOPPED = (0,), (0, 4, -signal.SIGINT, -signal.SIGTERM)


def cases(rng: random.Random) -> Iterator[Case]:
    """The kinds in turn, for ever: at what share of the time that a whole fit takes."""
    for number in count():
        # Half of them near the end, where files are written.
        share = rng.uniform(0.0, 1.0) if rng.random() < 0.5 else rng.uniform(0.75, 1.05)
        over = "over old" if number // len(KINDS) % 2 else "new"
        yield Case(f"{number}: {KINDS[number % len(KINDS)]}, {over}, {share:.3f}")


@cache
def earlier() -> tuple[Path, float]:
    """An earlier result, and the seconds that the fit took which is to be killed."""
    base = Path(mkdtemp(prefix="resfit-fuzz-old-"))
    check_code(run(fit_command(mesh_in(base, "tube"), base / "old"), base), STARTED)
    begin = time.monotonic()
    check_code(run(fit_command(mesh_in(base, "two"), base / "new"), base), STARTED)
    return base / "old", time.monotonic() - begin


def attempt(case: Case, folder: Path) -> str:
    """Start a fit, end it, and look at what is there."""
    kind, where, share = case.name.partition(": ")[2].split(", ")
    old, seconds = earlier()
    out = folder / "out"
    if where == "over old":
        shutil.copytree(old, out)
    process = start(fit_command(mesh_in(folder, "two"), out), folder)
    time.sleep(seconds * float(share))
    children = descendants(process.pid)
    over = process.poll() is not None
    if not over:
        process.send_signal(getattr(signal, kind.partition(" ")[0]))
        if kind.endswith("twice"):
            time.sleep(0.15)
            process.send_signal(signal.SIGINT)
    done = ended(process)
    if kind == "SIGKILL" and not over:
        if done.code not in (0, -signal.SIGKILL):
            raise Wrong(f"killed, it ended with {done.code}")
    else:
        check_said(done)
        if done.code not in STOPPED:
            raise Wrong(f"exit code {done.code}: {done.tail}")
        if leftovers(folder):
            raise Wrong(f"it left {leftovers(folder)}")
    wait_for(children)
    state = state_of(out, old if where == "over old" else None)
    if done.code in (0, 4) and state != "new" and "stopped" not in done.err:
        raise Wrong(f"exit code {done.code}, but the result is {state}")
    if leftovers(folder):
        check_code(run(fit_command(folder / "two.stl", out), folder), STARTED)
        check_whole(out)
    return state


def wait_for(processes: list[int], seconds: float = 10.0) -> None:
    """Wait until these have ended; their parent is gone."""
    end = time.monotonic() + seconds
    while alive := [number for number in processes if is_alive(number)]:
        if time.monotonic() > end:
            raise Wrong(f"{len(alive)} processes live on after {seconds:g} s")
        time.sleep(0.1)


def is_alive(process: int) -> bool:
    """Whether a process is there and is no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text(errors="replace").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def state_of(out: Path, old: Path | None) -> str:
    """Absent, old or new.

    Raises:
        Wrong: if it is none of them.
    """
    found = digests(out) if out.exists() else {}
    if old is not None and found == digests(old):
        return "old"
    if not found and old is None:
        return "absent"
    check_whole(out)
    if old is not None:
        same = sorted(name for name, value in digests(old).items() if found.get(name) == value)
        if same:
            raise Wrong(f"a mixture: {same} are the old ones")
    return "new"


CAMPAIGN = Campaign("kills", cases, attempt, hang_s=120.0)
