"""A mesh that another process reads: the same mesh, the same errors, and no process left behind."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh

from resfit.errors import InputError
from resfit.target import reader
from resfit.target.load import load_mesh
from resfit.target.reader import MeshReader, reading_ahead


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    path = tmp_path / "box.obj"
    trimesh.creation.box((1.0, 2.0, 3.0)).export(path)
    return path


def assert_gone(process: int) -> None:
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


def test_reads_what_load_mesh_reads(mesh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RESFIT_THREADS", "2")
    expected = load_mesh(mesh)
    with reading_ahead(mesh) as source:
        assert isinstance(source, MeshReader)
        assert Path(source) == mesh
        # Here it must not be read: that is the other process's work.
        monkeypatch.setattr("resfit.target.load.read_mesh_file", None)
        found = load_mesh(source)
    assert_gone(source._process.pid)
    assert np.array_equal(found.vertices, expected.vertices)
    assert np.array_equal(found.faces, expected.faces)
    assert (found.sha256, found.parts, found.notes) == (expected.sha256, expected.parts, expected.notes)


def test_errors_are_those_of_load_mesh(tmp_path: Path) -> None:
    path = tmp_path / "broken.ply"
    path.write_bytes(b"no mesh")
    with pytest.raises(InputError) as expected:
        load_mesh(path)
    with pytest.raises(InputError) as found:
        load_mesh(MeshReader(path))
    assert str(found.value) == str(expected.value)


def test_reads_itself_where_the_other_process_fails(mesh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "CODE", "raise SystemExit(3)")
    assert len(load_mesh(MeshReader(mesh)).faces) == 12


def test_nobody_is_left_reading(mesh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "CODE", "import time; time.sleep(600)")
    monkeypatch.setenv("RESFIT_THREADS", "2")
    with pytest.raises(InputError), reading_ahead(mesh) as source:
        assert isinstance(source, MeshReader)
        raise InputError("an option is wrong")
    assert_gone(source._process.pid)


def test_one_core_reads_for_itself(mesh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RESFIT_THREADS", "1")
    with reading_ahead(mesh) as source:
        assert source == mesh
