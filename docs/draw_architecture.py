"""The layers of the packages as Markdown: `make architecture` writes them into docs/architecture.md.

The contracts that tests/test_architecture.py checks, and Mermaid graphs of the imports. Nodes are the folders that
pyproject.toml maps to packages, and in further graphs the folders within one. An arrow goes from a folder to one that
imports it. Arrows that follow from others are left out (transitive reduction).
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parent.parent
DOCUMENT = ROOT / "docs" / "architecture.md"
BEGIN, END = "<!-- begin: make architecture -->", "<!-- end: make architecture -->"

FACADE = "resfit"
TOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
FOLDERS: dict[str, str] = TOOLS["setuptools"]["package-dir"]
"""Folder of every top-level package by its dotted name, that of the facade included."""

Edges = set[tuple[str, str]]
"""Pairs of an imported folder and one that imports it."""


@dataclass(frozen=True)
class Graph:
    """Folders, and which of them import which."""

    names: set[str]
    edges: Edges


def package_of(module: str) -> str:
    """The top-level package that a module belongs to."""
    package = ".".join(module.split(".")[:2])
    return package if package in FOLDERS else FACADE


def squashed(imports: grimp.ImportGraph, folder_of: Callable[[str], str | None]) -> Graph:
    """Modules put together to folders: `folder_of` names that of a module, None for modules that are not drawn."""
    places = {module: name for module in imports.modules if (name := folder_of(module))}
    edges = {
        (places[other], place)
        for module, place in places.items()
        for other in imports.find_modules_directly_imported_by(module)
        if places.get(other, place) != place
    }
    return Graph(set(places.values()), edges)


def top_level(imports: grimp.ImportGraph) -> Graph:
    """The top-level folders. Few modules of the facade may be imported by all, which are not drawn."""
    graph = squashed(imports, lambda module: FOLDERS[package_of(module)])
    return Graph(graph.names, {edge for edge in graph.edges if edge[0] != FOLDERS[FACADE]})


def within(imports: grimp.ImportGraph, package: str) -> Graph:
    """The folders in a top-level package; modules of its own are one node."""

    def folder_of(module: str) -> str | None:
        if not module.startswith(f"{package}.") or package_of(module) != package:
            return None
        child = module.removeprefix(f"{package}.").split(".")[0]
        is_folder = bool(imports.find_children(f"{package}.{child}"))
        return f"{FOLDERS[package]}/{child if is_folder else '*.py'}"

    return squashed(imports, folder_of)


def reduced(edges: Edges) -> Edges:
    """The edges without those that follow from others: the same folders are reached along the arrows."""
    left = set(edges)
    for edge in sorted(edges):
        if edge[1] in reached(edge[0], left - {edge}):
            left.remove(edge)
    return left


def reached(start: str, edges: Edges) -> set[str]:
    """Folders that are reached from one along the arrows."""
    found: set[str] = set()
    waiting = [start]
    while waiting:
        at = waiting.pop()
        after = {end for begin, end in edges if begin == at} - found
        found |= after
        waiting += after
    return found


def flowchart(graph: Graph) -> str:
    """A fenced Mermaid flowchart of the reduced edges."""
    identity = {name: re.sub(r"\W+", "_", name) for name in sorted(graph.names)}
    lines = [f'    {short}["{name}"]' for name, short in identity.items()]
    lines += [f"    {identity[begin]} --> {identity[end]}" for begin, end in sorted(reduced(graph.edges))]
    return "\n".join(["```mermaid", "flowchart TB", *lines, "```"])


def contracts() -> str:
    """The layers of import-linter, the highest first, and the names of the other contracts."""
    found = TOOLS["importlinter"]["contracts"]
    layers = [layer for contract in found if contract["type"] == "layers" for layer in contract["layers"]]
    others = [f"- {contract['name']}." for contract in found if contract["type"] != "layers"]
    return "\n".join(["```text", *layers, "```", "", *others])


def drawn() -> str:
    """Contracts and flowcharts: the top-level folders, then each that has at least two folders with modules in it."""
    imports = grimp.build_graph(FACADE, cache_dir=None)
    texts = [contracts(), flowchart(top_level(imports))]
    for package, folder in sorted(FOLDERS.items()):
        graph = within(imports, package)
        if sum("*" not in name for name in graph.names) > 1:
            texts += [f"Within `{folder}/`:", flowchart(graph)]
    return "\n\n".join(texts)


def updated(document: str) -> str:
    """The document with everything between the two markers made again."""
    before, rest = document.split(BEGIN)
    after = rest.split(END)[1]
    return f"{before}{BEGIN}\n\n{drawn()}\n\n{END}{after}"


if __name__ == "__main__":
    DOCUMENT.write_text(updated(DOCUMENT.read_text(encoding="utf-8")), encoding="utf-8")
