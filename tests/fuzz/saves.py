"""Saving a fit: every moment of it, as a kill would leave it; leftovers, races and long names.

The folder is copied before each file operation of a save. Wrong: a copy that is neither without a fit, nor the whole
old one, nor the whole new one.
"""

from __future__ import annotations

import os
import random
import shutil
import sys
import threading
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest import mock

from fuzz.campaigns import shuffled
from fuzz.commands import FILES, digests, leftovers
from fuzz.harness import Campaign, Case, Wrong

if TYPE_CHECKING:
    from resfit.result.fit_result import FitResult

EVENTS = {
    "os.rename", "os.remove", "os.mkdir", "os.rmdir", "shutil.rmtree", "open", "os.link", "os.symlink", "ctypes.dlsym",
}  # fmt: skip
"""What audit hooks are told of; a call into the C library may be an exchange of folders."""

EMOJI = "\U0001f984"


class Recorder:
    """Copies a tree before each operation in it."""

    def __init__(self) -> None:
        """Audit hooks stay for good: one for all recordings."""
        self._root = ""
        self._copies = Path()
        self._names: list[str] = []
        sys.addaudithook(self._hook)

    def record(self, root: Path, copies: Path, action: Callable[[], object]) -> list[str]:
        """Do something; the operations in `root` that it took, each with a copy below `copies`."""
        copies.mkdir()
        self._root, self._copies, self._names = str(root), copies, []
        try:
            action()
        finally:
            self._root = ""
        return self._names

    def _hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        root = self._root
        if not root or event not in EVENTS:
            return
        paths = [
            os.fsdecode(value) for value in arguments[:2] if isinstance(value, str | bytes | os.PathLike)
        ]
        if event != "ctypes.dlsym" and not any(path.startswith(root) for path in paths):
            return
        if event == "open" and not (
            isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR)
        ):
            return
        # Copying takes operations too.
        self._root = ""
        try:
            shutil.copytree(root, self._copies / f"{len(self._names):03d}", symlinks=True)
            self._names.append(f"{event} {' -> '.join(path.removeprefix(root) for path in paths)}")
        finally:
            self._root = root


recorder = cache(Recorder)


@cache
def results() -> dict[str, FitResult]:
    """Three small fits."""
    import trimesh

    import resfit

    def fit(shape: trimesh.Trimesh, pareto: bool) -> FitResult:
        return resfit.fit(shape, preset="fast", max_primitives=2, rounds=1, device="cpu", pareto=pareto)

    box, ball = trimesh.creation.box((1, 2, 3)), trimesh.creation.icosphere()
    return {"box": fit(box, False), "ball": fit(ball, False), "ball with trade-off": fit(ball, True)}


def judge(folder: Path, old: dict[str, str], new: dict[str, str]) -> str:
    """What is wrong with a folder, nothing if it holds no fit, the old one or the new one."""
    from resfit.result.folder import holds_fit

    if not folder.is_dir() or not holds_fit(folder):
        return ""
    found = digests(folder)
    times = "report.json"
    if found == old:
        return ""
    if {k: v for k, v in found.items() if k != times} == {k: v for k, v in new.items() if k != times}:
        return "" if found[times] != old.get(times) else "the report is the old one"
    kinds = {
        name: "old" if old.get(name) == value else "new" if new.get(name) == value else "?"
        for name, value in found.items()
    }
    return f"a mixture {kinds}, without {sorted(set(new) - set(found))}"


def every_moment(folder: Path, old: str, new: str) -> None:
    """Save one result over another, or where nothing is."""
    found = results()
    new_files = digests(found[new].save(folder / "new" / "r.resfit"))
    old_files = digests(found[old].save(folder / "tree" / "r.resfit")) if old else {}
    (folder / "tree").mkdir(exist_ok=True)
    target, copies = folder / "tree" / "r.resfit", folder / "copies"
    names = recorder().record(folder / "tree", copies, lambda: found[new].save(target))
    wrong = {
        name: judge(copies / f"{number:03d}" / "r.resfit", old_files, new_files)
        for number, name in enumerate(names)
    }
    if len(names) < len(FILES):
        raise Wrong(f"only {len(names)} moments were seen: files are written otherwise now")
    bad = {name: said for name, said in wrong.items() if said}
    if bad:
        raise Wrong(f"{len(bad)} of {len(names)} moments; before {next(iter(bad.items()))}")
    if judge(target, {}, new_files) or leftovers(folder / "tree"):
        raise Wrong(f"after the save: {judge(target, {}, new_files)} {leftovers(folder / 'tree')}")


