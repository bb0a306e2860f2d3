"""Latency of an edit: model, surface and picture, apart. `resfit bench view` prints it."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..assembly.assembly import Assembly
from ..assembly.colors import palette_color
from ..assembly.primitive import Pose, Primitive
from ..kernels.runtime.cores import core_count
from .model.documents import Document
from .model.edit_session import EditSession
from .model.poses import to_quaternion, to_vector
from .scene.controller import Controller
from .scene.opengl_check import probe_rendering, require
from .scene.plotter import make_plotter, smooth
from .scene.scene import Scene
from .web.picture import Picture
from .web.state import page_state

PARTS, EDITS = 30, 60
SIZE = (1030, 860)
"""Pixels: what the panel leaves of the usual window."""

WEB_SIZE = (940, 800)
"""The same of a page of 1280 x 800."""


@dataclass(frozen=True)
class ViewTimes:
    """Milliseconds an edit, medians; while a slider is dragged, and once it is let go."""

    parts: int
    edits: int
    model: float
    """From the slider's value to the new assembly."""
    surface: float
    """Meshing what the edit touches, coarse while it is dragged."""
    picture: float
    """Drawing the window."""
    total: float
    slowest: float
    """95th percentile of the whole."""
    blend_total: float
    """The whole for an edit of a blend, which needs the surface of the union, made coarse."""
    settled: float
    """After the drag: fine surfaces of part and union, and a picture, edges not smoothed."""
    web_total: float
    """For a page, on its server: the edit, meshes, numbers to show, a picture of the page's size, packed."""
    web_bytes: float
    """Of such a picture."""
    size: tuple[int, int]
    renderer: str
    cores: int


