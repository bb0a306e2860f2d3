"""Films of an assembly, drawn without a window: how it was fitted, its parts apart and back, or once around it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from resfit.errors import InputError

from ..desktop.panel import Panel
from ..desktop.panel_layout import Drawing
from ..model.comparison import Comparison
from ..model.view_options import View
from ..scene.camera import OrbitCamera
from ..scene.opengl_check import finish_probe, require, start_probe
from ..scene.plotter import Plotter, make_plotter, smooth
from ..scene.request import Request, check_compared, first_view, open_session, read_camera
from ..scene.scene import Scene
from .interpolate import tween
from .playback import Frame, Stage, load_playback
from .playback_scene import PANEL_LAYER, StepScene, paint_caption, paint_line
from .video import check_film, write_film

Motion = Literal["optimisation", "explode", "turntable"]

SIZE = (960, 600)
SECONDS: dict[Motion, float] = {"optimisation": 10.0, "explode": 5.0, "turntable": 6.0}
FPS = 20.0

WEIGHTS: dict[Stage, float] = {
    "regions": 0.8,
    "candidates": 0.8,
    "chosen": 1.0,
    "refined": 1.2,
    "kept": 0.8,
    "final": 4.0,
}
"""How long steps last, by each other."""

HASTE = 0.25
"""Rounds change ever less: round n takes 1 / (1 + HASTE (n - 1)) of the first one's time."""

MOVING = 0.65
"""Share of its time in which a step comes about; then it rests."""

TURN = 40.0
"""Degrees by which the camera goes around in the film of a fit: what moves is seen to be solid."""

APART = 1.0
"""How far parts are moved apart, unless told."""


@dataclass(frozen=True)
class FilmRequest:
    """Options of a film."""

    path: Path
    motion: Motion | None = None
    """The fit where its history is known, else once around."""
    seconds: float | None = None
    fps: float = FPS


def save_film(
    request: Request, film: FilmRequest, on_picture: Callable[[float], None] | None = None
) -> Motion:
    """Write a film of what is asked for; needs no screen.

    Args:
        request: what to show, and how.
        film: where it goes, and what moves.
        on_picture: called with the share that is drawn, 0 to 1.

    Returns:
        What moves in it.

    Raises:
        InputError: if something cannot be read or written.
        DisplayError: if nothing can be drawn here.
    """
    motion = film.motion or ("optimisation" if _history_folder(request) else "turntable")
    size = request.size or SIZE
    seconds = SECONDS[motion] if film.seconds is None else film.seconds
    check_film(film.path, size, seconds, film.fps)
    camera = read_camera(request)
    view = first_view(request, camera)
    probe = start_probe(off_screen=True)
    try:
        documents, session, comparisons = open_session(request)
        check_compared(view, comparisons)
        frames: tuple[Frame, ...] = ()
        if motion == "optimisation":
            folder = _history_folder(request)
            if folder is None:
                raise InputError(
                    "a film of the optimisation needs the folder of one fit, with its history.npz."
                )
            frames = load_playback(folder, documents[0].assembly)
    finally:
        answer = finish_probe(probe)
    require(answer)
    count = max(2, round(seconds * film.fps))
    plotter = make_plotter(size, off_screen=True)
    try:
        if motion == "optimisation":
            draw = _fit_pictures(plotter, frames, count, comparisons[0], view, camera, request.device)
        else:
            scene = Scene(plotter, session, comparisons, view, camera, request.device)
            draw = (_turntable_pictures if motion == "turntable" else _explode_pictures)(scene, count)
        tell = on_picture or (lambda share: None)

        def told(k: int) -> np.ndarray:
            tell(k / count)
            return draw(k)

        write_film(film.path, told, count, film.fps)
    finally:
        plotter.close()
    return motion


def _history_folder(request: Request) -> Path | None:
    """The folder of the one fit that is asked for, if it holds its history."""
    if len(request.paths) != 1:
        return None
    folder = request.paths[0] if request.paths[0].is_dir() else request.paths[0].parent
    return folder if (folder / "history.npz").is_file() else None


def fit_folder(request: Request) -> Path:
    """The same.

    Raises:
        InputError: if there is none.
    """
    folder = _history_folder(request)
    if folder is None:
        raise InputError(
            "how a fit came about is in the history.npz of its folder; give the folder of one fit."
        )
    return folder


