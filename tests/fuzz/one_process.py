"""One process: memory over many fits, threads at once, forked, spawned and other children, streams that are no files.

Wrong: memory, descriptors or threads that grow; other bytes than alone; a child that does not answer; settings of the
interpreter that stay changed.
"""

from __future__ import annotations

import gc
import json
import multiprocessing
import os
import random
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from fuzz.campaigns import shuffled
from fuzz.harness import Campaign, Case, Skip, Wrong

FITS, SETTLED = 24, 8
"""Fits in one process, and those after which memory should have settled."""

GROWTH_MB = 0.75
"""A fit; the noise of a hundred fits is below it."""

CHILD_SECONDS = 90.0


def fitted(number: int) -> bytes:
    """assembly.json of one of four small shapes."""
    import trimesh

    import resfit

    shapes = (
        lambda: trimesh.creation.box((1, 2, 3 + number % 3)),
        lambda: trimesh.creation.icosphere(subdivisions=2),
        lambda: trimesh.creation.annulus(0.4, 1.0, 0.5 + 0.1 * (number % 5)),
        lambda: trimesh.util.concatenate([trimesh.creation.box((1, 1, 3)), trimesh.creation.box((3, 1, 1))]),
    )
    return resfit.fit(
        shapes[number % 4](), preset="fast", max_primitives=4, seed=3, device="cpu"
    ).assembly.to_json()


def python(code: str, folder: Path) -> str:
    """What a fresh interpreter prints that may import this module."""
    path = f"import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r})\nimport fuzz.one_process as here\n"
    done = subprocess.run(
        [sys.executable, "-c", path + code],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    return done.stdout.strip() or f"exit code {done.returncode}: {done.stderr.strip()[-300:]}"


def measured() -> dict[str, float]:
    """What this process holds."""
    status = Path("/proc/self/status").read_text()
    resident = next(int(line.split()[1]) / 1024 for line in status.splitlines() if line.startswith("VmRSS:"))
    return {
        "MB": resident,
        "descriptors": len(os.listdir("/proc/self/fd")),
        "threads": len(os.listdir("/proc/self/task")),
        "objects": len(gc.get_objects()),
    }


def memory_rows() -> list[dict[str, float]]:
    """What a process holds after each of many fits."""
    rows = []
    for number in range(FITS):
        fitted(number)
        gc.collect()
        rows.append(measured())
    return rows


def memory(folder: Path) -> str:
    """Many fits, one after the other, in a fresh process."""
    import numpy as np

    answer = python("import json; print(json.dumps(here.memory_rows()))", folder)
    try:
        rows = json.loads(answer)
    except ValueError:
        raise Wrong(answer) from None
    settled = rows[SETTLED:]
    slope = float(np.polyfit(np.arange(len(settled)), [row["MB"] for row in settled], 1)[0])
    said = f"{slope:.2f} MB a fit, {rows[SETTLED]} to {rows[-1]}"
    if slope > GROWTH_MB or any(rows[-1][key] > rows[SETTLED][key] + 2 for key in ("descriptors", "threads")):
        raise Wrong(said)
    return said


def threads(folder: Path) -> str:
    """Two and four fits at once; the interpreter's settings afterwards."""
    alone = [fitted(number) for number in range(4)]
    interval, collecting = sys.getswitchinterval(), gc.isenabled()
    for group in ((0, 1), (2, 3), (0, 1, 2, 3)):
        found: dict[int, object] = {}

        def work(number: int, found: dict[int, object] = found) -> None:
            try:
                found[number] = fitted(number)
            except BaseException as error:
                found[number] = error

        team = [threading.Thread(target=work, args=(number,), daemon=True) for number in group]
        for thread in team:
            thread.start()
        for thread in team:
            thread.join(CHILD_SECONDS)
        wrong = [number for number in group if found.get(number) != alone[number]]
        if wrong:
            raise Wrong(
                f"of {len(group)} threads {len(wrong)} gave other bytes: {found.get(wrong[0])!r:.300}"
            )
    if (sys.getswitchinterval(), gc.isenabled()) != (interval, collecting):
        raise Wrong(f"the switch interval is {sys.getswitchinterval():g} s afterwards, not {interval:g}")
    return "same bytes"


def answer(pipe: Any) -> None:
    """What a child does."""
    try:
        pipe.send(fitted(0))
    except BaseException as error:
        pipe.send(repr(error))


def ask_child(method: str) -> bytes | str:
    """What a child that is started in this way answers."""
    context: Any = multiprocessing.get_context(method)
    near, far = context.Pipe()
    child = context.Process(target=answer, args=(far,), daemon=True)
    child.start()
    far.close()
    try:
        found = near.recv() if near.poll(CHILD_SECONDS) else f"no answer within {CHILD_SECONDS:g} s"
    except EOFError:
        found = "ended without an answer"
    child.kill()
    child.join()
    return found


def child_of(method: str, before: str) -> Callable[[Path], str]:
    """A child of a fresh process, after the parent has done something."""

    def check(folder: Path) -> str:
        code = f"if __name__ == '__main__':\n  {before}\n  found = here.ask_child({method!r})\n"
        code += "  print('same' if found == here.fitted(0) else repr(found)[:300])"
        said = python(code, folder)
        if said != "same":
            raise Wrong(f"a child by {method}: {said}")
        return said

    return check


def stream(change: str) -> Callable[[Path], str]:
    """A fit where the streams are not what they usually are, as in notebooks and services."""

    def check(folder: Path) -> str:
        code = (
            f"import io, os, sys, traceback\nkeep = os.dup(1)\n{change}\n"
            "try:\n  here.fitted(0); text = 'fine'\n"
            "except BaseException: text = traceback.format_exc()[-300:]\n"
            "os.write(keep, text.encode())"
        )
        said = python(code, folder)
        if said != "fine":
            raise Wrong(said)
        return said

    return check


def event_loop(folder: Path) -> str:
    """A fit in the thread of an event loop."""
    import asyncio

    async def fit() -> bytes:
        return await asyncio.to_thread(fitted, 0)

    if asyncio.run(fit()) != fitted(0):
        raise Wrong("other bytes")
    return "same bytes"


ACTIONS: dict[str, Callable[[Path], str]] = {
    "memory": memory,
    "threads": threads,
    "event loop": event_loop,
    "fork first": child_of("fork", "pass"),
    "fork after import": child_of("fork", "import resfit; resfit.Assembly"),
    "fork after a fit": child_of("fork", "here.fitted(0)"),
    "spawn after a fit": child_of("spawn", "here.fitted(0)"),
    "forkserver after a fit": child_of("forkserver", "here.fitted(0)"),
    "streams in memory": stream("sys.stdout, sys.stderr = io.StringIO(), io.StringIO()"),
    "streams None": stream("sys.stdout = sys.stderr = sys.stdin = None"),
    "descriptors closed": stream("[os.close(n) for n in (0, 1, 2)]"),
    "no arguments": stream("sys.argv = []"),
}


def cases(rng: random.Random) -> Iterator[Case]:
    """All of them once."""
    return shuffled(rng, [Case(name) for name in ACTIONS])


def attempt(case: Case, folder: Path) -> str:
    """One of them."""
    if "fork" in case.name and not hasattr(os, "fork"):
        raise Skip("no fork here")
    return ACTIONS[case.name](folder)


CAMPAIGN = Campaign("one-process", cases, attempt, hang_s=300.0)
