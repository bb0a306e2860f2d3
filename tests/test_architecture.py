"""The rules that a machine can check: who imports whom, sizes, packaging, where kernels are launched."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

MAX_FILE_LINES = 400
MAX_FUNCTION_LINES = 80
"""Lines of a function without its docstring. Aim for 60; only a hand-written adjoint needs more."""

MAY_IMPORT: dict[str, set[str]] = {
    "kernels": set(),
    "assembly": {"kernels"},
    "target": {"kernels", "assembly.transform"},
    "decomposition": {"kernels", "target"},
    "fitter": {"kernels", "assembly", "target", "decomposition"},
    "export": {"kernels", "assembly"},
    "eval": {"kernels", "assembly", "target"},
    "eval.methods": {"kernels", "assembly", "target", "decomposition", "fitter"},
    "eval.bench": {"kernels", "assembly", "target", "decomposition", "fitter"},
    "viewer": {"kernels", "assembly", "target", "export", "eval.metrics"},
    "applications": {
        "kernels", "assembly", "target", "decomposition", "fitter", "eval", "export", "viewer",
    },
}  # fmt: skip
"""Folder or module: what it may import beside itself and LIGHT; the longest match counts."""

LIGHT = {"errors", "children", "extras"}
"""Modules of src/resfit that all may import: they import nothing themselves, or only each other."""

FOLDERS = sorted({name.split(".")[0] for name in MAY_IMPORT})
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
SETUPTOOLS = PYPROJECT["tool"]["setuptools"]


def python_files(*folders: str) -> list[Path]:
    """Python files below `folders` of the repository, sorted."""
    return sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))


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
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found += [(node.lineno, 0, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            base = base + (node.module.split(".") if node.module else [])
            found += [(node.lineno, node.level, ".".join([*base, alias.name])) for alias in node.names]
    return found


def allowed_for(module: str) -> set[str]:
    """What `module` may import, its own folder and LIGHT included."""
    rules = [name for name in MAY_IMPORT if module == name or module.startswith(name + ".")]
    return MAY_IMPORT[max(rules, key=len)] | {module.split(".")[0]} | LIGHT


def forbidden_imports(path: Path) -> list[str]:
    """Sentences about the imports of a file in one of FOLDERS that the table does not allow."""
    allowed = allowed_for(module_name(path))
    wrong = []
    for line, level, name in imports(path):
        if not level and name.split(".")[:2] in [["resfit", module] for module in LIGHT]:
            # They lie elsewhere on disk (src/resfit), where type checkers cannot follow a relative import.
            continue
        if not level and name.split(".")[0] in {"resfit", *FOLDERS}:
            wrong.append(f"{path.relative_to(ROOT)}:{line} imports {name} absolutely: use a relative import")
        elif level:
            ours = name.removeprefix("resfit.")
            if not any(ours == rule or ours.startswith(rule + ".") for rule in allowed):
                wrong.append(f"{path.relative_to(ROOT)}:{line} may not import {ours}")
    return wrong


def test_folders_import_only_what_the_table_allows() -> None:
    assert [sentence for path in python_files(*FOLDERS) for sentence in forbidden_imports(path)] == []


def test_import_rule_sees_relative_imports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    path = tmp_path / "kernels" / "primitives" / "wrong.py"
    path.parent.mkdir(parents=True)
    path.write_text(
        "from ..field import x\nfrom ...errors import y\nfrom ...assembly import z\n"
        "from ... import fitter\nimport resfit.api\n"
    )
    assert [sentence.split(" ")[0][-1] for sentence in forbidden_imports(path)] == ["3", "4", "5"]


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
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                first = node.body[1] if ast.get_docstring(node) and len(node.body) > 1 else node.body[0]
                lines = (node.end_lineno or 0) - first.lineno + 1
                # A factory of kernels is as long as its own lines, not those of the kernels in it.
                lines -= sum(
                    (inner.end_lineno or 0) - inner.lineno + 1
                    for inner in node.body
                    if isinstance(inner, ast.FunctionDef)
                )
                if lines > MAX_FUNCTION_LINES:
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
    present = {name for name in FOLDERS if python_files(name)}
    expected = {"resfit": "src/resfit"} | {f"resfit.{name}": name for name in present}
    assert SETUPTOOLS["package-dir"] == expected


def test_no_package_at_the_root() -> None:
    assert not (ROOT / "__init__.py").exists()
    assert not (ROOT / "resfit").exists()


def test_only_kernels_launches_kernels() -> None:
    wrong = []
    for path in python_files("src", *[name for name in FOLDERS if name != "kernels"], "examples"):
        for node in ast.walk(ast.parse(path.read_text())):
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
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.Import | ast.ImportFrom):
                module = getattr(node, "module", None)
                names = [module] if module else [alias.name for alias in node.names]
                wrong += [f"{path.name}: {name}" for name in names if name and name.split(".")[0] in heavy]
    assert wrong == []


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
