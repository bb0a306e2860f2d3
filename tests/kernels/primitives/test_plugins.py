"""A family from one file outside the package: fitted, saved, loaded, exported and shown like those within."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from resfit.errors import AssemblyError
from resfit.kernels.primitives import FAMILIES, register
from resfit.kernels.primitives.plugins import outside_families

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "examples" / "hexagonal_prism.py"


def run(*arguments: object, families: str = str(EXAMPLE), folder: Path) -> subprocess.CompletedProcess[str]:
    """Python in a process of its own, which alone knows the families of the files."""
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        capture_output=True,
        text=True,
        env={**os.environ, "RESFIT_FAMILIES": families},
        cwd=folder,
        check=False,
        timeout=300,
    )


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a fit of a slanted hexagonal frustum."""
    folder = tmp_path_factory.mktemp("prism")
    angles = (np.arange(6) + 0.5) * np.pi / 3.0
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(6)], axis=1)
    solid = trimesh.convex.convex_hull(np.concatenate([ring, 0.6 * ring + [0.0, 0.0, 1.6]]))
    solid.apply_transform(trimesh.transformations.rotation_matrix(0.4, [1.0, 2.0, 3.0]))
    solid.export(folder / "prism.stl")
    options = ["--primitive", "hexagonal_prism", "--preset", "fast", "--progress", "none", "-o", "out"]
    done = run("-m", "resfit", "fit", "prism.stl", *options, folder=folder)
    assert done.returncode == 0, done.stderr
    return folder / "out"


def test_it_is_fitted_and_saved(result: Path) -> None:
    primitives = json.loads((result / "assembly.json").read_text())["primitives"]
    assert [primitive["family"] for primitive in primitives] == ["hexagonal_prism"]
    assert primitives[0]["parameters"]["taper"] == pytest.approx(0.6, abs=0.02)
    metrics = json.loads((result / "report.json").read_text())["metrics"]
    assert metrics["iou"] > 0.98
    assert "sdf_hexagonal_prism" in (result / "viewer.html").read_text()


@pytest.mark.parametrize("suffix", ["glb", "html", "stl"])
def test_it_is_loaded_and_exported(suffix: str, result: Path, tmp_path: Path) -> None:
    path = tmp_path / f"out.{suffix}"
    done = run("-m", "resfit", "export", result, path, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    if suffix != "html":
        mesh = trimesh.load(path, force="mesh")
        assert mesh.is_watertight
        # A hexagon of radius 1, and one of 0.6, 1.6 apart.
        expected = 1.5 * np.sqrt(3.0) * 1.6 / 3.0 * (1.0 + 0.36 + 0.6)
        assert abs(mesh.volume) == pytest.approx(expected, rel=0.02)


def test_it_is_shown(result: Path, tmp_path: Path) -> None:
    done = run("-m", "resfit", "view", result, "--screenshot", "shown.png", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "shown.png").stat().st_size > 1000


def test_it_is_measured_beside_the_others(tmp_path: Path) -> None:
    program = (
        "import numpy as np\n"
        "from resfit.eval.bench.harness import scene_rows\n"
        "from resfit.eval.bench.kernels import family_workloads\n"
        "from resfit.kernels.runtime.launch import choose_device\n"
        "names = [work.name for work in family_workloads(choose_device('cpu'))]\n"
        "assert names[0] == 'superfrustum_forward' and 'hexagonal_prism_adjoint' in names, names\n"
    )
    done = run("-c", program, folder=tmp_path)
    assert done.returncode == 0, done.stderr


def test_it_keeps_the_contract(tmp_path: Path) -> None:
    contract = Path(__file__).with_name("test_family_contract.py")
    done = run("-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "hexagonal_prism", contract, folder=ROOT)
    assert done.returncode == 0, done.stdout
    assert done.stdout.startswith("....")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "bad.py, which RESFIT_FAMILIES names, is not there; name a Python file that defines FAMILY."),
        (
            "raise SystemExit(0)",
            "bad.py, which RESFIT_FAMILIES names, does not run: it ends the interpreter.",
        ),
        ("x = 1\n", "bad.py holds no primitive family; it must define FAMILY."),
        ("x = 1 / 0\n", "bad.py, which RESFIT_FAMILIES names, does not run: division by zero."),
    ],
)
def test_an_unusable_file_is_named(content: str | None, message: str, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / "bad.py").write_text(content)
    trimesh.creation.box().export(tmp_path / "box.stl")
    done = run("-m", "resfit", "fit", "box.stl", families="bad.py", folder=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_a_file_of_the_current_folder_is_never_run_unasked(tmp_path: Path) -> None:
    (tmp_path / "hexagonal_prism.py").write_text("raise SystemExit(7)\n")
    program = (
        "import resfit.kernels.primitives as found, resfit.kernels.primitives.plugins as plugins\n"
        "assert 'hexagonal_prism' not in found.FAMILIES and plugins.VARIABLE == 'RESFIT_FAMILIES'\n"
    )
    assert run("-P", "-c", program, families="", folder=tmp_path).returncode == 0


def test_a_name_is_taken_once() -> None:
    with pytest.raises(AssemblyError, match="there is a primitive family called 'cuboid' already"):
        register(FAMILIES["cuboid"])
    assert outside_families() == []
