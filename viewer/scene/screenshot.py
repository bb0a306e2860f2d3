"""Pictures without a window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from resfit.errors import InputError

from ...assembly.atomic_write import replacing
from ..model.comparison import Comparison
from ..model.edit_session import EditSession
from ..model.view_options import View
from .camera import OrbitCamera
from .plotter import Plotter, make_plotter, smooth
from .scene import Scene

MAX_SIDE = 8192
"""Pixels: more than graphics drivers promise."""

PICTURE_CELLS = 48
"""Along a part's longest side: a picture that is taken once may take longer."""

FORMATS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")


def check_picture(path: Path, size: tuple[int, int]) -> None:
    """Refuse a picture that cannot be written, before any work is done for it.

    Raises:
        InputError: if its suffix is no picture's, its folder is not there, or its size makes no sense.
    """
    if path.suffix.lower() not in FORMATS:
        raise InputError(
            f"cannot write '{path}': the name of a picture must end in one of {', '.join(FORMATS)}."
        )
    if not path.absolute().parent.is_dir():
        raise InputError(f"cannot write '{path}': there is no folder '{path.parent}'.")
    check_size(size)


def check_size(size: tuple[int, int]) -> None:
    """Refuse a size (width, height) in pixels that makes no sense.

    Raises:
        InputError: if a side is out of range.
    """
    if not all(16 <= side <= MAX_SIDE for side in size):
        raise InputError(f"--size {size[0]}x{size[1]} is out of range; sides must lie in [16, {MAX_SIDE}].")


def render_picture(
    session: EditSession,
    comparisons: Sequence[Comparison | None] = (),
    view: View | None = None,
    camera: OrbitCamera | None = None,
    size: tuple[int, int] = (1280, 800),
    device: str = "auto",
    framed: bool = True,
) -> np.ndarray:
    """Draw a scene off-screen.

    Args:
        session, comparisons, view, device: as for `Scene`.
        camera: where to look from.
        size: width and height, pixels.
        framed: whether only the camera's angles count, and everything is seen; else it stays where it is.

    Returns:
        (height, width, 3) uint8, sRGB, row 0 on top.
    """
    plotter = make_plotter(size, off_screen=True)
    try:
        camera = replace(camera) if camera else OrbitCamera()
        distance, target = camera.distance, camera.target
        scene = Scene(plotter, session, comparisons, view, camera, device, PICTURE_CELLS)
        if not framed:
            camera.distance, camera.target = distance, target
            scene.look()
        return grab(plotter)
    finally:
        plotter.close()


def grab(plotter: Plotter) -> np.ndarray:
    """Screenshot of an off-screen plotter, edges smoothed: (height, width, 3) uint8, sRGB, row 0 on top."""
    smooth(plotter, True)
    try:
        plotter.show(auto_close=False, interactive=False)
        # Later pictures of the same plotter would else be the first one again.
        plotter.render()
        return np.array(plotter.screenshot(return_img=True))[:, :, :3]
    finally:
        smooth(plotter, False)


def write_picture(image: np.ndarray, path: Path) -> None:
    """Write a picture (height, width, 3) uint8 in the format of its suffix, at once or not at all.

    Raises:
        InputError: if the file cannot be written.
    """
    from PIL import Image

    with replacing(path) as temporary:
        Image.fromarray(image).save(temporary)
