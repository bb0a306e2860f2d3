"""Plots as SVG by matplotlib: one look for all, and the same bytes for the same numbers."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANEL = (3.9, 3.8)
"""Width and height of a panel with its labels, inches."""

INK, FAINT, LINE = "#1e2228", "#6e747c", "#d9dce0"

LOOK: dict[Any, Any] = {
    # Text stays text, and identifiers follow from the drawing.
    "svg.fonttype": "none",
    "svg.hashsalt": "resfit",
    "font.family": "sans-serif",
    "font.size": 9,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": LINE,
    "xtick.labelcolor": FAINT,
    "ytick.labelcolor": FAINT,
    "legend.frameon": False,
}


def svg_plot(
    count: int,
    draw: Callable[[Sequence[Axes]], None],
    title: str = "",
    panel: tuple[float, float] = PANEL,
) -> str:
    """A row of panels under a title, and right of them a legend of all that is labelled, each name once.

    Args:
        count: of panels.
        draw: fills them.
        title: above them.
        panel: width and height of each, inches.
    """
    # Without pyplot: nothing is shown, and no figure outlives this call.
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(LOOK):
        figure = Figure((count * panel[0] + 1.3, panel[1]), layout="constrained")
        figure.suptitle(title, x=0.01, ha="left", size="medium", color=FAINT)
        panels = figure.subplots(1, count, squeeze=False)[0]
        draw(panels)
        named = {
            name: handle
            for axes in panels
            for handle, name in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        if named:
            figure.legend(
                named.values(),
                named.keys(),
                loc="outside right upper",
                labelcolor="linecolor",
                fontsize=7.5,
                labelspacing=0.2,
            )
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()


def logarithmic(axes: Axes, direction: Literal["x", "y"]) -> None:
    """Make an axis logarithmic, with plain numbers beside it: one, two and five times the powers of ten."""
    from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

    axes.set(**{f"{direction}scale": "log"})
    axis = axes.xaxis if direction == "x" else axes.yaxis
    low, high = axis.get_view_interval()
    # Two thirds of a decade hold a round value; less is widened to them.
    if high < 4.7 * low:
        middle = (low * high) ** 0.5
        axes.set(**{f"{direction}lim": (middle / 4.7**0.5, middle * 4.7**0.5)})
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_locator(NullLocator())