def fill(folder: Path, text: str = "x") -> None:
    """Save a stand-in for a fit."""
    from resfit.result.folder import OURS, filling

    with filling(folder) as temporary:
        for name in OURS:
            (temporary / name).write_text('{"format": "resfit-report"}' if name == "report.json" else text)


def stale(folder: Path) -> None:
    """A killed run of the same process number left its temporary folder."""
    from resfit.result.folder import check_folder

    (folder / f".a.resfit-{os.getpid()}.tmp").mkdir()
    check_folder(folder / "a")
    fill(folder / "a")


def stale_within(folder: Path) -> None:
    """The same within an earlier result."""
    fill(folder / "a")
    (folder / "a" / f"..resfit-{os.getpid()}.tmp").mkdir()
    fill(folder / "a", "y")


def race(folder: Path) -> None:
    """Another process writes the same new folder meanwhile."""
    from resfit.result.folder import filling

    with filling(folder / "a") as mine:
        (mine / "report.json").write_text('{"format": "resfit-report"}')
        with mock.patch("os.getpid", lambda: 1):
            fill(folder / "a")


def threads(folder: Path) -> None:
    """Four threads save to the same folder, and to folders whose names begin alike."""
    errors: list[Exception] = []
    gate = threading.Barrier(4)

    def save(number: int) -> None:
        try:
            gate.wait()
            for name in ("a", f"{'x' * 60}{number}", "a"):
                fill(folder / name)
        except Exception as error:
            errors.append(error)

    team = [threading.Thread(target=save, args=(number,)) for number in range(4)]
    for thread in team:
        thread.start()
    for thread in team:
        thread.join()
    if errors:
        raise Wrong(f"{len(errors)} of 4 threads failed: {errors[0]}")


def alike(folder: Path) -> None:
    """Two saves at once to folders whose names begin with the same 60 letters."""
    from resfit.result.folder import filling

    with filling(folder / ("x" * 60 + "1")) as mine:
        (mine / "report.json").write_text("{}")
        fill(folder / ("x" * 60 + "2"))


def emptied(folder: Path) -> None:
    """The earlier result is removed meanwhile."""
    from resfit.result.folder import filling

    fill(folder / "a")
    with filling(folder / "a") as mine:
        (mine / "report.json").write_text("{}")
        for path in (folder / "a").iterdir():
            if path.is_file():
                path.unlink()


def taken(folder: Path) -> None:
    """Somebody makes the folder meanwhile, with a file of theirs: it stays."""
    from resfit.errors import InputError
    from resfit.result.folder import filling

    theirs = folder / "a" / "mine.txt"
    try:
        with filling(folder / "a") as mine:
            (mine / "report.json").write_text("{}")
            theirs.parent.mkdir()
            theirs.write_text("mine")
    except InputError:
        pass
    if theirs.read_text() != "mine":
        raise Wrong("the file of somebody else is not what it was")


def named(name: str) -> Callable[[Path], None]:
    """A folder's name that just fits."""

    def save(folder: Path) -> None:
        from resfit.result.folder import check_folder

        check_folder(folder / name)
        fill(folder / name)
        fill(folder / name, "y")

    return save


ACTIONS: dict[str, Callable[[Path], None]] = {
    "every moment, to a new folder": lambda folder: every_moment(folder, "", "ball"),
    "every moment, over another": lambda folder: every_moment(folder, "box", "ball"),
    "every moment, a trade-off over none": lambda folder: every_moment(folder, "box", "ball with trade-off"),
    "every moment, none over a trade-off": lambda folder: every_moment(folder, "ball with trade-off", "box"),
    **{action.__name__: action for action in (stale, stale_within, race, threads, alike, emptied, taken)},
    "name of 255 letters": named("x" * 255),
    "name of 63 emoji": named(EMOJI * 63),
    "name of 85 CJK letters": named("日" * 85),
}


def cases(rng: random.Random) -> Iterator[Case]:
    """All of them once."""
    return shuffled(rng, [Case(name) for name in ACTIONS])


def attempt(case: Case, folder: Path) -> None:
    """One of them; no save may fail but for what the case does."""
    from resfit.errors import InputError

    try:
        ACTIONS[case.name](folder)
    except InputError as error:
        raise Wrong(f"the save was refused: {error}") from error
    left = [name for name in leftovers(folder) if not case.name.startswith(("every", "stale"))]
    if left:
        raise Wrong(f"it left {left}")


CAMPAIGN = Campaign("saves", cases, attempt, hang_s=120.0)
