"""Streams that are closed, full, read by nobody, or ASCII only: the exit code tells what became of the result."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh

from resfit.cli import terminal

RESFIT = f"{Path(sys.executable).with_name('resfit')}"
FULL = Path("/dev/full")

needs_full = pytest.mark.skipif(not FULL.exists(), reason="no /dev/full here")


def shell(command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """A command of bash, in which `resfit` is this one."""
    return subprocess.run(
        ["bash", "-c", command.replace("resfit ", f"'{RESFIT}' ", 1)],
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
        timeout=120,
        env={**os.environ, **environment},
    )


@pytest.fixture
def box(tmp_path: Path) -> Path:
    path = tmp_path / "box.stl"
    trimesh.creation.box((1.0, 2.0, 3.0)).export(path)
    return path


@needs_full
def test_what_cannot_be_written_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(terminal, "_lost", [])
    with FULL.open("w") as full:
        stream = terminal._guarded(full, full.fileno())
        stream.write("Stühle\n" * 10_000)
        stream.flush()
    assert terminal._lost == []


def test_letters_that_a_stream_lacks_are_escaped(tmp_path: Path) -> None:
    with (tmp_path / "out").open("w", encoding="ascii") as file:
        stream = terminal._guarded(file, file.fileno())
        stream.write("Stühle \udcff\n")
        stream.flush()
    assert (tmp_path / "out").read_text() == "St\\xfchle \\udcff\n"


def test_streams_of_others_stay() -> None:
    stream = io.StringIO()
    assert terminal._guarded(stream, 1) is stream


@pytest.mark.parametrize("redirection", ["2>&-", "2>/dev/full", "2> >(head -c0)"])
def test_a_complaint_that_nobody_hears_keeps_its_exit_code(redirection: str) -> None:
    done = shell(f"resfit fit missing.stl {redirection}")
    assert (done.returncode, done.stdout) == (2, "")


@pytest.mark.parametrize(
    ("redirection", "reason"), [(">&-", "it is closed"), (">/dev/full", "no space left on device")]
)
def test_a_printed_result_that_is_lost_is_no_success(redirection: str, reason: str) -> None:
    done = shell(f"resfit --version {redirection}")
    assert done.returncode == 2
    assert done.stderr == f"resfit: the result could not be written to the standard output: {reason}.\n"


def test_a_reader_who_has_seen_enough_is_no_failure() -> None:
    done = shell("resfit fit --help | head -c0; exit ${PIPESTATUS[0]}")
    assert (done.returncode, done.stderr) == (0, "")


@needs_full
@pytest.mark.parametrize(
    "redirection",
    [
        "<&- >&- 2>&-",
        "--progress json >/dev/full 2>/dev/full",
        "--progress json > >(head -c0) 2> >(head -c0)",
    ],
)
def test_a_fit_is_written_whoever_listens(redirection: str, box: Path, tmp_path: Path) -> None:
    folder = tmp_path / "Stühlé日本"
    done = shell(
        f"resfit fit {box} -o {folder} --preset fast --device cpu {redirection}", PYTHONIOENCODING="ascii"
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert json.loads((folder / "report.json").read_text())["metrics"]["primitive_count"] == 1


def test_a_summary_in_ascii(box: Path, tmp_path: Path) -> None:
    done = shell(
        f"resfit fit {box} -o {tmp_path / 'Stühlé'} --preset fast --device cpu", PYTHONIOENCODING="ascii"
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "St\\xfchl\\xe9/ assembly.json" in done.stdout


def test_a_name_in_another_encoding(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"St\xfchle.stl")
    trimesh.creation.box((1.0, 2.0, 3.0)).export(tmp_path / "box.stl")
    (tmp_path / "box.stl").rename(path)
    arguments = [RESFIT, "fit", os.fsencode(path), "-o", str(tmp_path / "fit"), "--preset", "fast"]
    done = subprocess.run(arguments, capture_output=True, check=False, timeout=120)
    assert (done.returncode, done.stderr) == (0, b"")
    assert json.loads((tmp_path / "fit" / "report.json").read_text())["input"]["name"] == "St\ufffdhle.stl"


def test_too_little_memory_is_one_sentence(box: Path, tmp_path: Path) -> None:
    done = shell(f"ulimit -v 600000; resfit fit {box} -o {tmp_path / 'fit'} --preset fast --device cpu")
    assert done.returncode == 2
    assert done.stderr.startswith("resfit: this process may use 0.6 GB of memory (ulimit -v)")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "fit").exists()


def test_names_cannot_command_a_terminal_or_forge_lines() -> None:
    from resfit.cli.terminal import printable

    assert printable("a\x1b]0;x\x07\n\u202eb.stl") == r"a\x1b]0;x\x07\n\u202eb.stl"
    assert printable("Stühle 椅子.glb: 3 parts") == "Stühle 椅子.glb: 3 parts"
