"""Filling the folder of a fit: at every moment it is absent, old or new, and nobody loses anything."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from resfit.assembly.temporary import is_temporary, temporary_name
from resfit.errors import InputError
from resfit.result import folder as folder_module
from resfit.result.exchange import exchange, locked
from resfit.result.folder import BEGUN, OURS, PARETO, check_folder, filling, holds_fit

REPORT_TEXT = '{"format": "resfit-report", "is": "%s"}'
OPERATIONS = {"os.rename", "os.remove", "os.mkdir", "os.rmdir", "open"}


def fill(folder: Path, text: str = "x", pareto: bool = False) -> None:
    with filling(folder) as temporary:
        write(temporary, text, pareto)


def write(folder: Path, text: str, pareto: bool = False) -> None:
    for name in (*OURS, *(PARETO if pareto else ())):
        (folder / name).write_text(REPORT_TEXT % text if name == "report.json" else text)
    if pareto:
        (folder / "pareto").mkdir()
        (folder / "pareto" / "assembly_01.json").write_text(text)


def content(folder: Path) -> dict[str, str]:
    """Texts of all files by name, those of temporary folders left out."""
    return {
        str(path.relative_to(folder)): path.read_text()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not any(is_temporary(part) for part in path.relative_to(folder).parts)
    }


def left_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*") if is_temporary(path.name))


Look = Callable[[], None]
_looks: list[Look] = []


def _hook(event: str, arguments: tuple) -> None:
    if event in OPERATIONS and _looks:
        look = _looks.pop()
        look()
        _looks.append(look)


@contextmanager
def before_each_operation(look: Look) -> Iterator[None]:
    """Within, `look` is called before each operation on files, but not for its own."""
    if not getattr(_hook, "added", False):
        # There is no way to take one away again.
        sys.addaudithook(_hook)
        _hook.added = True  # type: ignore[attr-defined]
    _looks.append(look)
    try:
        yield
    finally:
        _looks.clear()


@pytest.mark.parametrize("pareto", [False, True])
@pytest.mark.parametrize("exchanges", [True, False])
@pytest.mark.parametrize("foreign", [False, True])
def test_at_every_moment_old_or_new_or_no_fit_but_ours(
    exchanges: bool, foreign: bool, pareto: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not exchanges:
        monkeypatch.setattr(folder_module, "exchange", lambda one, other: False)
    root = tmp_path / "tree"
    fill(root / "fit", "old", pareto)
    if foreign:
        (root / "fit" / "mine.txt").write_text("mine")
    old = content(root / "fit")
    copies: list[Path] = []

    def copy() -> None:
        copies.append(tmp_path / f"copy_{len(copies)}")
        shutil.copytree(root, copies[-1])

    with before_each_operation(copy):
        fill(root / "fit", "new")
    new = content(root / "fit")
    assert set(new) == {*OURS, *(["mine.txt"] if foreign else [])} and new["parts.glb"] == "new"
    assert left_in(root) == [] and len(copies) > 15
    states = []
    for place in copies:
        found = content(place / "fit")
        states.append("old" if found == old else "new" if found == new else "mixture")
        assert found.get("mine.txt") == old.get("mine.txt")
        if states[-1] == "mixture":
            assert not holds_fit(place / "fit")
        fill(place / "fit", "third")
        assert set(content(place / "fit").values()) <= {"third", REPORT_TEXT % "third", "mine"}
        assert set(content(place / "fit")) == set(new)
    assert states[0] == "old" and states == sorted(states, key=["old", "mixture", "new"].index)
    if foreign or not exchanges:
        assert "mixture" in states
    elif exchange_works(tmp_path):
        assert "mixture" not in states and "new" in states


def exchange_works(folder: Path) -> bool:
    (folder / "one").mkdir()
    (folder / "two").mkdir()
    return exchange(folder / "one", folder / "two")


def test_a_new_folder_is_absent_or_whole(tmp_path: Path) -> None:
    states: set[frozenset[str]] = set()

    def look() -> None:
        folder = tmp_path / "deep" / "fit"
        states.add(frozenset(content(folder)) if folder.exists() else frozenset("absent"))

    with before_each_operation(look):
        fill(tmp_path / "deep" / "fit")
    assert states == {frozenset("absent"), frozenset(OURS)} or states == {frozenset("absent")}
    # As folders usually are, not as private as temporary ones.
    (tmp_path / "plain").mkdir()
    assert (tmp_path / "deep" / "fit").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_failure_in_between_leaves_a_folder_of_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(tmp_path / "fit", "old")
    (tmp_path / "fit" / "mine.txt").write_text("mine")
    replace, calls = os.replace, []

    def full(source: Path, target: Path) -> None:
        calls.append(target)
        if len(calls) == 3:
            raise OSError(5, "Input/output error")
        replace(source, target)

    monkeypatch.setattr("resfit.result.folder.os.replace", full)
    with pytest.raises(InputError, match="Input/output error"):
        fill(tmp_path / "fit", "new")
    assert not holds_fit(tmp_path / "fit")
    check_folder(tmp_path / "fit")
    fill(tmp_path / "fit", "third")
    assert content(tmp_path / "fit")["mine.txt"] == "mine" and holds_fit(tmp_path / "fit")


@pytest.mark.parametrize("earlier", [False, True])
def test_several_at_once_all_end_well(earlier: bool, tmp_path: Path) -> None:
    if earlier:
        fill(tmp_path / "fit", "old")
    errors: list[BaseException] = []
    gate = threading.Barrier(8)

    def one(number: int) -> None:
        try:
            gate.wait()
            for _ in range(4):
                fill(tmp_path / "fit", f"of {number}", pareto=number % 2 == 0)
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=one, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == [] and left_in(tmp_path) == []
    found = content(tmp_path / "fit")
    assert len({text for name, text in found.items() if name != "report.json"}) == 1
    assert found["report.json"] == REPORT_TEXT % found["parts.glb"]


def test_a_folder_that_came_meanwhile_is_replaced(tmp_path: Path) -> None:
    with filling(tmp_path / "fit") as temporary:
        write(temporary, "second")
        fill(tmp_path / "fit", "first", pareto=True)
    assert set(content(tmp_path / "fit")) == set(OURS)
    assert content(tmp_path / "fit")["parts.glb"] == "second" and left_in(tmp_path) == []


def test_what_others_put_there_meanwhile_stays_and_the_fit_is_not_lost(tmp_path: Path) -> None:
    sentence = r"has come to hold other files meanwhile; the fit is in .*fit-2'"
    with pytest.raises(InputError, match=sentence), filling(tmp_path / "fit") as temporary:
        write(temporary, "new")
        (tmp_path / "fit").mkdir()
        (tmp_path / "fit" / "mine.txt").write_text("mine")
    assert content(tmp_path / "fit") == {"mine.txt": "mine"}
    assert set(content(tmp_path / "fit-2")) == set(OURS) and left_in(tmp_path) == []


def test_an_exchanged_folder_keeps_its_rights(tmp_path: Path) -> None:
    fill(tmp_path / "fit")
    (tmp_path / "fit").chmod(0o750)
    fill(tmp_path / "fit", "new")
    assert (tmp_path / "fit").stat().st_mode & 0o777 == 0o750


def test_the_current_folder_stays_the_same_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fill(tmp_path / "fit", "old")
    before = (tmp_path / "fit").stat().st_ino
    monkeypatch.chdir(tmp_path / "fit")
    fill(Path("."), "new")
    assert (tmp_path / "fit").stat().st_ino == before
    assert content(tmp_path / "fit")["parts.glb"] == "new" and left_in(tmp_path) == []


def test_a_link_to_a_folder_stays_a_link(tmp_path: Path) -> None:
    fill(tmp_path / "real" / "fit", "old")
    (tmp_path / "link").symlink_to(tmp_path / "real" / "fit")
    fill(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert content(tmp_path / "real" / "fit")["parts.glb"] == "new" and left_in(tmp_path) == []


@pytest.mark.parametrize("name", ["x" * 255, "\N{UNICORN FACE}" * 63, "日" * 85])
def test_long_names(name: str, tmp_path: Path) -> None:
    fill(tmp_path / name)
    fill(tmp_path / name, "new")
    assert content(tmp_path / name)["parts.glb"] == "new"


def test_a_check_leaves_nothing_and_meets_nothing(tmp_path: Path) -> None:
    seen: set[str] = set()
    with before_each_operation(lambda: seen.update(left_in(tmp_path))):
        check_folder(tmp_path / "fit")
    assert left_in(tmp_path) == [] and list(tmp_path.iterdir()) == []
    if hasattr(os, "O_TMPFILE"):
        assert seen == set()


def ended_process() -> int:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def named(process: int, place: str | None = None, stem: str = "fit") -> str:
    """The name of a temporary folder of a process here, or elsewhere."""
    begin, here, _, rest = temporary_name(stem).rsplit("-", 3)
    return f"{begin}-{place or here}-{process}-{rest}"


def test_only_what_nobody_works_on_is_removed(tmp_path: Path) -> None:
    elsewhere, ended = "0123abcd", ended_process()
    gone = [named(ended), named(ended, stem=""), f".fit.resfit-{ended}.tmp", named(1, elsewhere)]
    kept = [named(os.getppid()), named(os.getpid()), named(ended, elsewhere), f".fit.resfit-{ended + 1}.tmp"]
    others = [".mine.resfit-x.tmp", ".fit.tmp", f"{named(ended)}.d"[1:], ".resfit-1.tmp.bak"]
    for name in (*gone, *kept, *others):
        (tmp_path / name).mkdir()
        write(tmp_path / name, "left", pareto=True)
    for name in gone[2:]:
        os.utime(tmp_path / name, (1e9, 1e9))
    fill(tmp_path / "fit")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*kept, *others, "fit"])
    # What we cannot have written stays, whatever the name of the folder.
    left = tmp_path / named(ended)
    left.mkdir()
    (left / "thesis.doc").write_text("mine")
    fill(tmp_path / "fit")
    assert (left / "thesis.doc").read_text() == "mine"


def test_a_leftover_beside_makes_no_folder_ours(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    left = tmp_path / named(os.getppid())
    left.mkdir()
    write(left, "left")
    with pytest.raises(InputError, match="is not empty and holds no earlier fit"):
        check_folder(tmp_path)
    (left / BEGUN).touch()
    check_folder(tmp_path)


def test_a_lock_is_that_of_the_folder_which_is_there(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    order: list[str] = []

    def second() -> None:
        with locked(tmp_path / "a"):
            order.append("second")

    with locked(tmp_path / "a"):
        thread = threading.Thread(target=second)
        thread.start()
        exchange(tmp_path / "a", tmp_path / "b")
        with locked(tmp_path / "a"):
            order.append("first")
    thread.join()
    assert sorted(order) == ["first", "second"]
    with pytest.raises(FileNotFoundError), locked(tmp_path / "nowhere"):
        pass


def test_where_folders_cannot_change_places(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    assert not exchange(tmp_path / "a", tmp_path / "nowhere")
    assert (tmp_path / "a").is_dir()


@pytest.mark.parametrize("same_system", [False, True])
def test_a_mount_is_filled_from_within(
    same_system: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rename = os.rename

    def across(source: Path, target: Path) -> None:
        if Path(source).parent != Path(target).parent:
            raise OSError(errno.EXDEV, "Invalid cross-device link")
        rename(source, target)

    monkeypatch.setattr(folder_module, "_is_other_device", lambda folder: not same_system)
    monkeypatch.setattr(folder_module, "exchange", lambda one, other: False)
    monkeypatch.setattr("resfit.result.folder.os.rename", across)
    (tmp_path / "fit").mkdir()
    for text in ("first", "second"):
        with filling(tmp_path / "fit") as temporary:
            assert (temporary.parent == tmp_path / "fit") is not same_system
            write(temporary, text, pareto=text == "first")
        assert left_in(tmp_path) == [] and content(tmp_path / "fit")["parts.glb"] == text
    assert set(content(tmp_path / "fit")) == set(OURS)
