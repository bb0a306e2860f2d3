"""Working in the page: keys, touch, what is done to whole parts, and the shader that is copied, in a real Chromium."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pages import HEIGHT, SIDEBAR, WIDTH, desk_lamp, overlap, random_assembly, seen

from resfit.assembly.assembly import Assembly

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.browser

PHONE = {
    "viewport": {"width": 375, "height": 667},
    "has_touch": True,
    "is_mobile": True,
    "device_scale_factor": 1,
}


@pytest.fixture(scope="module")
def lamp() -> Assembly:
    return desk_lamp()


def current(page: Page) -> Assembly:
    """What would be downloaded; what is no assembly is refused here."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "assembly.json"
        path.write_text(page.evaluate("viewer.json()"), encoding="utf-8")
        return Assembly.load(path)


def names(page: Page) -> list[str]:
    return [part.name for part in current(page).primitives]


def test_whole_parts_and_undo(opened: Callable[..., Page], lamp: Assembly) -> None:
    page = opened(lamp, up="z")
    states = [page.evaluate("viewer.model.now()")]
    first = [part.name for part in lamp.primitives]

    def done(action: str) -> list[str]:
        page.evaluate(f"viewer.actions.{action}")
        states.append(page.evaluate("viewer.model.now()"))
        return names(page)

    page.evaluate("viewer.select(1)")
    copied = done("duplicate(1)")
    assert copied == [*first[:2], f"{first[1]} copy", *first[2:]]
    moved = np.subtract(*(current(page).primitives[i].pose.translation for i in (2, 1)))
    np.testing.assert_allclose(moved, [0.1, 0, 0], atol=1e-6)
    assert done("hide(2)") == copied and done("isolate(4)") == copied
    assert (
        done("move(4, 1)")[5] == first[3] and page.evaluate("[...viewer.model.hidden].includes(5)") is False
    )
    assert done("move(0, -1)")[0] == first[0]
    states.pop()
    assert len(done("remove(0)")) == len(first)
    assert done("rename(0, 'a \\u2028\\u0007 lid ')")[0] == "a  lid"
    assert done("rename(0, '\\u0007 ')")[0] == "a  lid"
    states.pop()
    assert "edited" in page.locator("#count").inner_text()
    for state in reversed(states[:-1]):
        page.keyboard.press("Control+z")
        assert page.evaluate("viewer.model.now()") == state
    assert page.locator("#undo").is_disabled() and "edited" not in page.locator("#count").inner_text()
    for state in states[1:]:
        page.keyboard.press("Control+Shift+Z")
        assert page.evaluate("viewer.model.now()") == state


def test_name_and_colour_fields(opened: Callable[..., Page], lamp: Assembly) -> None:
    page = opened(lamp, up="z")
    page.evaluate("viewer.select(2)")
    page.fill("#name", "shade h")
    page.keyboard.press("Enter")
    page.fill("#fields input[type=color]", "#12ab34")
    part = current(page).primitives[2]
    assert (part.name, part.color) == ("shade h", "#12ab34")
    assert page.locator("#parts .selected .name").inner_text() == "shade h"
    page.get_by_role("button", name="delete").click()
    assert len(names(page)) == len(lamp.primitives) - 1
    for _ in range(3):
        page.click("#undo")
    assert current(page).to_json() == lamp.to_json()


def test_copies_beyond_a_word_of_bits_are_drawn(opened: Callable[..., Page], lamp: Assembly) -> None:
    part = lamp.primitives[0]
    page = opened(Assembly(tuple(replace(part, name=str(i)) for i in range(32)), lamp.transform), up="z")
    page.evaluate("viewer.actions.duplicate(31)")
    page.evaluate("viewer.actions.isolate(32)")
    page.evaluate("viewer.actions.frame()")
    assert (seen(page) == 0).any()
    page.evaluate("viewer.actions.isolate(32)")
    assert seen(page).max() == 32
    page.evaluate("DATA.most = 33; viewer.actions.duplicate(0)")
    assert len(names(page)) == 33 and "at most 33" in page.locator("#message").inner_text()


def test_keys(opened: Callable[..., Page], lamp: Assembly) -> None:
    page = opened(lamp, up="z")

    def state() -> dict[str, Any]:
        return page.evaluate(
            "({...viewer.camera, chosen: viewer.model.selected, hidden: viewer.model.hidden.size})"
        )

    before = state()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowDown")
    after = state()
    assert after["azimuth"] < before["azimuth"] and after["elevation"] > before["elevation"]
    page.keyboard.press("Shift+ArrowRight")
    assert state()["target"] != before["target"]
    page.keyboard.press("+")
    assert state()["distance"] < before["distance"]
    page.keyboard.press("f")
    assert state()["distance"] == before["distance"] and state()["azimuth"] == before["azimuth"]
    for key, chosen in (("]", 0), ("]", 1), ("[", 0), ("[", len(lamp.primitives) - 1), ("Escape", -1)):
        page.keyboard.press(key)
        assert state()["chosen"] == chosen
    page.keyboard.press("Delete")
    assert len(names(page)) == len(lamp.primitives)
    page.keyboard.press("]")
    page.keyboard.press("h")
    assert state()["hidden"] == 1
    page.keyboard.press("d")
    page.keyboard.press("Delete")
    assert names(page) == [part.name for part in lamp.primitives]
    # Letters in a text field are text, and arrows on a slider are its own.
    page.focus("#name")
    page.keyboard.press("d")
    page.focus("#explode")
    page.keyboard.press("ArrowRight")
    assert len(names(page)) == len(lamp.primitives) and state()["azimuth"] == before["azimuth"]
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("?")
    assert "orbit" in page.locator("#help").inner_text()
    page.keyboard.press("Escape")
    assert not page.locator("#help").is_visible() and state()["chosen"] >= 0


