"""The studies of an ablation as Markdown and LaTeX: mean and median of each row, and what they say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from statistics import fmean
from typing import Any

from ...assembly.atomic_write import write_bytes
from ..batch.compare import ROWS
from ..report.tables import (
    BISURF,
    COST,
    COUNT,
    IOU,
    LATEX_HEAD,
    OVERLAP,
    Column,
    Row,
    Table,
    latex_table,
    make_table,
    markdown_table,
    shared,
)
from .ablation import STUDIES, Study

FILES = ("ablation.md", "ablation.tex")

COLUMNS = (
    IOU,
    BISURF,
    Column("parts", COUNT.key, ".1f", -1),
    OVERLAP,
    Column("unoverlap", "unoverlap", ".3f", -1),
    *(column for column in COST if column.key in ("floats", "cpu_s")),
)

UNFINISHED = "Not every row is there, so nothing is said about them."


def write_ablation(rows: Mapping[str, Sequence[Row]], out: Path) -> None:
    """Write FILES.

    Args:
        rows: of each study, by its name.
        out: the folder.
    """
    write_bytes(out / FILES[0], markdown(rows).encode())
    write_bytes(out / FILES[1], latex(rows).encode())


def markdown(rows: Mapping[str, Sequence[Row]]) -> str:
    """The report for people."""
    lines = ["# Ablation", "", _introduction(rows), ""]
    for name, found in rows.items():
        study, own = STUDIES[name], common_rows(STUDIES[name], found)
        lines += [f"## {study.title}", ""]
        for table in tables_of(study, own):
            lines += [f"{table.title}:", "", *markdown_table(table), ""]
        lines += [" ".join(say(study, own)), ""]
    failed = {
        (row["mesh"], row["method"]): row["error"]
        for found in rows.values()
        for row in found
        if row["status"] != "ok"
    }
    if failed:
        lines += ["## Not finished", ""]
        lines += [f"- {mesh}, `{method}`: {error}" for (mesh, method), error in failed.items()] + [""]
    lines += ["## What the rows are", "", "As `resfit compare --methods` takes them:", ""]
    labels: dict[str, list[str]] = {}
    for variant in (variant for name in rows for variant in STUDIES[name].variants):
        labels.setdefault(variant.method, []).append(variant.label)
    lines += [f"- `{method}`: {'; '.join(names)}" for method, names in labels.items()]
    return "\n".join(lines) + "\n"


def latex(rows: Mapping[str, Sequence[Row]]) -> str:
    """The same tables for a paper."""
    tables = [
        latex_table(table)
        for name, found in rows.items()
        for table in tables_of(STUDIES[name], common_rows(STUDIES[name], found))
    ]
    return LATEX_HEAD + "".join(f"\n{table}" for table in tables)


def common_rows(study: Study, rows: Sequence[Row]) -> list[Row]:
    """Rows of closed meshes that every variant finished, in the table's order; the method is the variant's label."""
    done = [row for row in rows if row["status"] == "ok" and row["closed"]]
    labels = {variant.method: variant.label for variant in study.variants}
    order = list(labels)
    done.sort(key=lambda row: order.index(row["method"]))
    return [row | {"method": labels[row["method"]]} for row in shared(done)]


def tables_of(study: Study, rows: Sequence[Row]) -> list[Table]:
    """Mean and median; none where no mesh was finished by all."""
    count = len({row["mesh"] for row in rows})
    if not count:
        return []
    meshes = f"the {count} closed mesh{'es' if count != 1 else ''} that every row finished"
    return [
        make_table(f"{name.capitalize()} over {meshes}", COLUMNS, rows, name) for name in ("mean", "median")
    ]


def say(study: Study, rows: Sequence[Row]) -> list[str]:
    """The two sentences of a study, from its `common_rows`."""
    means: dict[str, dict[str, Any]] = {}
    for label in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == label]
        means[label] = {column.key: fmean(row[column.key] or 0.0 for row in own) for column in COLUMNS}
    if {variant.label for variant in study.variants} != set(means):
        return [UNFINISHED]
    return study.sentences(means)


def say_all(rows: Mapping[str, Sequence[Row]]) -> str:
    """The sentences of all studies, a line each, for the terminal."""
    lines = []
    for name, found in rows.items():
        lines += say(STUDIES[name], common_rows(STUDIES[name], found))
    return "".join(f"{line}\n" for line in lines)


def _introduction(rows: Mapping[str, Sequence[Row]]) -> str:
    meshes = list(dict.fromkeys(row["mesh"] for found in rows.values() for row in found))
    shown = f"{len(meshes)} mesh{'es' if len(meshes) != 1 else ''}"
    return (
        f"Written by `resfit bench ablation` {version('resfit')} from rows in `{ROWS}`: {shown}"
        f" ({', '.join(meshes)}), one process a fit. IoU and BiSurfIoU (sigma 0.02) in percent; best in bold. Unless a"
        " row or title says otherwise it is the preset balanced with superfrusta, smooth unions, MSD and Levenberg"
        " steps, in two rounds (a single shot: one), of the whole mesh at once. The sentences below the tables are made"
        " from the numbers in them."
    )
