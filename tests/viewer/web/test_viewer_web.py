"""The served page in a real browser: pictures, picks, sliders, undo, saving; and who is refused."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from viewer_scenes import need_drawing
from web_pages import (
    PICTURE,
    Served,
    click_part,
    downloaded,
    middle_of,
    move_slider,
    paused,
    picture,
    rest,
    selected,
    served,
    slowed,
    three,
)

from resfit.assembly.assembly import Assembly

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.slow

SIZE = '[data-value="size.0"]'
"""The field of the first number."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an assembly, a mesh, and something that nobody may read."""
    pytest.importorskip("trame_vuetify", reason="the extra web is not installed")
    need_drawing()
    made = tmp_path_factory.mktemp("web")
    three().save(made / "assembly.json")
    three().to_mesh(32).export(made / "mesh.ply")
    (made / "secret.txt").write_text("nobody's business")
    return made


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[Served]:
    """One server for all tests; each undoes what it edits."""
    with served(folder / "assembly.json", "--target", str(folder / "mesh.ply")) as made:
        yield made


@pytest.fixture
def open_page(browser: Browser, server: Served) -> Iterator[Callable[..., Page]]:
    """Opens the page; afterwards nothing may have been complained about, nor been asked for elsewhere."""
    problems: list[str] = []
    contexts = []

    def opened(width: int = 1000, height: int = 640) -> Page:
        contexts.append(browser.new_context(viewport={"width": width, "height": height}))
        page = contexts[-1].new_page()
        page.set_default_timeout(12_000)
        page.on(
            "console", lambda said: problems.append(said.text) if said.type in ("error", "warning") else None
        )
        page.on("pageerror", lambda error: problems.append(str(error)))
        own = (f"http://127.0.0.1:{server.port}/", "data:", f"blob:http://127.0.0.1:{server.port}/")
        page.on("request", lambda asked: None if asked.url.startswith(own) else problems.append(asked.url))
        page.on(
            "websocket", lambda s: None if f"127.0.0.1:{server.port}/" in s.url else problems.append(s.url)
        )
        page.on(
            "response", lambda got: problems.append(f"{got.status} {got.url}") if got.status >= 400 else None
        )
        page.goto(server.address)
        page.wait_for_selector(PICTURE, state="visible", timeout=60_000)
        page.wait_for_function("document.querySelectorAll('.parts li').length === 3")
        return page

    yield opened
    for context in contexts:
        context.close()
    assert problems == []


def undo_all(page: Page) -> None:
    """Back to how the assembly was opened."""
    undo = page.get_by_role("button", name="undo", exact=True)
    rest(page)
    for _ in range(40):
        if undo.is_disabled():
            return
        undo.click()
        rest(page)
    raise AssertionError("there is no end to what can be undone")


def choose(page: Page, name: str) -> None:
    """Select a part in the list, if it is not, and wait for nothing."""
    if selected(page) != [name]:
        page.locator(f'.parts li[data-part="{name}"] .name').click()


@pytest.mark.browser
def test_page_shows_the_scene(open_page: Callable[..., Page]) -> None:
    page = open_page()
    assert page.title() == "ResFit"
    assert page.locator(".parts .text").all_inner_texts() == ["left", "middle", "right"]
    status = page.locator("[data-status]").inner_text()
    assert status.startswith(("3 parts · IoU 0.9", "3 parts · IoU 1.0"))
    image = picture(page)
    places = [middle_of(image, name)[0] for name in ("left", "middle", "right")]
    assert places == sorted(places)


@pytest.mark.browser
def test_click_selects_what_is_under_the_pointer(open_page: Callable[..., Page]) -> None:
    page = open_page()
    for name in ("right", "left", "middle"):
        before = picture(page)
        click_part(page, name)
        page.wait_for_selector(f'.parts li.selected[data-part="{name}"]')
        assert selected(page) == [name]
        assert page.locator(".part input").input_value() == name
        assert (np.abs(picture(page) - before).max(axis=2) > 40).sum() > 100
    page.locator(PICTURE).click(position={"x": 5, "y": 5})
    page.wait_for_selector(".editor .hint")
    assert selected(page) == []


