"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from resfit.assembly import atomic_write
from resfit.assembly.atomic_write import replacing, write_bytes
from resfit.errors import InputError


def test_what_was_there_stays_until_all_is_written(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(b"old")
    with replacing(path) as temporary:
        # Some writers choose the format by the suffix.
        assert temporary.suffix == ".json" and temporary.parent == tmp_path
        temporary.write_bytes(b"new")
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new" and os.listdir(tmp_path) == ["a.json"]


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(b"old")
    with pytest.raises(ZeroDivisionError), replacing(path) as temporary:
        temporary.write_bytes(b"half")
        raise ZeroDivisionError
    assert path.read_bytes() == b"old" and os.listdir(tmp_path) == ["a.json"]


def test_a_full_disk_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Some file systems tell only when the file is to be on the disk."""

    def refuse(path: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(atomic_write, "sync", refuse)
    with pytest.raises(InputError, match=r"^cannot write .*a\.json: No space left on device"):
        write_bytes(tmp_path / "a.json", b"new")
    assert os.listdir(tmp_path) == []


def test_what_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="it is a folder"):
        write_bytes(tmp_path, b"")
    with pytest.raises(InputError, match=r"cannot write .*none.a\.json: No such file or directory"):
        write_bytes(tmp_path / "none" / "a.json", b"")
