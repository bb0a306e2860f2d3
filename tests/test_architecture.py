"""Rules that a machine can check: imports, sizes, packaging, where kernels are launched, which modules are tested."""

from __future__ import annotations

import ast
import functools
import subprocess
import sys
import tomllib
from pathlib import Path

import grimp
import pytest
from importlinter.cli import lint_imports

ROOT = Path(__file__).resolve().parent.parent

MAX_FILE_LINES = 400
MAX_FUNCTION_LINES = 60
"""Lines of a function without its docstring."""

LONG_FUNCTIONS = {
    "fold_owners_kernel": "one loop over the points of a block, whose state is in its local variables",
    "sdf_trapezoid_grad": "derivatives by hand, from the intermediate results of the value",
    "straighten_grad": "derivatives by hand, from the intermediate results of the value",
}
"""Functions that may have more, and why."""

LIGHT = {"errors", "children", "extras", "clock"}
"""Modules of src/resfit that the folders may import. They lie elsewhere on disk, where type checkers cannot follow a
relative import: their names are absolute everywhere."""

PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
SETUPTOOLS = PYPROJECT["tool"]["setuptools"]
FOLDERS = sorted(folder for folder in SETUPTOOLS["package-dir"].values() if folder != "src/resfit")


def python_files(*folders: str) -> list[Path]:
    """Python files below `folders` of the repository, sorted."""
    return sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))


@functools.cache
def parsed(path: Path) -> ast.Module:
    """Syntax tree of a file."""
    return ast.parse(path.read_text())


