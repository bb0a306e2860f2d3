"""Where compiled kernels go if Warp's cache cannot be written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from resfit.kernels.runtime import cache

CODE = (
    "from resfit.kernels.runtime.launch import start; start(); start();"
    "import warp; print(warp.config.kernel_cache_dir)"
)


def started(tmp_path: Path, **environment: str) -> tuple[str, str]:
    """The cache of a new process, and what it says on stderr."""
    done = subprocess.run(
        [sys.executable, "-c", CODE],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "TMPDIR": str(tmp_path), **environment},
    )
    return done.stdout.strip(), done.stderr


def test_a_cache_that_can_be_written_is_used(tmp_path: Path) -> None:
    folder, said = started(tmp_path, WARP_CACHE_PATH=str(tmp_path / "mine"))
    assert Path(folder).parent == tmp_path / "mine" and said == ""


@pytest.mark.skipif(os.name != "posix", reason="needs /dev/null")
def test_another_folder_is_used_and_said_once(tmp_path: Path) -> None:
    folder, said = started(tmp_path, WARP_CACHE_PATH="/dev/null/x")
    assert Path(folder).is_dir() and Path(folder).is_relative_to(tmp_path)
    assert said.count("\n") == 1 and said.startswith("resfit: the kernel cache '/dev/null/x/")
    assert "cannot be written" in said and folder in said
    # The next process finds what this one compiled.
    assert started(tmp_path, WARP_CACHE_PATH="/dev/null/x") == (folder, said)


@pytest.mark.skipif(os.name != "posix", reason="needs links")
def test_kernels_of_a_cache_that_can_only_be_read_are_used(tmp_path: Path) -> None:
    usual, folder = tmp_path / "usual", tmp_path / "folder"
    (usual / "wp_module").mkdir(parents=True)
    folder.mkdir()
    (folder / "wp_old").symlink_to(tmp_path / "gone")
    (usual / "wp_old").mkdir()
    for _ in range(2):
        cache._link_entries(usual, folder)
        assert sorted(path.name for path in folder.iterdir() if path.is_dir()) == ["wp_module", "wp_old"]
    cache._link_entries(tmp_path / "nowhere", folder)


@pytest.mark.skipif(os.name != "posix", reason="needs owners")
def test_a_folder_that_others_could_have_filled_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    first = cache._private_folder()
    assert first.stat().st_mode & 0o777 == 0o700 and cache._private_folder() == first
    first.chmod(0o777)
    assert cache._private_folder() != first
    first.rmdir()
    (tmp_path / "theirs").mkdir()
    first.symlink_to(tmp_path / "theirs")
    assert cache._private_folder() != first