def measure_view(parts: int = PARTS, edits: int = EDITS, device: str = "auto") -> ViewTimes:
    """Drag sliders of an assembly off-screen, and time it.

    Args:
        parts: how many it has.
        edits: how many values are set.
        device: `auto`, `cpu`, `cuda:0`.

    Raises:
        DisplayError: if nothing can be drawn here.
    """
    require(probe_rendering())
    plotter = make_plotter(SIZE, off_screen=True)
    try:
        session = EditSession([random_assembly(parts)])
        scene = Scene(plotter, session, device=device)
        smooth(plotter, False)
        # Kernels, shaders and the window itself are made in the first pictures.
        _drag(scene, 3, offset=0)
        alone = _drag(scene, edits, offset=1)
        settled = []
        for k in range(5):
            _edit(scene, 0, 0.1 + 0.01 * k)
            begin = time.perf_counter()
            scene.sync()
            plotter.render_window.Render()
            settled.append(time.perf_counter() - begin)
        blends = _drag(scene, max(8, edits // 4), offset=2, blend=True)
        web = _drag_web(scene, edits)
        text = plotter.render_window.ReportCapabilities()
        renderer = next((line for line in text.splitlines() if "renderer string" in line), ": unknown")
    finally:
        plotter.close()
    model, surface, picture = (1e3 * float(np.median(column)) for column in alone.T)
    totals = 1e3 * alone.sum(axis=1)
    return ViewTimes(
        parts, edits, model, surface, picture, float(np.median(totals)), float(np.percentile(totals, 95)),
        1e3 * float(np.median(blends.sum(axis=1))), 1e3 * float(np.median(settled)),
        1e3 * float(np.median(web[:, 0])), float(np.median(web[:, 1])), SIZE,
        renderer.partition(":")[2].strip(), core_count(),
    )  # fmt: skip


def describe(times: ViewTimes) -> str:
    """The times as a few lines of text."""
    return (
        f"An edit of one of {times.parts} parts, median of {times.edits} [ms]\n"
        f"  model      {times.model:8.2f}\n"
        f"  surface    {times.surface:8.2f}\n"
        f"  picture    {times.picture:8.2f}   {times.size[0]} x {times.size[1]}\n"
        f"  total      {times.total:8.2f}   95th percentile {times.slowest:.1f}\n"
        f"  let go     {times.settled:8.2f}   fine surfaces and picture\n"
        f"  blend      {times.blend_total:8.2f}   total, with the surface of the union\n"
        f"  page       {times.web_total:8.2f}   total on the server, {WEB_SIZE[0]} x {WEB_SIZE[1]} packed into "
        f"{times.web_bytes / 1024:.0f} kB\n"
        f"on {times.cores} cores, drawn by {times.renderer}\n"
    )


def as_dict(times: ViewTimes) -> dict[str, Any]:
    """For JSON."""
    return asdict(times)


def random_assembly(parts: int, seed: int = 0) -> Assembly:
    """An assembly of SuperFrusta of all kinds, the same for equal seeds."""
    rng = np.random.default_rng(seed)
    made = []
    for index in range(parts):
        values = {
            "size": to_vector(rng.uniform(0.12, 0.5, 3)), "roundness": float(rng.choice([0.0, 0.4, 1.0])),
            "dilation": float(rng.uniform(0.0, 0.03)), "taper": float(rng.uniform(0.5, 1.2)),
            "bulge": float(rng.choice([0.0, 0.0, 0.3])), "onion": float(rng.choice([-1.0, -1.0, 0.3])),
        }  # fmt: skip
        pose = Pose(
            to_vector(rng.uniform(-0.65, 0.65, 3)), to_quaternion(to_vector(rng.uniform(-180, 180, 3)))
        )
        blend = float(rng.choice([0.0, 0.04]))
        made.append(Primitive("superfrustum", f"part_{index:02d}", pose, values, blend, palette_color(index)))
    return Assembly(tuple(made))


def _edit(scene: Scene, index: int, share: float, blend: bool = False) -> None:
    refs = scene.session.refs()
    ref = refs[index % len(refs)] if not blend else refs[1 + index % (len(refs) - 1)]
    group = "Join" if blend else "Shape"
    sliders = [slider for slider in scene.session.editor.sliders(ref) if slider.group == group]
    slider = sliders[index % len(sliders)]
    # Within the range, and never a value that was there before: its surface would be kept.
    low, high = slider.range
    scene.session.editor.set_value(
        ref, slider.id, low + (0.15 + 0.5 * share) * (0.2 if blend else 1.0) * (high - low)
    )


def _drag(scene: Scene, edits: int, offset: int, blend: bool = False) -> np.ndarray:
    """Seconds (edits, 3) for model, surface and picture."""
    rows = []
    for k in range(edits):
        begin = time.perf_counter()
        _edit(scene, 7 * k, (0.618 * (k + 0.37 * offset)) % 1.0, blend)
        changed = time.perf_counter()
        scene.sync(live=True)
        meshed = time.perf_counter()
        scene.plotter.render_window.Render()
        rows.append((changed - begin, meshed - changed, time.perf_counter() - meshed))
    return np.array(rows)


def _drag_web(scene: Scene, edits: int) -> np.ndarray:
    """Seconds and bytes (edits, 2) of what the server of a page does for each value of a slider."""
    session = scene.session
    documents = [Document(assembly, Path("assembly.json"), "bench") for assembly in session.state.assemblies]
    controller, picture = Controller(scene, documents), Picture(scene)
    picture.resize(*WEB_SIZE)
    picture.draw(still=False)
    rows = []
    for k in range(edits):
        # Another part each time, as in `_drag`, with values that were not there before.
        session.select(session.refs()[7 * k % len(session.refs())])
        sliders = [slider for slider in controller.sliders() if slider.group == "Shape"]
        slider = sliders[7 * k % len(sliders)]
        low, high = slider.range
        begin = time.perf_counter()
        controller.slide(slider.id, low + (0.15 + 0.5 * ((0.618 * (k + 1.1)) % 1.0)) * (high - low))
        json.dumps(page_state(controller, live=True))
        content = picture.draw(still=False).content
        rows.append((time.perf_counter() - begin, len(content)))
    return np.array(rows)