def module_name(path: Path) -> str:
    """Dotted name of a file, below `resfit`: kernels/primitives/cuboid.py is `kernels.primitives.cuboid`."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = parts[2:] if parts[:2] == ("src", "resfit") else parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(path: Path) -> list[tuple[int, int, str]]:
    """(line, relative level, absolute dotted name) of everything that a file imports, functions included."""
    package = ["resfit", *module_name(path).split(".")]
    if path.name != "__init__.py":
        package.pop()
    found = []
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            found += [(node.lineno, 0, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            base = base + (node.module.split(".") if node.module else [])
            found += [(node.lineno, node.level, ".".join([*base, alias.name])) for alias in node.names]
    return found


def absolute_imports(path: Path) -> list[str]:
    """Sentences about absolute imports, in a file of FOLDERS, of what is to be imported relatively."""
    return [
        f"{path.relative_to(ROOT)}:{line} imports {name} absolutely: use a relative import"
        for line, level, name in imports(path)
        if not level and name.split(".")[0] in {"resfit", *FOLDERS}
        if name.split(".")[:2] not in [["resfit", module] for module in LIGHT]
    ]


def test_imports_keep_to_the_contracts(capfd: pytest.CaptureFixture[str]) -> None:
    """Layers, circles and exceptions are in pyproject.toml."""
    code = lint_imports(str(ROOT / "pyproject.toml"), no_cache=True, no_logo=True)
    assert code == 0, capfd.readouterr().out


def test_contracts_see_every_module() -> None:
    """Links of the installation could be missing, and what is not there breaks no contract."""
    graph = grimp.build_graph("resfit", cache_dir=None)
    on_disk = {
        ".".join(["resfit", *filter(None, [module_name(path)])]) for path in python_files("src", *FOLDERS)
    }
    assert graph.modules == on_disk


def test_folders_import_each_other_relatively() -> None:
    assert [sentence for path in python_files(*FOLDERS) for sentence in absolute_imports(path)] == []


def test_import_rule_sees_absolute_imports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    path = tmp_path / "kernels" / "primitives" / "wrong.py"
    path.parent.mkdir(parents=True)
    path.write_text(
        "from ..field import x\nfrom resfit.errors import y\nimport resfit.api\nfrom fitter import z\n"
    )
    assert [sentence.split(" ")[0][-1] for sentence in absolute_imports(path)] == ["3", "4"]


def test_facade_tests_and_examples_import_absolutely() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {name}"
        for path in python_files("src", "tests", "examples")
        for line, level, name in imports(path)
        if level or name.split(".")[0] in FOLDERS
    ]
    assert wrong == []


def test_files_are_short() -> None:
    files = python_files("src", *FOLDERS, "tests", "examples")
    lengths = {str(path.relative_to(ROOT)): len(path.read_text().splitlines()) for path in files}
    assert {name: length for name, length in lengths.items() if length > MAX_FILE_LINES} == {}


def test_functions_are_short() -> None:
    long = {}
    for path in python_files("src", *FOLDERS, "tests", "examples"):
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                first = node.body[1] if ast.get_docstring(node) and len(node.body) > 1 else node.body[0]
                lines = (node.end_lineno or 0) - first.lineno + 1
                # A factory of kernels is as long as its own lines, not those of the kernels in it.
                lines -= sum(
                    (inner.end_lineno or 0) - inner.lineno + 1
                    for inner in node.body
                    if isinstance(inner, ast.FunctionDef)
                )
                if lines > MAX_FUNCTION_LINES and node.name not in LONG_FUNCTIONS:
                    long[f"{path.relative_to(ROOT)}:{node.name}"] = lines
    assert long == {}


def test_packages_listed_are_those_on_disk() -> None:
    on_disk = {
        ".".join(part for part in ("resfit", module_name(path)) if part)
        for path in python_files("src", *FOLDERS)
        if path.name == "__init__.py"
    }
    assert set(SETUPTOOLS["packages"]) == on_disk


def test_every_folder_with_code_is_a_package() -> None:
    bare = [
        str(path.parent.relative_to(ROOT))
        for path in python_files("src", *FOLDERS)
        if not (path.parent / "__init__.py").exists()
    ]
    assert bare == []


def test_package_folders_are_mapped() -> None:
    present = {path.parent.name for path in ROOT.glob("*/__init__.py")}
    expected = {"resfit": "src/resfit"} | {f"resfit.{name}": name for name in present}
    assert SETUPTOOLS["package-dir"] == expected


def test_no_package_at_the_root() -> None:
    assert not (ROOT / "__init__.py").exists()
    assert not (ROOT / "resfit").exists()


def test_only_kernels_launches_kernels() -> None:
    wrong = []
    for path in python_files("src", *[name for name in FOLDERS if name != "kernels"], "examples"):
        for node in ast.walk(parsed(path)):
            if (
                isinstance(node, ast.Attribute)
                and node.attr.startswith("launch")
                and isinstance(node.value, ast.Name)
                and node.value.id in {"wp", "warp"}
            ):
                wrong.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert wrong == []


MAX_KERNEL_ARGUMENTS = 12
"""More than that are columns that belong together, or what a block needs: a struct. Read fields by `points.at` where a
loop must become vector code."""


def test_kernels_take_few_arguments() -> None:
    many = {}
    for path in python_files("kernels"):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.FunctionDef) or len(node.args.args) <= MAX_KERNEL_ARGUMENTS:
                continue
            if any(ast.unparse(decorator).startswith("wp.kernel") for decorator in node.decorator_list):
                many[f"{path.relative_to(ROOT)}:{node.name}"] = len(node.args.args)
    assert many == {}


def test_one_place_starts_python() -> None:
    """Children get -P there: without it they execute modules of the current folder."""
    wrong = [
        str(path.relative_to(ROOT))
        for path in python_files("src", *FOLDERS)
        if "sys.executable" in path.read_text() and path.name != "children.py"
    ]
    assert wrong == []


def test_heavy_packages_load_inside_functions() -> None:
    heavy = set(PYPROJECT["tool"]["ruff"]["lint"]["flake8-tidy-imports"]["banned-module-level-imports"])
    wrong = []
    for path in python_files("src", *FOLDERS):
        for node in parsed(path).body:
            if isinstance(node, ast.Import | ast.ImportFrom):
                module = getattr(node, "module", None)
                names = [module] if module else [alias.name for alias in node.names]
                wrong += [f"{path.name}: {name}" for name in names if name and name.split(".")[0] in heavy]
    assert wrong == []


TESTED_THROUGH: dict[str, tuple[str, ...]] = {
    # Commands and what only they call: driven as people call them, by `resfit.cli.main`.
    "test_cli.py": (
        "__main__",
        "cli.completion",
        "cli.doctor",
        "cli.help",
    ),
    "test_fit_cli.py": ("cli.demo", "cli.single"),
    "test_fit_several.py": ("cli.browser",),
    "test_fit_view.py": ("cli.watching",),
    "test_bench_fit.py": ("cli.bench",),
    "test_compare.py": ("cli.compare", "eval.report.comparison", "eval.report.sheet"),
    "test_eval_cli.py": ("cli.eval",),
    "test_viewer_cli.py": ("cli.view", "viewer.web.extra"),
    "test_viewer_film.py": ("cli.filming",),
    # Behind `resfit.fit`, `evaluate` and the writers of files.
    "test_result.py": ("result.additions", "shape.loaded_mesh"),
    "test_chamfer.py": ("result.moving",),
    "test_prediction.py": ("eval.metrics.evaluate",),
    "test_methods.py": (
        "eval.methods.coacd",
        "eval.methods.file",
        "eval.methods.hulls",
        "eval.methods.vhacd",
    ),
    "test_export_mesh.py": ("exports.mesh",),
    # Readers' inner files: whole files are read, good and damaged ones.
    "test_formats_gltf.py": (
        "shape.formats.gltf_accessors",
        "shape.formats.gltf_buffers",
        "shape.formats.gltf_meshes",
        "shape.formats.gltf_meshopt",
        "shape.formats.gltf_nodes",
        "shape.formats.gltf_record",
    ),
    "test_formats_obj.py": ("shape.formats.indexed",),
    "test_formats_ply.py": ("shape.formats.ply_header", "shape.formats.ply_records"),
    "test_formats_threemf.py": ("shape.formats.threemf_model",),
    "test_hostile_files.py": ("shape.mesh_path",),
    # Kernels: their host functions, against twins in NumPy.
    "test_primitives.py": (
        "kernels.primitives.stages.bend",
        "kernels.field.frame",
        "kernels.primitives.cuboid",
        "kernels.primitives.canonical_rules",
        "kernels.primitives.dilated",
        "kernels.primitives.superfrustum",
        "kernels.primitives.superprimitive",
        "kernels.primitives.superquadric",
    ),
    "test_blend_search.py": ("kernels.select.blend_search",),
    "test_selection.py": (
        "kernels.runtime.buffers",
        "kernels.select.coverage_gains",
        "kernels.select.swap_moves",
    ),
    "test_levenberg_step.py": ("kernels.refine.prune_lists", "kernels.refine.residual_rows"),
    "test_isosurface.py": (
        "kernels.contour.dual_contour_grid",
        "kernels.contour.dual_contour_vertices",
        "kernels.contour.dual_contour",
    ),
    "test_mesh_query.py": ("kernels.mesh.inside_grid", "kernels.mesh.inside_winding"),
    "test_raytrace.py": ("kernels.render.mesh_scene", "kernels.render.shading", "kernels.render.ray_queue"),
    "test_launch.py": ("kernels.prefetch",),
    "test_bench_kernels.py": ("kernels.field.peak_flops",),
    "test_terminal.py": ("kernels.runtime.address_space",),
    # What is drawn: pictures of whole scenes.
    "test_viewer_scene.py": ("viewer.scene.layers",),
    "test_viewer_desktop.py": ("viewer.desktop.panel",),
    "test_viewer_web.py": ("viewer.web.layout",),
    "test_viewer_web_state.py": ("viewer.web.notebook",),
    # `resfit bench view`: it times what the other tests of the viewer check.
    "test_viewer_edits.py": ("viewer.bench",),
}
"""Test files, and modules that they drive through what uses them, without an import by name."""


def imported_by_tests() -> set[str]:
    """Dotted names, below `resfit`, of all that tests import, and of what might be a module in it."""
    names = [name for path in python_files("tests") for _, _, name in imports(path)]
    inner = [name.removeprefix("resfit.") for name in names if name.startswith("resfit.")]
    return {*inner, *(name.rpartition(".")[0] for name in inner)}


def test_every_module_has_a_test() -> None:
    """One that imports it by name, so that its failure names the culprit, or one that is listed above."""
    modules = {module_name(path) for path in python_files("src", *FOLDERS) if path.name != "__init__.py"}
    through = [name for names in TESTED_THROUGH.values() for name in names]
    assert modules - imported_by_tests() == set(through)
    assert TESTED_THROUGH.keys() <= {path.name for path in (ROOT / "tests").rglob("test_*.py")}


SLOW_TO_IMPORT = ["warp", "trimesh", "numpy", "scipy", "skimage", "pyvista", "vtk", "pydantic", "PIL"]


@pytest.mark.parametrize(
    "code",
    [
        "import resfit; dir(resfit)",
        "import resfit.cli; resfit.cli.main(['--help'])",
        "import resfit.cli; resfit.cli.main(['--version'])",
    ],
)
def test_start_up_loads_nothing_heavy(code: str) -> None:
    check = f"{code}\nimport sys\nsys.stderr.write(' '.join(set(sys.modules) & set({SLOW_TO_IMPORT!r})))"
    done = subprocess.run(
        [sys.executable, "-c", check], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
