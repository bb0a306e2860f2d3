"""The transfer function of sRGB (IEC 61966-2-1) and its inverse, for arrays of values in [0, 1]; dtypes stay."""

from __future__ import annotations

import numpy as np


def to_linear(shown: np.ndarray | float) -> np.ndarray:
    """Linear light of sRGB values."""
    return np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)


def to_srgb(light: np.ndarray | float) -> np.ndarray:
    """Values of sRGB from linear light."""
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1.0 / 2.4) - 0.055)
