"""Options of compared methods, which come as text."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from resfit.errors import InputError
from resfit.eval.methods.options import optional_package, output_folder, read_options

DEFAULTS = {"count": 8, "threshold": 0.05, "path": ""}


def test_text_takes_the_type_of_the_default() -> None:
    assert read_options({}, DEFAULTS) == DEFAULTS
    chosen = read_options({"count": "12", "threshold": "1e-3", "path": 7}, DEFAULTS)
    assert chosen == {"count": 12, "threshold": 1e-3, "path": "7"} and type(chosen["count"]) is int


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"counts": 1}, "the method has no option counts; there are: count, threshold, path."),
        ({"count": "many"}, "option count is 'many'; it must be a whole number."),
        ({"count": "1.5"}, "option count is '1.5'; it must be a whole number."),
        ({"threshold": None}, "option threshold is None; it must be a number."),
    ],
)
def test_wrong_options(options: dict[str, object], sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        read_options(options, DEFAULTS)
    assert str(caught.value) == sentence


def test_folders_are_made(tmp_path: Path) -> None:
    assert output_folder(tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"cannot write to .*file.b: Not a directory\."):
        output_folder(tmp_path / "file" / "b")


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    assert optional_package("json").__name__ == "json"
    monkeypatch.setitem(sys.modules, "coacd", None)
    with pytest.raises(
        InputError, match=r"^the package coacd is not installed; call .*'coacd>=.*to get it\.$"
    ):
        optional_package("coacd")
