"""Films as files: GIF by Pillow, MP4 by imageio-ffmpeg. Written under a temporary name, then renamed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from resfit.errors import InputError
from resfit.extras import command_for

from ...assembly.atomic_write import replacing
from ..scene.screenshot import check_size

SUFFIXES = (".gif", ".mp4")
MAX_PICTURES = 3600
"""Two minutes at 30 a second: more would take hours to draw without a GPU."""

MAX_FPS = {".gif": 50.0, ".mp4": 120.0}
"""Browsers slow down GIFs with more."""

PALETTE_PICTURES = 8
"""From how many pictures the colours of a GIF are chosen. All share one palette, so that nothing flickers."""

RARE = 8
"""By how many pixels each colour counts beside its own."""

QUALITY = 7
"""Of imageio-ffmpeg's 0 to 10."""

Pictures = Callable[[int], np.ndarray]
"""Draws picture k of a film: (height, width, 3) uint8, sRGB, row 0 on top. Asked in any order."""


def check_film(path: Path, size: tuple[int, int], seconds: float, fps: float) -> None:
    """Refuse a film that cannot be written, before any work is done for it.

    Raises:
        InputError: if its suffix is none of SUFFIXES, what writes it is not installed, its folder is not there, or a
            number is out of range.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"cannot write '{path}': the name of a film must end in {' or '.join(SUFFIXES)}.")
    if not path.absolute().parent.is_dir():
        raise InputError(f"cannot write '{path}': there is no folder '{path.parent}'.")
    check_size(size)
    if not 1.0 <= fps <= MAX_FPS[suffix]:
        raise InputError(
            f"--fps {fps:g} is out of range; it must lie in [1, {MAX_FPS[suffix]:g}] for {suffix}."
        )
    if not 2 <= seconds * fps <= MAX_PICTURES:
        raise InputError(
            f"--seconds {seconds:g} at {fps:g} pictures a second is out of range;"
            f" a film has 2 to {MAX_PICTURES} pictures."
        )
    if suffix == ".mp4":
        _ffmpeg()


def write_film(path: Path, pictures: Pictures, count: int, fps: float) -> None:
    """Write a film, at once or not at all.

    Args:
        path: its suffix says in which format.
        pictures: draws them.
        count: how many there are.
        fps: pictures a second.

    Raises:
        InputError: if the file cannot be written.
    """
    with replacing(path) as temporary:
        if path.suffix.lower() == ".gif":
            _write_gif(temporary, pictures, count, fps)
        else:
            _write_mp4(temporary, pictures, count, fps)


def _write_gif(path: Path, pictures: Pictures, count: int, fps: float) -> None:
    from PIL import Image

    chosen = np.unique(np.linspace(0, count - 1, min(count, PALETTE_PICTURES)).round().astype(int))
    # Every third pixel shows all colours there are.
    sample = np.concatenate([pictures(int(k))[::3, ::3].reshape(-1, 3) for k in chosen])
    # Most of them are background: that rare colours count too, each is there once more.
    sample = np.concatenate([sample, np.repeat(np.unique(sample, axis=0), RARE, axis=0)])
    palette = Image.fromarray(sample[:, None]).quantize(256, Image.Quantize.MEDIANCUT, kmeans=1)

    def quantised() -> Iterator[Image.Image]:
        for k in range(count):
            # Grains of dithering would dance, and triple the file.
            yield Image.fromarray(pictures(k)).quantize(palette=palette, dither=Image.Dither.NONE)

    # The format counts hundredths of a second: rounded so that the whole has the right length.
    edges = np.round(100.0 * np.arange(count + 1) / fps)
    durations = [10 * int(step) for step in np.diff(edges)]
    rest = quantised()
    first = next(rest)
    first.save(path, save_all=True, append_images=rest, duration=durations, loop=0, optimize=False)


def _write_mp4(path: Path, pictures: Pictures, count: int, fps: float) -> None:
    first = pictures(0)
    # Colours are stored for two by two pixels: sides must be even.
    height, width = (side - side % 2 for side in first.shape[:2])
    writer = _ffmpeg().write_frames(
        str(path), (width, height), fps=fps, quality=QUALITY, macro_block_size=1, ffmpeg_log_level="error",
        output_params=["-movflags", "+faststart"],
    )  # fmt: skip
    writer.send(None)
    try:
        for k in range(count):
            picture = first if k == 0 else pictures(k)
            writer.send(np.ascontiguousarray(picture[:height, :width]))
    finally:
        writer.close()


def _ffmpeg() -> Any:
    """imageio-ffmpeg.

    Raises:
        InputError: if it is not installed.
    """
    try:
        import imageio_ffmpeg
    except ImportError:
        raise InputError(
            f"MP4 needs a package that is not installed; call {command_for('video')} to get it, or write a .gif."
        ) from None
    return imageio_ffmpeg