@pytest.mark.browser
def test_slider_moves_the_surface_and_undo_restores_the_bytes(open_page: Callable[..., Page]) -> None:
    page = open_page()
    original = downloaded(page)
    assert original == three().to_json()
    click_part(page, "right")
    page.wait_for_selector('[data-slider="translation.1"]')
    before = middle_of(picture(page), "right")
    move_slider(page, "translation.1", [0.1, 0.2, 0.3, 0.5])
    after = middle_of(picture(page), "right")
    assert after[1] < before[1] - 30 and abs(after[0] - before[0]) < 60
    edited = downloaded(page)
    assert b'"translation": [0.6, 0.5, 0.0]' in edited
    assert page.locator('[data-value="translation.1"]').input_value() == "0.5"
    assert "not saved" in page.locator("[data-status]").inner_text()
    page.get_by_role("button", name="undo", exact=True).click()
    page.wait_for_function("!document.querySelector('[data-status]').innerText.includes('not saved')")
    assert downloaded(page) == original
    assert middle_of(picture(page), "right") == pytest.approx(before, abs=2)
    page.get_by_role("button", name="redo", exact=True).click()
    rest(page)
    assert downloaded(page) == edited
    undo_all(page)
    assert downloaded(page) == original


@pytest.mark.browser
def test_typed_numbers_are_checked(open_page: Callable[..., Page]) -> None:
    page = open_page()
    choose(page, "left")
    field = page.locator('[data-value="size.0"]')
    field.fill("0.5")
    field.press("Tab")
    page.wait_for_function("document.querySelector('[data-slider=\"size.0\"]').value == 0.5")
    assert b'"size": [0.5,' in downloaded(page)
    field.fill("-3")
    field.press("Tab")
    page.wait_for_function("document.querySelector('[data-value=\"size.0\"]').value == '0'")
    undo_all(page)


def first_sizes(page: Page) -> list[float]:
    """First sizes of the parts, by the file that the page downloads."""
    return [part["parameters"]["size"][0] for part in json.loads(downloaded(page))["primitives"]]


@pytest.mark.browser
@pytest.mark.parametrize("delay", [60, 150])
def test_fields_keep_what_is_typed(open_page: Callable[..., Page], server: Served, delay: int) -> None:
    page = open_page()
    with slowed(server):
        choose(page, "left")
        field = page.locator(SIZE)
        field.click(click_count=3)
        for k in range(4):
            # Each makes the server tell everything again while the next letters are typed.
            page.evaluate("window.trame.trigger('hide', [0, 'right'])")
            page.keyboard.type("0.55"[k], delay=delay)
            assert field.input_value() in ("0.55"[: k + 1], "0")
        page.keyboard.press("Enter")
        page.wait_for_function("document.querySelector('[data-slider=\"size.0\"]').value == 0.55")
        field.click(click_count=3)
        page.keyboard.type("0.7", delay=delay)
        page.keyboard.press("Escape")
        assert field.input_value() == "0.55"
    assert first_sizes(page) == [0.55, 0.32, 0.32]
    undo_all(page)


@pytest.mark.browser
@pytest.mark.parametrize("delay", [60, 150])
def test_numbers_go_to_the_part_that_was_shown(
    open_page: Callable[..., Page], server: Served, delay: int
) -> None:
    page = open_page()
    choose(page, "left")
    field, name = page.locator(SIZE), page.locator('[aria-label="name"]')
    field.wait_for()
    x, y = middle_of(picture(page), "right")
    with paused(server):
        page.locator(PICTURE).click(position={"x": x, "y": y})
        field.click(click_count=3)
        page.keyboard.type("0.5", delay=delay)
    page.wait_for_selector('.parts li.selected[data-part="right"]')
    page.keyboard.type("5", delay=delay)
    assert (name.input_value(), field.input_value()) == ("left", "0.55")
    page.keyboard.press("Enter")
    page.wait_for_function("document.querySelector('[aria-label=\"name\"]').value === 'right'")
    assert field.input_value() == "0.32" and first_sizes(page) == [0.55, 0.32, 0.32]
    undo_all(page)


