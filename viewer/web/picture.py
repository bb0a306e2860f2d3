"""Pictures of the scene for a page: drawn off-screen, packed as JPEG. Nothing here knows of trame."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..scene.plotter import is_software, smooth
from ..scene.scene import Scene

SMALLEST, LARGEST = 64, 2560
"""Pixels a side."""

SHARPEST = 2.0
"""Pixels of the picture to one of the page where a GPU draws, on screens that have as many; without one, 1."""

MOVING_QUALITY, STILL_QUALITY = 78, 93
"""Of JPEG: while something moves, and once it rests."""


@dataclass(frozen=True)
class Frame:
    """A packed picture."""

    content: bytes
    width: int
    height: int
    quality: int


class Picture:
    """Draws a scene in the size that a page wants.

    Attributes:
        scale: pixels of the picture to one of the page.
        height: of the picture, in the page's pixels.
    """

    def __init__(self, scene: Scene) -> None:
        """Draw a scene of an off-screen plotter."""
        self.scene = scene
        self.window: Any = scene.plotter.render_window
        self.scale = 1.0
        self.height = int(self.window.GetSize()[1])
        self._software: bool | None = None

    def resize(self, width: float, height: float, ratio: float = 1.0) -> bool:
        """Take on a size in the page's pixels; `ratio` of the screen's go on one of them. False if it was so."""
        if self._software is None:
            self.window.Render()
            self._software = is_software(self.scene.plotter)
        scale = min(max(ratio, 1.0), 1.0 if self._software else SHARPEST)
        scale = min(scale, LARGEST / max(width, height, 1.0))
        size = tuple(max(SMALLEST, round(scale * side)) for side in (width, height))
        self.scale, self.height = scale, max(1, round(height))
        if size == tuple(self.window.GetSize()):
            return False
        self.window.SetSize(*size)
        return True

    def draw(self, still: bool) -> Frame:
        """Draw the scene as it is.

        Args:
            still: whether nothing moves: edges are smoothed then, and little is lost in packing.
        """
        from PIL import Image

        self.scene.look()
        # With a GPU smoothing costs nothing.
        smooth(self.scene.plotter, still or self._software is False)
        self.window.Render()
        pixels = self.pixels()
        height, width = pixels.shape[:2]
        quality = STILL_QUALITY if still else MOVING_QUALITY
        packed = io.BytesIO()
        image = Image.frombuffer("RGB", (width, height), pixels, "raw", "RGB", 0, -1)
        image.save(packed, "JPEG", quality=quality, subsampling=0 if still else 2)
        return Frame(packed.getvalue(), width, height, quality)

    def pixels(self) -> np.ndarray:
        """Pixels of the last frame, (height, width, 3) uint8, the lowest row first."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        width, height = self.window.GetSize()
        array = vtkUnsignedCharArray()
        self.window.GetPixelData(0, 0, width - 1, height - 1, 0, array, 0)
        return np.asarray(vtk_to_numpy(array)).reshape(height, width, 3)
