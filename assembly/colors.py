"""Colours of parts: by index, always the same, told apart with colour-blind eyes too."""

from __future__ import annotations

from ..kernels.srgb import to_linear

PALETTE = (
    "#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#ee7733", "#009988",
    "#999933", "#332288", "#cc6677", "#88ccee", "#ddcc77", "#117733", "#882255", "#bbbbbb",
)  # fmt: skip
"""Paul Tol's bright, vibrant and muted schemes, neighbours in the list unlike each other."""


def palette_color(index: int) -> str:
    """Colour `#rrggbb` of the part with this index; the palette repeats."""
    return PALETTE[index % len(PALETTE)]


def rgb(color: str) -> tuple[float, float, float]:
    """Red, green and blue of `#rrggbb`, each in [0, 1], sRGB."""
    return int(color[1:3], 16) / 255.0, int(color[3:5], 16) / 255.0, int(color[5:7], 16) / 255.0


def linear_rgb(color: str) -> tuple[float, float, float]:
    """Red, green and blue of `#rrggbb`, each in [0, 1], linear light, as materials in glTF want them."""
    red, green, blue = (float(to_linear(value)) for value in rgb(color))
    return red, green, blue
