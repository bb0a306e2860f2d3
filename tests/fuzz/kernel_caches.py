"""Kernel caches: two processes that compile into one empty cache, one killed while it compiles, and damaged caches.

Wrong: another assembly than with a good cache; a damaged one may also be refused in one sentence.
Compiling all kernels takes a minute or two.
"""

from __future__ import annotations

import os
import random
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from fuzz.commands import check_code, check_whole, ended, fit_command, mesh_in, run, start
from fuzz.harness import Campaign, Case, Wrong
from resfit.errors import InputError

DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "cut short": lambda data: data[: len(data) // 2],
    "empty": lambda data: b"",
    "noise": lambda data: random.Random(len(data)).randbytes(len(data)),
    "one bit": lambda data: (
        data[: len(data) // 2] + bytes([data[len(data) // 2] ^ 4]) + data[len(data) // 2 + 1 :]
    ),
}
"""What a full disk or a crash may leave of a file; the first is the least."""

OBJECTS, DESCRIPTIONS = ("*.o",), ("*.meta",)


def cases(rng: random.Random) -> Iterator[Case]:
    """Those that compile first, one after the other: they share the machine badly."""
    yield Case("two at once, empty")
    yield Case("killed, then again")
    kinds = [f"{what}: {damage}" for what in ("objects", "descriptions") for damage in list(DAMAGE)[:3]]
    for kind in rng.sample(kinds, len(kinds)):
        yield Case(kind)


def attempt(case: Case, folder: Path) -> str:
    """Fit with such a cache."""
    mesh = mesh_in(folder, "two")
    check_code(run(fit_command(mesh, folder / "usual"), folder), (0,))
    cache = folder / "cache"
    environment = {"WARP_CACHE_PATH": str(cache)}
    if case.name.startswith("two"):
        team = [start(fit_command(mesh, folder / f"out{number}"), folder, environment) for number in (0, 1)]
        for done in [ended(process) for process in team]:
            check_code(done, (0,))
        check_same(folder, "out0")
        check_same(folder, "out1")
    elif case.name.startswith("killed"):
        process = start(fit_command(mesh, folder / "out"), folder, environment)
        time.sleep(6.0)
        process.kill()
        process.communicate()
    else:
        damage(cache, *case.name.split(": "))
    done = run(fit_command(mesh, folder / "again"), folder, environment)
    check_code(done, (0,) if " " in case.name.partition(":")[0] else (0, 2))
    if done.code == 2:
        raise InputError(done.err)
    check_same(folder, "again")
    return "same bytes"


def damage(cache: Path, what: str, how: str) -> None:
    """Copy the user's cache and damage files in it."""
    usual = Path(os.environ.get("WARP_CACHE_PATH") or warp_cache())
    shutil.copytree(usual, cache)
    found = [
        path for pattern in (OBJECTS if what == "objects" else DESCRIPTIONS) for path in cache.rglob(pattern)
    ]
    if not found:
        raise Wrong(f"there are no {what} in {usual}")
    for path in found:
        path.write_bytes(DAMAGE[how](path.read_bytes()))


def warp_cache() -> str:
    """Where Warp keeps kernels."""
    import warp

    from resfit.kernels.runtime.launch import start as start_warp

    start_warp()
    return str(warp.config.kernel_cache_dir)


def check_same(folder: Path, name: str) -> None:
    """The result is whole and the usual one."""
    check_whole(folder / name)
    found, usual = ((folder / out / "assembly.json").read_bytes() for out in (name, "usual"))
    if found != usual:
        raise Wrong("another assembly than with the usual cache")


CAMPAIGN = Campaign("kernel-caches", cases, attempt, hang_s=420.0, weight=3.0)
