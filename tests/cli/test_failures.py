"""Exit codes of what a command may raise, and the one sentence that is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from resfit.cli.failures import DEFECT, UNUSABLE, answered, complain
from resfit.errors import DeviceError, InputError


def raising(error: BaseException):
    def run() -> int:
        raise error

    return run


def test_what_a_command_returns_is_its_exit_code(capsys: pytest.CaptureFixture[str]) -> None:
    assert answered(lambda: 3) == 3
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("error", [InputError("'a.stl' is empty."), DeviceError("there is no GPU.")])
def test_an_error_of_ours_is_one_sentence(error: Exception, capsys: pytest.CaptureFixture[str]) -> None:
    assert answered(raising(error)) == UNUSABLE == 2
    assert capsys.readouterr().err == f"resfit: {error}\n"


def test_lack_of_memory_is_no_defect(capsys: pytest.CaptureFixture[str]) -> None:
    assert answered(raising(MemoryError())) == UNUSABLE
    assert "not enough memory" in capsys.readouterr().err


def test_a_defect_writes_a_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert answered(raising(ZeroDivisionError("by zero"))) == DEFECT
    said = capsys.readouterr().err
    assert said.startswith("resfit: this is a defect of resfit (ZeroDivisionError): by zero; the log is ")
    (log,) = tmp_path.iterdir()
    assert str(log) in said and "in run\n" in log.read_text() and "Traceback" not in said
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "none"))
    answered(raising(ZeroDivisionError()))
    assert "the log is lost, because no temporary file can be written" in capsys.readouterr().err


def test_ctrl_c_goes_through() -> None:
    with pytest.raises(KeyboardInterrupt):
        answered(raising(KeyboardInterrupt()))


def test_a_sentence_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert complain("one\ntwo\t three", 4) == 4
    assert capsys.readouterr().err == "resfit: one two three\n"