def test_touch(opened: Callable[..., Page], lamp: Assembly) -> None:
    page = opened(lamp, up="z", context=PHONE)
    box = page.locator("#canvas").bounding_box()
    assert box is not None and box["width"] == 375 and box["height"] > 300
    session = page.context.new_cdp_session(page)

    def touch(kind: str, *points: tuple[float, float]) -> None:
        found = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": found})

    def drag(begin: list[tuple[float, float]], end: list[tuple[float, float]]) -> None:
        paths = list(zip(begin, end, strict=True))
        touch("touchStart", *begin)
        for share in np.linspace(0.1, 1.0, 10):
            touch("touchMove", *[tuple(np.add(a, share * np.subtract(b, a)).tolist()) for a, b in paths])
        touch("touchEnd")

    def camera() -> dict[str, Any]:
        return page.evaluate("({...viewer.camera})")

    before = camera()
    drag([(180.0, 100.0)], [(260.0, 100.0)])
    orbited = camera()
    assert orbited["azimuth"] < before["azimuth"] - 20 and orbited["target"] == before["target"]
    drag([(150.0, 100.0), (200.0, 100.0)], [(100.0, 100.0), (250.0, 100.0)])
    pinched = camera()
    assert pinched["distance"] == pytest.approx(orbited["distance"] / 3, rel=0.15)
    assert pinched["azimuth"] == orbited["azimuth"]
    drag([(150.0, 100.0), (200.0, 100.0)], [(150.0, 160.0), (200.0, 160.0)])
    panned = camera()
    assert panned["distance"] == pytest.approx(pinched["distance"], rel=0.05)
    assert np.linalg.norm(np.subtract(panned["target"], pinched["target"])) > 0.05
    assert page.evaluate("viewer.model.selected") == -1
    page.evaluate("viewer.actions.whole()")
    wide, high = int(box["width"]), int(box["height"])
    parts = np.array(page.evaluate(f"viewer.renderer.pickAll({wide}, {high})")).reshape(high, wide)
    rows, columns = np.nonzero(parts == 0)
    x, y = float(columns[len(rows) // 2]), float(rows[len(rows) // 2])
    page.touchscreen.tap(x + 0.5, y + 0.5)
    assert page.evaluate("viewer.model.selected") == 0
    # Nothing is wider than the screen.
    assert page.evaluate("document.documentElement.scrollWidth") == 375


SHADERTOY = """([source, width, height]) => {
  const canvas = Object.assign(document.createElement('canvas'), {width, height});
  const gl = canvas.getContext('webgl2', {preserveDrawingBuffer: true});
  const fragment = `#version 300 es
    precision highp float;
    precision highp int;
    uniform vec3 iResolution;
    uniform float iTime, iTimeDelta;
    uniform int iFrame;
    uniform vec4 iMouse, iDate;
    out vec4 shown;
    ${source}
    void main() { vec4 made = vec4(0.0); mainImage(made, gl_FragCoord.xy); shown = made; }`;
  const vertex = `#version 300 es
    void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0.0, 1.0); }`;
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) return {error: gl.getShaderInfoLog(shader)};
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  gl.useProgram(program);
  gl.uniform3f(gl.getUniformLocation(program, 'iResolution'), width, height, 1);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
  const read = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, read);
  return {pixels: Array.from(read)};
}"""


def test_shader_draws_on_shadertoy(opened: Callable[..., Page], rng: np.random.Generator) -> None:
    """All families, bent and hollow parts, and names that would break a comment."""
    assembly = random_assembly(8, rng)
    named = replace(assembly.primitives[0], name='*/ \\ é " <img>')
    page = opened(replace(assembly, primitives=(named, *assembly.primitives[1:])))

    def picture() -> np.ndarray:
        found = page.evaluate(SHADERTOY, [page.evaluate("viewer.glsl()"), WIDTH, HEIGHT])
        assert "error" not in found, found["error"]
        return np.array(found["pixels"]).reshape(HEIGHT, WIDTH, 4)[::-1, :, :3]

    whole, parts = picture(), seen(page)
    page.evaluate("viewer.actions.isolate(0); viewer.actions.hide(0)")
    hit = (whole != picture()).any(axis=-1)
    assert overlap(hit, parts >= 0) >= 0.97
    assert whole[hit].std() > 20


MOVING = """new Promise(done => {
  let left = 8;
  (function move() {
    if (!left--) return done(viewer.renderer.scale);
    viewer.actions.orbit(5, 0);
    requestAnimationFrame(() => requestAnimationFrame(move));
  })();
})"""


@pytest.mark.parametrize(
    ("milliseconds", "low", "high"), [(1.0, 1.0, 1.0), (100.0, 0.1, 0.1), (13.0, 0.35, 0.6)]
)
def test_moving_pictures_are_as_fine_as_time_allows(
    opened: Callable[..., Page], lamp: Assembly, milliseconds: float, low: float, high: float
) -> None:
    """By a clock that goes on by so much whenever it is read: the speed of this machine does not matter."""
    clock = f"let clock = 0; performance.now = () => clock += {milliseconds};"
    page = opened(lamp, script=clock, up="z")
    assert low <= page.evaluate(MOVING) <= high


def test_dark_where_that_is_preferred(opened: Callable[..., Page], lamp: Assembly) -> None:
    size = {"width": SIDEBAR + WIDTH, "height": HEIGHT}
    page = opened(lamp, up="z", context={"viewport": size, "color_scheme": "dark"})
    colour = page.evaluate("getComputedStyle(document.querySelector('aside')).backgroundColor")
    assert max(json.loads(colour.replace("rgb(", "[").replace(")", "]"))) < 60