@pytest.mark.browser
def test_numbers_wait_for_the_part_that_was_clicked(open_page: Callable[..., Page], server: Served) -> None:
    page = open_page()
    choose(page, "left")
    field = page.locator(SIZE)
    field.wait_for()
    with slowed(server):
        with paused(server):
            for name in ("middle", "right"):
                page.locator(f'.parts li[data-part="{name}"] .name').click()
            page.wait_for_selector(".editor fieldset:disabled")
        field.fill("0.55")
        field.press("Enter")
        page.wait_for_function("document.querySelector('[data-slider=\"size.0\"]').value == 0.55")
    assert first_sizes(page) == [0.32, 0.32, 0.55]
    undo_all(page)


@pytest.mark.browser
def test_undo_keys_work_beside_the_picture(open_page: Callable[..., Page]) -> None:
    page = open_page()
    choose(page, "left")
    slider, field = page.locator('[data-slider="size.0"]'), page.locator(SIZE)

    def wait_for(value: float) -> None:
        page.wait_for_function(
            "value => document.querySelector('[data-slider=\"size.0\"]').value == value", arg=value
        )
        rest(page)

    rest(page)
    slider.press("ArrowRight")
    wait_for(0.321)
    for undo, redo in (("Control+z", "Control+Shift+Z"), ("Control+z", "Control+y")):
        page.keyboard.press(undo)
        wait_for(0.32)
        page.keyboard.press(redo)
        wait_for(0.321)
    field.click(click_count=3)
    page.keyboard.type("7")
    page.keyboard.press("Control+z")
    assert field.input_value() == "0.321"
    page.keyboard.press("Escape")
    assert first_sizes(page)[0] == 0.321
    field.click(click_count=3)
    page.keyboard.type("0.7")
    page.keyboard.press("Enter")
    wait_for(0.7)
    page.keyboard.press("Control+z")
    wait_for(0.321)
    undo_all(page)


@pytest.mark.browser
def test_parts_are_copied_deleted_hidden_and_renamed_as_text(open_page: Callable[..., Page]) -> None:
    page = open_page()
    original = downloaded(page)
    page.locator('.parts li[data-part="middle"] .name').click()
    page.wait_for_selector(".part input")
    name = "<img src=x onerror=alert(1)>{{ 7 * 7 }}"
    page.locator(".part input").fill(name)
    page.locator(".part input").press("Enter")
    page.wait_for_function("document.querySelectorAll('.parts .text')[1].innerText.startsWith('<img')")
    assert page.locator(".parts .text").nth(1).inner_text() == name
    page.get_by_role("button", name="duplicate").click()
    page.wait_for_function("document.querySelectorAll('.parts li').length === 4")
    page.get_by_role("button", name="delete").click()
    page.wait_for_function("document.querySelectorAll('.parts li').length === 3")
    page.get_by_role("button", name="add …").click()
    page.get_by_text("cuboid", exact=True).click()
    page.wait_for_function("document.querySelectorAll('.parts li').length === 4")
    assert page.locator(".editor small").first.inner_text() == "cuboid"
    undo_all(page)
    assert downloaded(page) == original
    seen = picture(page)
    page.locator('.parts li[data-part="right"]').get_by_title("hide or show").click()
    page.wait_for_selector('.parts li.hidden[data-part="right"]')
    assert (np.abs(picture(page) - seen).max(axis=2) > 60).sum() > 1000
    page.locator('.parts li[data-part="left"]').get_by_text("only").click()
    page.wait_for_function("document.querySelectorAll('.parts li.hidden').length === 2")
    page.get_by_role("button", name="show all").click()
    page.wait_for_function("document.querySelectorAll('.parts li.hidden').length === 0")
    undo_all(page)


