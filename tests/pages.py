"""What tests of the page share: assemblies, and what is seen of them in the browser and by our own ray tracer."""

from __future__ import annotations

from importlib.resources import as_file, files
from typing import TYPE_CHECKING

import numpy as np

from resfit.assembly.assembly import Assembly
from resfit.assembly.primitive import Pose, Primitive
from resfit.assembly.transform import Transform
from resfit.kernels.primitives import FAMILIES
from resfit.kernels.render.camera import Camera
from resfit.kernels.render.raytrace import render_assembly

if TYPE_CHECKING:
    from playwright.sync_api import Page

WIDTH, HEIGHT = 180, 140
"""Size of the pictures that are compared: a software renderer takes a second for each."""

SIDEBAR = 310
"""Width of the panel beside the picture."""

RESTING = """new Promise(done => {
  (function wait() { viewer.renderer.resting ? done() : setTimeout(wait, 50); })();
})"""
"""Waits for the finished picture; `wait_for_function` is forbidden by the page's policy."""

MOVE = """([field, value]) => {
  const slider = document.querySelector(`input[type=range][data-field="${field}"]`);
  slider.value = value;
  slider.dispatchEvent(new Event('input'));
  slider.dispatchEvent(new Event('change'));
}"""


def desk_lamp() -> Assembly:
    """The assembly that comes with the package; z is up."""
    with as_file(files("resfit.data") / "desk_lamp.json") as path:
        return Assembly.load(path)


def random_assembly(count: int, rng: np.random.Generator) -> Assembly:
    """Parts of all families all over the place, bent and hollow ones too, with wide and narrow joins."""
    parts = []
    for index in range(count):
        family = sorted(FAMILIES)[index % len(FAMILIES)]
        low, high = FAMILIES[family].fit_range
        shape = rng.uniform(low, high)
        shape[:3] = rng.uniform(0.1, 0.7, 3)
        values = {
            entry.name: shape[FAMILIES[family].columns(entry.name)] for entry in FAMILIES[family].parameters
        }
        if "dilation" in values:
            values["dilation"] = rng.uniform(0.0, 0.05, 1)
        if "onion" in values:
            values["onion"] = np.minimum(values["onion"], 0.5)
        parameters = {
            name: tuple(float(x) for x in value) if len(value) > 1 else float(value[0])
            for name, value in values.items()
        }
        turn = rng.normal(size=4)
        w, x, y, z = (turn / np.linalg.norm(turn)).tolist()
        a, b, c = rng.uniform(-0.6, 0.6, 3).tolist()
        blend = float(rng.choice([0.0, 0.03, 0.15]))
        parts.append(Primitive(family, f"part {index}", Pose((a, b, c), (w, x, y, z)), parameters, blend))
    return Assembly(tuple(parts), Transform(3.0, (1.0, 2.0, 3.0)))


def seen(page: Page) -> np.ndarray:
    """Index (HEIGHT, WIDTH) of the part at each pixel, -1 where there is none."""
    return np.array(page.evaluate(f"viewer.renderer.pickAll({WIDTH}, {HEIGHT})")).reshape(HEIGHT, WIDTH)


def rendered(page: Page, assembly: Assembly) -> np.ndarray:
    """Where (HEIGHT, WIDTH) our own ray tracer sees the assembly by the page's camera."""
    view = page.evaluate("({...viewer.camera.view(), target: viewer.camera.target})")
    camera = Camera(tuple(view["eye"]), tuple(view["target"]), tuple(view["vertical"]))
    colors = np.zeros((len(assembly.primitives), 3))
    images = [
        render_assembly(
            made.on_device("cpu"),
            colors[: len(made.primitives)],
            camera,
            WIDTH,
            HEIGHT,
            samples=1,
            ground=False,
        )
        for made in (assembly, Assembly())
    ]
    return (images[0] != images[1]).any(axis=-1)


def overlap(first: np.ndarray, second: np.ndarray) -> float:
    return float((first & second).sum() / (first | second).sum())
