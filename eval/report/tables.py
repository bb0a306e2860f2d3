"""Rows of a comparison as tables like those of the papers, in Markdown and LaTeX: mean, median and worst.

Methods are compared on the shapes that every one of them finished; open meshes, whose inside had to be decided, have a
table of their own that leads with distances.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from statistics import fmean, median
from typing import Any

Row = dict[str, Any]


@dataclass(frozen=True)
class Column:
    """One number of a table."""

    heading: str
    key: str
    style: str
    better: int
    """1 if more is better, -1 if less is."""
    factor: float = 1.0


IOU = Column("IoU", "iou", ".2f", 1, 100.0)
BISURF = Column("BiSurfIoU", "bisurf_iou", ".2f", 1, 100.0)
CD = Column("CD", "cd", ".3f", -1)
EMD = Column("EMD", "emd", ".3f", -1)
COUNT = Column("#Prims", "primitive_count", ".2f", -1)
OVERLAP = Column("Overlap", "overlap", ".3f", -1)

QUALITY = (IOU, BISURF, CD, EMD)
PROGRAM = (
    COUNT,
    OVERLAP,
    Column("IntraPrim", "intra_prim", ".3f", -1),
    Column("InterPrim", "inter_prim", ".3f", 1),
)
COST = (
    Column("floats", "floats", ".0f", -1),
    Column("CPU s", "cpu_s", ".1f", -1),
    Column("wall s", "wall_s", ".1f", -1),
    Column("peak MB", "peak_mb", ".0f", -1),
)
SHORT = (IOU, CD, COUNT, OVERLAP)
"""What the papers' ablations show."""
OPEN = (
    Column("mean distance", "surface_mean", ".4f", -1),
    Column("95 % within", "surface_p95", ".4f", -1),
    Column("farthest", "surface_max", ".3f", -1),
    CD,
    EMD,
    COUNT,
    OVERLAP,
    IOU,
)


def worst(values: Sequence[float], better: int) -> float:
    """The worst of some values; `better` as in `Column`."""
    return min(values) if better > 0 else max(values)


STATISTICS: dict[str, Callable[[Sequence[float], int], float]] = {
    "mean": lambda values, better: fmean(values),
    "median": lambda values, better: float(median(values)),
    "worst": worst,
}


@dataclass(frozen=True)
class Table:
    """Numbers of methods, ready for any format."""

    title: str
    columns: tuple[Column, ...]
    lines: tuple[tuple[str, tuple[float | None, ...]], ...]
    """Method, and a number for each column; None where there is none."""
    floor: float | None = None
    """What two samples of the targets' own surfaces score as CD: no method can do better."""

    def rank(self, line: int, column: int) -> int:
        """0 for the best method of a column, 1 for the second best, else 2; equals, as shown, share a rank."""
        better, style = self.columns[column].better, self.columns[column].style
        shown = [format(values[column], style) for _, values in self.lines if values[column] is not None]
        own = self.lines[line][1][column]
        if own is None or len(self.lines) < 2:
            return 2
        ahead = {text for text in shown if better * (float(text) - float(format(own, style))) > 0.0}
        return min(2, len(ahead))


def tables_of(rows: Sequence[Row]) -> list[Table]:
    """All tables of a comparison; those without a shape are left out."""
    done = [row for row in rows if row["status"] == "ok"]
    closed, left_open = ([row for row in done if row["closed"] is flag] for flag in (True, False))
    tables: list[Table] = []
    common = shared(closed)
    if common:
        count = len({row["mesh"] for row in common})
        shapes = f"{count} closed mesh{'es' if count != 1 else ''} that every method finished"
        for name in STATISTICS:
            tables.append(
                make_table(f"{name.capitalize()} over the {shapes}", QUALITY + PROGRAM, common, name)
            )
        tables.append(make_table(f"Mean cost over the {shapes}", SHORT[:1] + COST, common, "mean"))
        tables.append(make_table(f"Mean over the {shapes}, in short", SHORT, common, "mean"))
    if len(common) < len(closed):
        tables.append(
            make_table("Mean over the closed meshes that each method finished", SHORT, closed, "mean")
        )
    if left_open:
        some = shared(left_open) or left_open
        count = len({row["mesh"] for row in some})
        tables.append(
            make_table(f"Mean over {count} open mesh{'es' if count != 1 else ''}", OPEN, some, "mean")
        )
    return tables


def shared(rows: Sequence[Row]) -> list[Row]:
    """The rows of shapes that every method finished, but for methods that finished none of them."""
    finished: dict[str, set[str]] = {}
    for row in rows:
        finished.setdefault(row["method"], set()).add(row["mesh"])
    common = set.intersection(*finished.values()) if finished else set()
    return [row for row in rows if row["mesh"] in common]


def make_table(title: str, columns: tuple[Column, ...], rows: Sequence[Row], statistic: str) -> Table:
    """Statistics of the methods' rows; columns without any number are left out."""
    columns = tuple(column for column in columns if any(row.get(column.key) is not None for row in rows))
    lines = []
    for method in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == method]
        lines.append((method, tuple(_summed(own, column, column.key, statistic) for column in columns)))
    return Table(title, columns, tuple(lines), _floor_of(rows, statistic) if CD in columns else None)