@pytest.mark.browser
def test_switches(open_page: Callable[..., Page]) -> None:
    page = open_page()
    for name in ("explode", "section", "wireframe", "mesh", "error", "residual", "slice"):
        before = picture(page)
        chip = page.locator(f'[data-switch="{name}"]')
        chip.click()
        page.wait_for_selector(f'[data-switch="{name}"][aria-pressed="true"]')
        assert (np.abs(picture(page) - before).max(axis=2) > 20).sum() > 300, name
        if name == "section":
            page.wait_for_selector('.rows [data-slider="view.section_at"]')
        for _ in range(4):
            if chip.get_attribute("aria-pressed") == "true":
                chip.click()
                rest(page)
        assert chip.get_attribute("aria-pressed") == "false", name


@pytest.mark.browser
def test_drag_turns_and_wheel_zooms(open_page: Callable[..., Page]) -> None:
    page = open_page()
    chosen, before = selected(page), picture(page)
    box = page.locator(PICTURE).bounding_box()
    assert box is not None
    x, y = box["x"] + 60, box["y"] + 60
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 40, y + 5, steps=4)
    page.mouse.move(x + 90, y + 10, steps=4)
    page.mouse.up()
    turned = picture(page)
    assert (np.abs(turned - before).max(axis=2) > 40).sum() > 1000
    assert selected(page) == chosen
    page.mouse.wheel(0, 400)
    apart = [middle_of(image, "right")[0] - middle_of(image, "left")[0] for image in (turned, picture(page))]
    assert 0 < apart[1] < 0.97 * apart[0]
    page.get_by_role("button", name="fit").click()


@pytest.mark.browser
def test_save_writes_what_is_shown(open_page: Callable[..., Page], folder: Path) -> None:
    page = open_page()
    page.locator('.parts li[data-part="left"] .name').click()
    page.wait_for_selector('[data-slider="size.1"]')
    move_slider(page, "size.1", [0.7])
    rest(page)
    shown = downloaded(page)

    def save(name: str) -> str:
        page.get_by_role("button", name="Save …").click()
        page.locator("[data-save] input, input[data-save]").first.fill(name)
        page.get_by_role("button", name="Save", exact=True).click()
        rest(page)
        return page.locator(".message").inner_text()

    assert "saved" in save("edited")
    assert (folder / "edited.json").read_bytes() == shown
    points = np.random.default_rng(0).uniform(-1, 1, (200, 3))
    (folder / "download.json").write_bytes(shown)
    loaded = Assembly.load(folder / "edited.json")
    np.testing.assert_array_equal(loaded.sdf(points), Assembly.load(folder / "download.json").sdf(points))
    assert "not saved" not in page.locator("[data-status]").inner_text()
    before = {path.name for path in folder.parent.iterdir()}
    assert "no name" in save("../outside.json")
    assert "no name" in save("/tmp/outside.json")
    (folder / "report.json").write_text("{}")
    assert "no assembly" in save("report.json")
    assert (folder / "report.json").read_text() == "{}"
    assert {path.name for path in folder.parent.iterdir()} == before
    assert (folder / "assembly.json").read_bytes() == three().to_json()
    undo_all(page)


@pytest.mark.browser
def test_narrow_screens_have_everything(open_page: Callable[..., Page]) -> None:
    page = open_page(390, 780)
    page.locator('.parts li[data-part="left"] .name').click()
    page.wait_for_selector('[data-slider="size.0"]')
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    for button in ("Save …", "Download", "duplicate"):
        box = page.get_by_role("button", name=button).bounding_box()
        assert (
            box is not None
            and box["x"] >= 0
            and box["x"] + box["width"] <= 390
            and box["y"] + box["height"] <= 780
        )
