"""A mesh that another process reads: the same mesh, the same errors, and no process left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh

import resfit
from resfit.errors import InputError, StoppedError
from resfit.shape import background_load
from resfit.shape.background_load import MeshReader, reading
from resfit.shape.load import load_mesh
from resfit.shape.reading import machine_memory


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    path = tmp_path / "box.obj"
    trimesh.creation.box((1.0, 2.0, 3.0)).export(path)
    return path


def assert_gone(process: int) -> None:
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


def test_reads_what_load_mesh_reads(mesh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # On one core too.
    monkeypatch.setenv("RESFIT_THREADS", "1")
    expected = load_mesh(mesh)
    with reading(mesh) as source:
        assert isinstance(source, MeshReader)
        assert Path(source) == mesh
        # Here it must not be read: that is the other process's work.
        monkeypatch.setattr("resfit.shape.load.read_mesh_file", None)
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


@pytest.mark.parametrize(
    ("code", "part"),
    [
        (
            "import os, signal; os.kill(os.getpid(), signal.SIGKILL)",
            "was killed, as happens where memory runs out",
        ),
        ("import os; os.abort()", "crashed (SIGABRT)"),
    ],
)
def test_the_end_of_the_other_process_is_an_error_that_names_the_file(
    code: str, part: str, mesh: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(background_load, "CODE", code)
    # What ended the other process is not tried here.
    monkeypatch.setattr("resfit.shape.load.read_mesh_file", None)
    with pytest.raises(InputError) as found:
        load_mesh(MeshReader(mesh))
    assert str(mesh) in str(found.value) and part in str(found.value)


def test_defects_of_the_other_process_are_told_with_their_traceback(
    mesh: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = "from resfit.shape import load, reading; load.load_mesh = lambda path: {}[path]; "
    monkeypatch.setattr(background_load, "CODE", code + "reading.read_for_parent()")
    with pytest.raises(RuntimeError, match="KeyError while reading") as found:
        load_mesh(MeshReader(mesh))
    assert "_pickled_mesh" in found.value.__notes__[0]
    monkeypatch.setattr(background_load, "CODE", "raise SystemExit(3)")
    with pytest.raises(RuntimeError, match="exit code 3"):
        load_mesh(MeshReader(mesh))


def test_memory_is_limited(mesh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = (
        "from resfit.shape import load, reading; reading.machine_memory = lambda: 400_000_000;"
        "load.load_mesh = lambda path: bytearray(500_000_000); reading.read_for_parent()"
    )
    monkeypatch.setattr(background_load, "CODE", code)
    with pytest.raises(InputError) as found:
        load_mesh(MeshReader(mesh))
    assert f"reading '{mesh}' takes more than 0.3 GB of memory" in str(found.value)


def test_memory_of_this_machine() -> None:
    assert machine_memory() > 500_000_000


def test_nobody_is_left_reading(mesh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background_load, "CODE", "import time; time.sleep(600)")
    with pytest.raises(InputError), reading(mesh) as source:
        raise InputError("an option is wrong")
    assert_gone(source._process.pid)


def test_nobody_reads_on_when_the_parent_is_gone(mesh: Path) -> None:
    code = (
        "import os, sys\nfrom resfit.shape import background_load as reader\n"
        "reader.CODE = 'from resfit.shape.reading import _end_with_parent; _end_with_parent();'\\\n"
        "    'print(1, flush=True); import time; time.sleep(600)'\n"
        "child = reader.MeshReader(sys.argv[1])._process\nchild.stdout.read(1)\nprint(child.pid)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(mesh)], capture_output=True, text=True, check=True, timeout=60
    )
    for _ in range(500):
        if not Path(f"/proc/{int(done.stdout)}").exists():
            return
        time.sleep(0.01)
    pytest.fail("it reads on")


def test_stopping_ends_the_reading(mesh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background_load, "CODE", "import time; time.sleep(600)")
    with pytest.raises(StoppedError) as found, reading(mesh, lambda: True) as source:
        load_mesh(source)
    assert str(found.value) == "stopped before the mesh was read; nothing was written."
    assert found.value.exit_code == 4
    assert_gone(source._process.pid)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_ends_a_reading(number: int, mesh: Path, tmp_path: Path) -> None:
    code = (
        "import sys\nfrom resfit.shape import background_load as reader\nreader.CODE = 'import time; time.sleep(600)'\n"
        "from resfit.cli import main\nsys.exit(main(sys.argv[1:]))"
    )
    command = [
        sys.executable,
        "-c",
        code,
        "fit",
        str(mesh),
        "-o",
        str(tmp_path / "fit"),
        "--progress",
        "json",
    ]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if '"stage": "load"' in line:
                break
        process.send_signal(number)
        said = process.stderr.read()
    assert process.returncode == 4
    assert said.endswith("resfit: stopped before the mesh was read; nothing was written.\n")
    assert not (tmp_path / "fit").exists()


def test_fit_stops_a_reading(mesh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background_load, "CODE", "import time; time.sleep(600)")
    monkeypatch.setattr("resfit.api.READING_SECONDS", 0.0)
    with pytest.raises(StoppedError):
        resfit.fit(mesh, device="cpu", timeout=0.1)
    with pytest.raises(StoppedError):
        resfit.fit(str(mesh), device="cpu", should_stop=lambda: True)
    with pytest.raises(StoppedError), reading(mesh) as source:
        resfit.fit(source, device="cpu", should_stop=lambda: True)


def test_only_what_is_a_path_is_read_elsewhere() -> None:
    box = trimesh.creation.box()
    with reading(box) as source:
        assert source is box


def test_pipes_and_devices_are_no_meshes(tmp_path: Path) -> None:
    path = tmp_path / "pipe.stl"
    os.mkfifo(path)
    with pytest.raises(InputError, match=r"pipe\.stl' is a pipe or device"):
        load_mesh(path)
    (tmp_path / "null.stl").symlink_to("/dev/zero")
    with pytest.raises(InputError, match="is a pipe or device"):
        load_mesh(tmp_path / "null.stl")


def test_a_process_that_cannot_be_started(mesh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background_load, "python_command", lambda *arguments: ["/nonexistent/python"])
    with pytest.raises(InputError) as found:
        MeshReader(mesh)
    assert str(found.value).startswith(f"'{mesh}' cannot be read in a process of its own: No such file")
