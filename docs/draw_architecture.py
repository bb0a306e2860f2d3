"""The layers of the packages as Markdown: `make architecture` writes them into docs/architecture.md.

A table of rules, which tests/test_architecture.py checks, and Mermaid graphs of the imports. Nodes are the folders that
pyproject.toml maps to packages, and in further graphs the folders within one. An arrow goes from a folder to one that
imports it. Arrows that follow from others are left out (transitive reduction).
"""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DOCUMENT = ROOT / "docs" / "architecture.md"
RULES = ROOT / "tests" / "test_architecture.py"
BEGIN, END = "<!-- begin: make architecture -->", "<!-- end: make architecture -->"

Edges = set[tuple[str, str]]
"""Pairs of an imported folder and one that imports it."""


def packages() -> dict[str, Path]:
    """Folder of every top-level package by its dotted name, that of the facade `resfit` included."""
    mapped = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-dir"]
    return {name: ROOT / folder for name, folder in mapped.items()}


def modules() -> dict[str, Path]:
    """File of every module by its dotted name; that of a package is its __init__.py."""
    found = {}
    for package, folder in packages().items():
        for path in sorted(folder.rglob("*.py")):
            parts = path.relative_to(folder).with_suffix("").parts
            parts = parts[:-1] if parts[-1] == "__init__" else parts
            found[".".join([package, *parts])] = path
    return found


def imported(module: str, path: Path, known: dict[str, Path]) -> Iterator[str]:
    """Modules of `known` that a module imports, functions included."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) + 1 - node.level] if node.level else []
            base = ".".join([*above, *(node.module.split(".") if node.module else [])])
            names = [f"{base}.{alias.name}" for alias in node.names]
        for name in names:
            # The last part may be a name within the module.
            found = next((part for part in (name, name.rpartition(".")[0]) if part in known), None)
            if found is not None:
                yield found


@dataclass(frozen=True)
class Graph:
    """Folders, and which of them import which."""

    names: set[str]
    edges: Edges


def dependencies(folder_of: Callable[[Path], str | None]) -> Graph:
    """Folders and their edges, where `folder_of` names that of a file, or None for files that are not drawn."""
    known = modules()
    names = {folder_of(path) for path in known.values() if path.stat().st_size}
    edges: Edges = set()
    for module, path in known.items():
        end = folder_of(path)
        for other in imported(module, path, known) if end else ():
            begin = folder_of(known[other])
            if begin and end and begin != end:
                edges.add((begin, end))
    return Graph({name for name in names if name}, edges)


def reduced(edges: Edges) -> Edges:
    """The edges without those that follow from others: the same folders are reached along the arrows."""
    left = set(edges)
    for edge in sorted(edges):
        if edge[1] in reached(edge[0], left - {edge}):
            left.remove(edge)
    return left


def reached(start: str, edges: Edges) -> set[str]:
    """Folders that are reached from one along the arrows."""
    found, waiting = set(), [start]
    while waiting:
        at = waiting.pop()
        after = {end for begin, end in edges if begin == at} - found
        found |= after
        waiting += after
    return found


def top_level() -> Graph:
    """The top-level folders; modules of the facade that all may import are not drawn."""
    folders = {folder: str(folder.relative_to(ROOT)) for folder in packages().values()}
    facade = folders[packages()["resfit"]]
    graph = dependencies(
        lambda path: next(name for folder, name in folders.items() if folder in path.parents)
    )
    return Graph(graph.names, {edge for edge in graph.edges if edge[0] != facade})


def within(folder: Path) -> Graph:
    """The folders in a top-level folder; its own files are one of them."""

    def part(path: Path) -> str | None:
        if folder not in path.parents:
            return None
        parts = path.relative_to(ROOT).parts
        depth = len(folder.relative_to(ROOT).parts)
        return "/".join(parts[: depth + 1]) if len(parts) > depth + 1 else "/".join([*parts[:-1], "*.py"])

    return dependencies(part)


def flowchart(graph: Graph) -> str:
    """A fenced Mermaid flowchart of the reduced edges."""
    identity = {name: f"n{number}" for number, name in enumerate(sorted(graph.names))}
    lines = [f'    {short}["{name}"]' for name, short in identity.items()]
    lines += [f"    {identity[begin]} --> {identity[end]}" for begin, end in sorted(reduced(graph.edges))]
    return "\n".join(["```mermaid", "flowchart TB", *lines, "```"])


def rules() -> str:
    """The table MAY_IMPORT of the test as Markdown."""
    for node in ast.parse(RULES.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.AnnAssign) and ast.unparse(node.target) == "MAY_IMPORT":
            # Folders in the order of the test; `set()` is no literal.
            table = ast.literal_eval(ast.unparse(node.value or node).replace("set()", "()"))
            lines = [f"| {name} | {', '.join(sorted(table[name])) or 'nothing'} |" for name in table]
            return "\n".join(["| folder | may import |", "|---|---|", *lines])
    raise LookupError(f"{RULES} has no table MAY_IMPORT")


def drawn() -> str:
    """The table and all flowcharts: the top-level folders, then each that has two folders with code in it or more."""
    texts = [rules(), flowchart(top_level())]
    for folder in sorted(packages().values()):
        graph = within(folder)
        if sum("*" not in name for name in graph.names) > 1:
            texts += [f"Within `{folder.relative_to(ROOT)}/`:", flowchart(graph)]
    return "\n\n".join(texts)


def updated(document: str) -> str:
    """The document with the flowcharts between the two markers drawn again."""
    before, rest = document.split(BEGIN)
    after = rest.split(END)[1]
    return f"{before}{BEGIN}\n\n{drawn()}\n\n{END}{after}"


if __name__ == "__main__":
    DOCUMENT.write_text(updated(DOCUMENT.read_text(encoding="utf-8")), encoding="utf-8")
