"""The page of an assembly: what is embedded in it, and what it does in a real headless Chromium with WebGL 2."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from glsl_page import EVALUATE, encoded
from pages import MOVE, RESTING, desk_lamp, overlap, random_assembly, rendered, seen

from resfit.assembly.assembly import Assembly
from resfit.assembly.primitive import Pose
from resfit.cli import main
from resfit.errors import InputError
from resfit.exports.by_suffix import export_assembly
from resfit.exports.facts import report_facts
from resfit.exports.html import MAX_PARTS, page_text
from resfit.exports.overlay import MAX_FACES, MAX_QUADRIC_FACES, simplified
from resfit.kernels.primitives import FAMILIES

if TYPE_CHECKING:
    from playwright.sync_api import Page

HOSTILE = '</script><script>window.bad = 1</script><img src=x onerror="window.bad=1">{{DATA}}'


@pytest.fixture(scope="module")
def lamp() -> Assembly:
    return desk_lamp()


def embedded_data(text: str) -> dict[str, Any]:
    """What the page holds as JSON."""
    found = re.findall(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert len(found) == 1
    return json.loads(found[0])


def test_page_is_small_and_asks_for_nothing(rng: np.random.Generator) -> None:
    text = page_text(random_assembly(50, rng))
    assert len(text.encode()) < 300_000
    assert "{{" not in text
    assert re.findall(r"(?:src|href)\s*=\s*[\"']|https?://|@import|url\(", text) == []


def test_names_cannot_end_the_script(lamp: Assembly) -> None:
    part = replace(lamp.primitives[0], name=HOSTILE[:128])
    text = page_text(replace(lamp, primitives=(part,)), title=HOSTILE)
    assert text.count("<script") == 2 and text.count("</script") == 2
    data = embedded_data(text)
    assert data["title"] == HOSTILE and data["primitives"][0]["name"] == HOSTILE[:128]
    assert "<img" not in text


def test_sliders_have_the_ranges_of_the_tables(rng: np.random.Generator) -> None:
    families = embedded_data(page_text(random_assembly(8, rng)))["families"]
    assert sorted(families) == sorted(FAMILIES)
    for name, family in families.items():
        for found, parameter in zip(family["parameters"], FAMILIES[name].parameters, strict=True):
            assert (found["name"], found["unit"], found["count"]) == (
                parameter.name,
                parameter.unit,
                parameter.count,
            )
            assert tuple(found["slider"]) == parameter.slider
            assert [math.inf if value is None else value for value in found["legal"]] == list(parameter.legal)


def test_overlay_is_decimated(lamp: Assembly) -> None:
    sphere = trimesh.creation.icosphere(6)
    assert len(sphere.faces) > MAX_QUADRIC_FACES
    vertices, faces = simplified(sphere.vertices, sphere.faces)
    assert 3900 < len(faces) <= MAX_FACES and faces.max() == len(vertices) - 1
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1.0, atol=0.01)
    assert embedded_data(page_text(lamp, mesh=trimesh.Trimesh()))["mesh"] is None


def test_overlay_of_many_bodies(rng: np.random.Generator) -> None:
    """Collapsing edges cannot join bodies: two thousand boxes have 24000 faces, whatever is collapsed."""
    box = trimesh.creation.box((0.01, 0.01, 0.01))
    places = rng.uniform(-1.0, 1.0, (2000, 3))
    vertices = (box.vertices[None] + places[:, None]).reshape(-1, 3)
    faces = (box.faces[None] + 8 * np.arange(2000)[:, None, None]).reshape(-1, 3)
    points, kept = simplified(vertices, faces)
    assert 0 < len(kept) <= MAX_FACES and len(points) <= 3 * len(kept)
    assert np.abs(points).max() < 1.02


def test_written_by_suffix(lamp: Assembly, tmp_path: Path) -> None:
    lamp.save(tmp_path / "assembly.json")
    assert main(["export", str(tmp_path / "assembly.json"), str(tmp_path / "lamp.html")]) == 0
    first = (tmp_path / "lamp.html").read_bytes()
    export_assembly(lamp, tmp_path / "lamp.html")
    assert (tmp_path / "lamp.html").read_bytes() == first
    many = tuple(replace(lamp.primitives[0], name=str(index)) for index in range(MAX_PARTS + 1))
    with pytest.raises(InputError, match="at most"):
        export_assembly(Assembly(many), tmp_path / "many.html")
    assert not (tmp_path / "many.html").exists()


def test_page_of_a_fit_says_where_it_came_from(lamp: Assembly, tmp_path: Path) -> None:
    made = replace(lamp, provenance=replace(lamp.provenance, input_sha256="ab" * 32))
    made.save(tmp_path / "assembly.json")
    box = trimesh.creation.box((1, 1, 1))
    box.export(tmp_path / "lamp.stl")
    report = {
        "format": "resfit-report", "resfit": "9.9", "options": {"preset": "fast"}, "metrics": {"iou": 0.87654},
        "input": {"name": "lamp.stl", "sha256": "ab" * 32, "faces": 1234},
    }  # fmt: skip

    def exported(*options: str) -> dict[str, Any]:
        (tmp_path / "report.json").write_text(json.dumps(report))
        assert main(["export", str(tmp_path / "assembly.json"), str(tmp_path / "a.html"), *options]) == 0
        return embedded_data((tmp_path / "a.html").read_text())

    facts = ["IoU 0.877 as fitted", "fitted to lamp.stl (1,234 faces) by resfit 9.9 --preset fast"]
    page = exported("--mesh", str(tmp_path / "lamp.stl"))
    assert (page["facts"], page["title"], page["up"]) == (facts, "lamp.stl", "z")
    assert len(page["mesh"]["faces"]) == 12 * 3 * 2 * 4 / 3
    page = exported("--top", "2", "--up", "y")
    assert (page["facts"], page["title"], page["up"], page["mesh"]) == ([], "a", "y", None)
    report["input"]["sha256"] = "cd" * 32
    assert exported()["facts"] == []
    assert main(["export", str(tmp_path / "assembly.json"), str(tmp_path / "a.stl"), "--mesh", "b.stl"]) == 2
    assert report_facts({"metrics": 7, "input": {"name": None}, "options": []}) == []


@pytest.mark.browser
def test_silhouette_of_the_lamp(opened: Callable[..., Page], lamp: Assembly) -> None:
    page = opened(lamp, up="z")
    parts = seen(page)
    assert overlap(parts >= 0, rendered(page, lamp)) >= 0.97
    assert len(np.unique(parts)) >= 10


@pytest.mark.browser
def test_silhouette_of_all_families(opened: Callable[..., Page], rng: np.random.Generator) -> None:
    # More than 32 parts: the bits of a ray take two words.
    assembly = random_assembly(40, rng)
    page = opened(assembly)
    assert overlap(seen(page) >= 0, rendered(page, assembly)) >= 0.97


WITHOUT_CULLING = """() => {
  const made = partTable(viewer.model.visible(), null, 0);
  for (let i = 0; i < made.count; i++) made.data.set([1000, 0], 4 * COLUMNS * i + 28);
  viewer.renderer.setParts(made);
}"""


@pytest.mark.browser
def test_parts_left_out_change_nothing(opened: Callable[..., Page], rng: np.random.Generator) -> None:
    page = opened(random_assembly(24, rng))
    culled = seen(page)
    page.evaluate(WITHOUT_CULLING)
    # Rays that graze an edge may fall to either side when they take other steps.
    assert (seen(page) != culled).mean() < 0.002


@pytest.mark.browser
def test_click_picks_the_part_below(opened: Callable[..., Page], lamp: Assembly) -> None:
    page = opened(lamp, up="z")
    # The picture is so small that the buttons would cover most of it.
    page.add_style_tag(content="#bar { display: none }")
    parts = seen(page)
    for index in (0, int(parts[parts > 0].max())):
        rows, columns = np.nonzero(parts == index)
        middle = len(rows) // 2
        page.mouse.click(float(columns[middle]) + 0.5, float(rows[middle]) + 0.5)
        assert page.evaluate("viewer.model.selected") == index
        assert page.locator("#parts .selected .name").inner_text() == lamp.primitives[index].name
        assert page.locator("#name").input_value() == lamp.primitives[index].name
    page.mouse.click(1, 1)
    assert page.evaluate("viewer.model.selected") == -1


@pytest.mark.browser
def test_slider_moves_the_surface_and_undo_brings_it_back(
    opened: Callable[..., Page], lamp: Assembly
) -> None:
    page = opened(lamp, up="z")
    before, text = seen(page), page.evaluate("viewer.json()")
    page.evaluate("viewer.select(0)")
    for field, value in (("size.0", 1.4), ("translation.2", -0.3), ("rotation.0", 40)):
        page.evaluate(MOVE, [field, value])
    changed = page.evaluate("viewer.json()")
    assert (seen(page) != before).mean() > 0.02
    for _ in range(3):
        page.click("#undo")
    assert page.evaluate("viewer.json()") == text
    assert (seen(page) == before).all()
    for _ in range(3):
        page.click("#redo")
    assert page.evaluate("viewer.json()") == changed


@pytest.mark.browser
def test_download_loads_with_the_same_field(
    opened: Callable[..., Page], rng: np.random.Generator, tmp_path: Path
) -> None:
    assembly = random_assembly(12, rng)
    page = opened(assembly)
    points = rng.uniform(-2.0, 4.0, (500, 3))

    def downloaded() -> Assembly:
        with page.expect_download() as waiting:
            page.click("#download")
        assert waiting.value.suggested_filename == "assembly.json"
        waiting.value.save_as(tmp_path / "assembly.json")
        return Assembly.load(tmp_path / "assembly.json")

    assert downloaded().to_json() == assembly.to_json()
    page.evaluate("viewer.select(2)")
    page.evaluate(MOVE, ["translation.0", 0.25])
    page.evaluate(MOVE, ["blend", 0.1])
    part = assembly.primitives[2]
    pose = Pose((0.25, *part.pose.translation[1:]), part.pose.rotation)
    primitives = (*assembly.primitives[:2], replace(part, pose=pose, blend=0.1), *assembly.primitives[3:])
    expected = replace(assembly, primitives=primitives)
    np.testing.assert_allclose(downloaded().sdf(points, "cpu"), expected.sdf(points, "cpu"), atol=1e-5)
    above = page.evaluate("viewer.glsl()").partition("// ---- Shadertoy")[0]
    source = above + "float sdf_whole(vec3 p, float s[8]) { return map(p); }"
    normalised = (points - np.array(assembly.transform.translation)) / assembly.transform.scale
    padded = np.concatenate([normalised, np.zeros((500, 1))], axis=1)
    result = page.evaluate(EVALUATE, [source, "whole", encoded(np.zeros((1, 8))), encoded(padded), 1, 500])
    assert "error" not in result, result["error"]
    values = np.array(result["values"]) * assembly.transform.scale
    np.testing.assert_allclose(values, expected.sdf(points, "cpu"), atol=3e-4)


@pytest.mark.browser
def test_names_stay_text(opened: Callable[..., Page], lamp: Assembly) -> None:
    part = replace(lamp.primitives[0], name=HOSTILE[:128])
    page = opened(replace(lamp, primitives=(part, *lamp.primitives[1:])), title=HOSTILE, facts=[HOSTILE])
    page.evaluate("viewer.select(0)")
    assert page.locator("#facts li").text_content() == HOSTILE
    assert page.locator("#name").input_value() == HOSTILE[:128]
    assert page.evaluate("window.bad") is None
    assert page.locator("#parts .selected .name").text_content() == HOSTILE[:128]
    assert page.locator("h1").text_content() == page.title() == HOSTILE
    assert page.evaluate("JSON.parse(viewer.json()).primitives[0].name") == HOSTILE[:128]


@pytest.mark.browser
def test_hide_isolate_explode_and_overlay(opened: Callable[..., Page], lamp: Assembly) -> None:
    page = opened(lamp, up="z", mesh=lamp.to_mesh(32))
    before, text = seen(page), page.evaluate("viewer.json()")
    page.locator("#parts li").nth(0).get_by_text("only").click()
    assert set(np.unique(seen(page))) == {-1, 0}
    page.locator("#parts li").nth(0).get_by_text("only").click()
    page.locator("#parts li").nth(0).get_by_text("hide").click()
    assert (seen(page)[before == 0] == 0).sum() < (before == 0).sum()
    page.locator("#parts li").nth(0).get_by_text("show").click()
    page.evaluate("viewer.model.explode = 0.5; viewer.refresh()")
    assert ((seen(page) >= 0) != (before >= 0)).any()
    page.evaluate("viewer.model.explode = 0; viewer.refresh()")
    assert (seen(page) == before).all() and page.evaluate("viewer.json()") == text
    modes = []
    for _ in range(4):
        page.evaluate("document.getElementById('mesh').click()")
        page.evaluate(RESTING)
        modes.append(page.evaluate("viewer.camera.overlay"))
        assert page.evaluate("document.getElementById('canvas').getContext('webgl2').getError()") == 0
    assert modes == ["ghost", "wire", "side", "off"]


@pytest.mark.browser
def test_without_webgl2_a_sentence(opened: Callable[..., Page], lamp: Assembly) -> None:
    page = opened(lamp, script="HTMLCanvasElement.prototype.getContext = () => null;")
    assert "WebGL 2" in page.locator("#sorry").inner_text()
    assert page.evaluate("window.viewer") is None


@pytest.mark.browser
def test_empty_assembly(opened: Callable[..., Page]) -> None:
    page = opened(Assembly())
    assert (seen(page) == -1).all()
    assert json.loads(page.evaluate("viewer.json()"))["primitives"] == []
