"""Agreement of the documents with the code: headings, paths, the table of parameters, the graphs of imports."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from resfit.kernels.primitives import family

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
SUPERFRUSTUM = (DOCS / "superfrustum.md").read_text(encoding="utf-8")

REFERENCE = re.compile(r'superfrustum\.md,\s+"([^"]+)"')
"""A docstring's reference to a heading, which may be broken over two lines."""

PATH = re.compile(r"`([A-Za-z_./-]+(?:/|\.py|\.md))`")
"""A path between backticks: a folder with a slash at the end, or a file of Python or Markdown."""


def references() -> dict[str, list[str]]:
    """Headings of docs/superfrustum.md that the code refers to, and the files that do."""
    found: dict[str, list[str]] = {}
    for path in sorted(ROOT.rglob("*.py")):
        name = path.relative_to(ROOT)
        if name.parts[0] in {"build", "docs"} or name.parts[0].startswith(".") or path == Path(__file__):
            continue
        for heading in REFERENCE.findall(path.read_text(encoding="utf-8")):
            found.setdefault(" ".join(heading.split()), []).append(str(name))
    return found


def test_headings_that_docstrings_refer_to_exist() -> None:
    headings = set(re.findall(r"^#+ (.+)$", SUPERFRUSTUM, re.MULTILINE))
    found = references()
    assert found
    assert {heading: files for heading, files in found.items() if heading not in headings} == {}


def test_parameter_table_is_that_of_the_family() -> None:
    column = 0
    for parameter in family("superfrustum").parameters:
        last = column + parameter.count - 1
        columns = f"{column}" if last == column else f"{column}-{last}"
        legal, fit = (f"{low:g} to {high:g}" for low, high in (parameter.legal, parameter.fit))
        default = ", ".join(f"{value:g}" for value in parameter.default)
        line = f"| {columns} | {parameter.name} | {parameter.unit} | {legal} | {fit} | {default} | "
        assert line in SUPERFRUSTUM
        column = last + 1


@pytest.mark.parametrize("name", ["superfrustum.md", "architecture.md"])
def test_paths_named_in_a_document_exist(name: str) -> None:
    paths = PATH.findall((DOCS / name).read_text(encoding="utf-8"))
    assert paths
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_graphs_of_the_architecture_are_up_to_date() -> None:
    """If this fails: `make architecture`."""
    drawing = runpy.run_path(str(DOCS / "draw_architecture.py"))
    document = (DOCS / "architecture.md").read_text(encoding="utf-8")
    assert drawing["updated"](document) == document


def test_options_of_the_readme_are_those_of_the_command() -> None:
    """If this fails: `make options`."""
    writing = runpy.run_path(str(DOCS / "write_options.py"))
    document = (ROOT / "README.md").read_text(encoding="utf-8")
    assert document.count(writing["BEGIN"]) == document.count(writing["END"]) == 1
    assert writing["updated"](document) == document


def test_arrows_that_follow_from_others_are_left_out() -> None:
    reduced = runpy.run_path(str(DOCS / "draw_architecture.py"))["reduced"]
    assert reduced({("a", "b"), ("b", "c"), ("a", "c"), ("a", "d")}) == {("a", "b"), ("b", "c"), ("a", "d")}
    circle = {("a", "b"), ("b", "a")}
    assert reduced(circle) == circle