def _fit_pictures(
    plotter: Plotter,
    frames: Sequence[Frame],
    count: int,
    comparison: Comparison | None = None,
    view: View | None = None,
    camera: OrbitCamera | None = None,
    device: str = "auto",
) -> Callable[[int], np.ndarray]:
    """The pictures of a film of a fit; the last one is its last step, seen as by the camera.

    Args:
        plotter: off-screen.
        frames: the steps.
        count: of pictures.
        comparison, view, camera, device: as for `StepScene`.
    """
    scene = StepScene(plotter, frames[-1].assembly, comparison, view, camera, device)
    eye, width, height = scene.scene.camera, *plotter.window_size
    stand_back(scene.scene)
    panel, azimuth, take = Panel(plotter, PANEL_LAYER), eye.azimuth, _lens(plotter)

    def draw(k: int) -> np.ndarray:
        share = k / (count - 1)
        frame = frame_at(frames, share)
        scene.show(frame)
        eye.azimuth = azimuth - TURN * (1.0 - share)
        scene.look()
        drawing = Drawing()
        paint_caption(drawing, frame, width, height)
        paint_line(drawing, share, width, height)
        panel.paint(drawing)
        return take()

    return draw


def frame_at(frames: Sequence[Frame], share: float) -> Frame:
    """The step, or what lies between two, after a share of a film, 0 to 1; at 1 the last step itself."""
    weights = [WEIGHTS.get(frame.stage, 0.8) / (1.0 + HASTE * (frame.round - 1)) for frame in frames[:-1]]
    # The result stays a while, however many rounds there were.
    weights.append(max(WEIGHTS["final"], 0.2 * sum(weights)))
    ends = np.cumsum(weights) / sum(weights)
    at = min(int(np.searchsorted(ends, share, side="right")), len(frames) - 1)
    if at == 0:
        return frames[0]
    moved = float((share - ends[at - 1]) / (ends[at] - ends[at - 1])) / MOVING
    return tween(frames[at - 1], frames[at], eased(moved))


def _turntable_pictures(scene: Scene, count: int) -> Callable[[int], np.ndarray]:
    """Once around; after the last picture comes the first again."""
    stand_back(scene)
    azimuth, take = scene.camera.azimuth, _lens(scene.plotter)

    def draw(k: int) -> np.ndarray:
        scene.camera.azimuth = azimuth + 360.0 * k / count
        scene.look()
        return take()

    return draw


def _explode_pictures(scene: Scene, count: int) -> Callable[[int], np.ndarray]:
    """Parts apart, a rest, and back."""
    apart = scene.view.explode or APART
    scene.view = replace(scene.view, explode=apart)
    scene.sync()
    scene.frame()
    take = _lens(scene.plotter)

    def draw(k: int) -> np.ndarray:
        share = k / (count - 1)
        scene.view = replace(scene.view, explode=apart * eased(3.0 * min(share, 1.0 - share)))
        scene.sync()
        scene.look()
        return take()

    return draw


def eased(share: float) -> float:
    """A share of a way, 0 to 1, that begins and ends slowly; shares beyond are its ends."""
    share = min(1.0, max(0.0, share))
    return share * share * (3.0 - 2.0 * share)


def _lens(plotter: Plotter) -> Callable[[], np.ndarray]:
    """Takes pictures of an off-screen plotter, edges smoothed; unlike `grab` it draws each only once."""
    smooth(plotter, True)
    plotter.show(auto_close=False, interactive=False)

    def take() -> np.ndarray:
        plotter.render()
        return np.array(plotter.screenshot(return_img=True))[:, :, :3]

    return take


def stand_back(scene: Scene) -> None:
    """See everything from every side at once: frame the smallest upright cylinder around it."""
    points, camera = scene.points(), scene.camera
    upright = 1 if camera.up == "y" else 2
    others = [axis for axis in range(3) if axis != upright]
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    radius = float(np.linalg.norm((points - middle)[:, others], axis=1).max())
    turns = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    ring = np.tile(middle, (2 * len(turns), 1))
    ring[:, others] += radius * np.tile(np.stack([np.cos(turns), np.sin(turns)], axis=1), (2, 1))
    ring[:, upright] = np.repeat([points[:, upright].min(), points[:, upright].max()], len(turns))
    width, height = scene.plotter.window_size
    camera.frame(ring, width / height)
    scene.look()
