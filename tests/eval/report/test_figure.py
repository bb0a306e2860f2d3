"""Plots: the same bytes again, round values beside logarithmic axes, a legend of each name once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

import pytest

from resfit.eval.report.figure import logarithmic, svg_plot


def texts_of(svg: str) -> list[str | None]:
    return [element.text for element in ElementTree.fromstring(svg).iter() if element.tag.endswith("text")]


@pytest.mark.parametrize("values", [[1.0], [3.0, 700.0], [0.0123, 0.0124], [5e-3, 5e4]])
def test_logarithmic_axes_have_round_values(values: list[float]) -> None:
    def draw(panels: Sequence[Any]) -> None:
        panels[0].plot(values, values)
        logarithmic(panels[0], "x")
        panels[0].set_yticks([])
        assert panels[0].get_xlim()[0] <= min(values) and max(values) <= panels[0].get_xlim()[1]

    shown = [float(str(text)) for text in texts_of(svg_plot(1, draw)) if text]
    assert 1 <= len(shown) <= 14
    assert all(f"{value:e}"[:9] in ("1.000000e", "2.000000e", "5.000000e") for value in shown)


def test_same_numbers_give_the_same_bytes_and_names_stand_once() -> None:
    def draw(panels: Sequence[Any]) -> None:
        for axes in panels:
            axes.plot([0, 1], [2, 3], label="a < b")

    svg = svg_plot(2, draw, "title")
    assert svg == svg_plot(2, draw, "title")
    assert texts_of(svg).count("a < b") == 1 and "title" in texts_of(svg)
