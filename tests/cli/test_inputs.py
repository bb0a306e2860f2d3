"""What paths on a command line stand for, and what to call where another command was meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from resfit.cli.inputs import assembly_file, check_mesh
from resfit.errors import InputError


def fit_in(folder: Path) -> Path:
    """A folder that holds a fit, as far as its names tell."""
    folder.mkdir()
    (folder / "assembly.json").write_text("{}")
    (folder / "report.json").write_text('{"format": "resfit-report", "version": 1}')
    return folder


def told(check, path: Path) -> str:
    with pytest.raises(InputError) as caught:
        check(path)
    return str(caught.value)


def test_folders_are_no_meshes(tmp_path: Path) -> None:
    folder = tmp_path / "my meshes"
    folder.mkdir()
    assert told(check_mesh, folder) == f"'{folder}' is a folder without a mesh in it; give mesh files."
    (folder / "a.stl").write_text("solid")
    assert f"is a folder with 1 mesh in it; call resfit fit '{folder}'/*.stl, or" in told(check_mesh, folder)
    (folder / "b.obj").write_text("v")
    (folder / "c.STL").write_text("solid")
    said = told(check_mesh, folder)
    assert (
        "with 3 meshes in it" in said
        and f"fit '{folder}'/*.STL '{folder}'/*.obj '{folder}'/*.stl, or" in said
    )


def test_files_that_are_no_meshes(tmp_path: Path) -> None:
    mesh = tmp_path / "a.stl"
    assert told(check_mesh, mesh) == f"there is no file '{mesh}'; check the path."
    mesh.touch()
    assert told(check_mesh, mesh) == f"'{mesh}' is empty (0 bytes); export or download it again."
    mesh.write_text("solid")
    check_mesh(mesh)


def test_an_assembly_by_its_file_or_its_folder(tmp_path: Path) -> None:
    folder = fit_in(tmp_path / "a.resfit")
    assert assembly_file(folder) == folder / "assembly.json" == assembly_file(folder / "assembly.json")
    # Whether a file is there is asked by who reads it.
    assert assembly_file(tmp_path / "none.json") == tmp_path / "none.json"
    assert "holds no assembly.json" in told(assembly_file, tmp_path)
    mesh = tmp_path / "b.stl"
    mesh.write_text("solid")
    assert told(assembly_file, mesh) == (
        f"'{mesh}' is a mesh, not an assembly; call resfit fit {mesh} first, and then give b.resfit."
    )