def _floor_of(rows: Sequence[Row], statistic: str) -> float | None:
    """The floor of the Chamfer distance of some rows: each shape counts once."""
    shapes = {row["mesh"]: row for row in rows if row["status"] == "ok"}
    return _summed(list(shapes.values()), CD, "cd_floor", statistic)


def _summed(rows: Sequence[Row], column: Column, key: str, statistic: str) -> float | None:
    values = [column.factor * row[key] for row in rows if row.get(key) is not None]
    return STATISTICS[statistic](values, column.better) if values else None


def markdown(rows: Sequence[Row]) -> str:
    """The report: tables, failures, every row."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    meshes = list(dict.fromkeys(row["mesh"] for row in rows))
    failed = [row for row in rows if row["status"] != "ok"]
    lines = ["# Comparison", "", _introduction(len(meshes), methods), ""]
    for table in tables_of(rows):
        lines += [f"## {table.title}", "", *markdown_table(table), ""]
        lines += [_floor_sentence(table), ""] if table.floor is not None else []
    if failed:
        lines += ["## Not finished", ""]
        lines += [f"- {row['mesh']}, {row['method']}: {row['error']}" for row in failed] + [""]
    lines += ["## Every shape", "", *_every_shape(rows)]
    return "\n".join(lines) + "\n"


def _introduction(count: int, methods: Sequence[str]) -> str:
    return (
        f"Written by `resfit compare` {version('resfit')}: {count} meshes, methods {', '.join(methods)}. IoU and"
        " BiSurfIoU (sigma 0.02) in percent; CD is 100 x the mean squared distance, in the frame in which the longest"
        " side is 1.8; seconds and memory are those of one process a fit, with compiled kernels. Best in bold."
        " Pictures: [pareto.svg](pareto.svg), [sheet.png](sheet.png)."
    )


def _floor_sentence(table: Table) -> str:
    if table.floor is None:
        return ""
    return f"Two samples of the targets themselves have a CD of {table.floor:.3f}: smaller differences mean nothing."


def markdown_table(table: Table) -> list[str]:
    """Lines of a table, the best of each column in bold."""
    arrows = [f"{column.heading} {'↑' if column.better > 0 else '↓'}" for column in table.columns]
    lines = ["| method | " + " | ".join(arrows) + " |", "|---" + "|---:" * len(arrows) + "|"]
    for number, (method, values) in enumerate(table.lines):
        cells = []
        for index, value in enumerate(values):
            text = "-" if value is None else format(value, table.columns[index].style)
            cells.append(f"**{text}**" if table.rank(number, index) == 0 else text)
        lines.append(f"| {method} | " + " | ".join(cells) + " |")
    return lines


def _every_shape(rows: Sequence[Row]) -> list[str]:
    columns = (IOU, BISURF, CD, COUNT, OVERLAP, *COST[:3])
    headings = ["mesh", "method", *(column.heading for column in columns), "target"]
    lines = ["| " + " | ".join(headings) + " |", "|---" * len(headings) + "|"]
    for row in rows:
        if row["status"] == "ok":
            values = [row.get(column.key) for column in columns]
            cells = [
                "-" if value is None else format(value * column.factor, column.style)
                for value, column in zip(values, columns, strict=True)
            ]
            lines.append("| " + " | ".join([row["mesh"], row["method"], *cells, row["target_kind"]]) + " |")
    return lines


LATEX_HEAD = r"""% Needs \usepackage{booktabs} and \usepackage[table]{xcolor}. Gold is best, silver second best.
\definecolor{goldcell}{HTML}{FFE699}
\definecolor{silvercell}{HTML}{E3E6EA}
"""


def latex(rows: Sequence[Row]) -> str:
    """The same tables for a paper."""
    return LATEX_HEAD + "".join("\n" + latex_table(table) for table in tables_of(rows))


def latex_table(table: Table) -> str:
    """A table for a paper; needs LATEX_HEAD before it."""
    arrows = [
        rf"{_escape(column.heading)} ($\{'uparrow' if column.better > 0 else 'downarrow'}$)"
        for column in table.columns
    ]
    lines = [
        r"\begin{table}[t]",
        r"\small",
        r"\centering",
        rf"\begin{{tabular}}{{l{'c' * len(arrows)}}}",
        r"\toprule",
        r"\textbf{Method} & " + " & ".join(arrows) + r" \\",
        r"\midrule",
    ]
    for number, (method, values) in enumerate(table.lines):
        cells = [_escape(method)]
        for index, value in enumerate(values):
            text = "--" if value is None else format(value, table.columns[index].style)
            color = {0: r"\cellcolor{goldcell}", 1: r"\cellcolor{silvercell}"}.get(
                table.rank(number, index), ""
            )
            cells.append(color + text)
        lines.append(" & ".join(cells) + r" \\")
    caption = _escape(f"{table.title}. {_floor_sentence(table)}".strip())
    lines += [r"\bottomrule", r"\end{tabular}", rf"\caption{{{caption}}}", r"\end{table}"]
    return "\n".join(lines) + "\n"


def _escape(text: str) -> str:
    """Text in which LaTeX sees no commands."""
    for letter in "&%$#_{}":
        text = text.replace(letter, "\\" + letter)
    return text
