"""The options of `resfit fit` as a Markdown table: `make options` writes it into README.md.

Its rows are what `resfit fit --help` shows; what only --help-all shows is listed by name below the table.
"""

from __future__ import annotations

from pathlib import Path

from cyclopts.argument import Argument

from resfit.cli import HELP_ALL, build_app
from resfit.cli.fit_options import MORE

DOCUMENT = Path(__file__).resolve().parent.parent / "README.md"
BEGIN, END = "<!-- begin: make options -->", "<!-- end: make options -->"

METAVARS = {int: "N", float: "X", str: "WORD"}
"""What stands for a value, by its type; PATH for all others."""


def arguments() -> list[Argument]:
    """The options of the command, in the order of its help."""
    collection = build_app()["fit"].assemble_argument_collection(parse_docstring=True)
    return [entry for entry in collection if entry.show and all(name.startswith("-") for name in entry.names)]


def usage(entry: Argument) -> str:
    """How an option is written: its flags, or its names before its choices or a word for its value."""
    if entry.hint is bool:
        return ", ".join(f"`{name}`" for name in entry.names)
    choices = entry.get_choices()
    value = "\\|".join(choices) if choices else METAVARS.get(entry.hint, "PATH")
    return ", ".join(f"`{name} {value}`" for name in entry.names)


def table() -> str:
    """The table, and a sentence that names the other options."""
    shown, rare = [], []
    for entry in arguments():
        (rare if entry.parameter.group == (MORE,) else shown).append(entry)
    # Docstrings break lines, cells of a table must not.
    helps = [" ".join((entry.parameter.help or "").split()).removesuffix(".") for entry in shown]
    rows = [f"| {usage(entry)} | {text} |" for entry, text in zip(shown, helps, strict=True)]
    names = ", ".join(f"`{entry.name}`" for entry in rare)
    return "\n".join(["| option | |", "|---|---|", *rows, "", f"`resfit fit {HELP_ALL}` explains {names}."])


def updated(document: str) -> str:
    """The document with the table of now between its markers."""
    before, _, rest = document.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{table()}\n\n{END}{after}"


if __name__ == "__main__":
    DOCUMENT.write_text(updated(DOCUMENT.read_text(encoding="utf-8")), encoding="utf-8")
