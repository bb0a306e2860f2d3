"""The gallery: what it shows of fits, that names stay text, and that nothing finished is fitted again."""

from __future__ import annotations

import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from pages import desk_lamp
from PIL import Image

from resfit.cli import main
from resfit.cli.gallery import fit_command, read_entries
from resfit.eval.report import results
from resfit.eval.report.gallery import Entry, find_fits, item_names, read_entry, summary, write_gallery

if TYPE_CHECKING:
    from playwright.sync_api import Browser

HOSTILE = "</h2><script>window.bad=1</script><img src=x onerror='window.bad=1'> \" {{CARDS}} &amp;.glb"


def report(name: str, **changes: Any) -> dict[str, Any]:
    usual = {
        "format": "resfit-report",
        "status": {"name": "saturated"},
        "input": {"name": name, "sha256": "", "faces": 1234, "closed": True, "sentence": "Closed."},
        "options": {"preset": "balanced"},
        "metrics": {"iou": 0.93, "primitive_count": 12, "wall_s": 4.56},
    }
    return usual | changes


def save_fit(folder: Path, content: dict[str, Any], picture: bool = True) -> Path:
    """A folder as a fit leaves it, as far as the gallery looks at it."""
    folder.mkdir(parents=True)
    desk_lamp().save(folder / "assembly.json")
    (folder / "report.json").write_text(json.dumps(content))
    if picture:
        Image.fromarray(np.full((360, 960, 3), 120, np.uint8)).save(folder / "preview.png")
    return folder


class Page(HTMLParser):
    """The tags of a page with their attributes, and its texts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.texts.append(data)

    def named(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


def entries_of(*folders: Path) -> list[Entry]:
    found = [read_entry(folder, fit_command) for folder in folders]
    assert None not in found
    return found


def test_page_shows_numbers_links_and_commands(tmp_path: Path) -> None:
    chair = save_fit(tmp_path / "a" / "chair.resfit", report("chair.glb"))
    (chair / "viewer.html").write_text("its own page")
    lamp = save_fit(tmp_path / "b" / "lamp.resfit", report("lamp.stl", seed=7))
    made: list[Path] = []
    found = entries_of(*find_fits([tmp_path / "a", tmp_path / "b"]))
    write_gallery(found, tmp_path / "out", lambda entry, path: made.append(path), "Some fits")
    text = (tmp_path / "out" / "index.html").read_text()
    page = Page(text)
    assert "{{" not in text and not re.findall(r"https?://|@import|url\(", text)
    assert "2 fits, mean IoU 0.930 of 2 closed meshes, median 12 parts" in page.texts
    assert "resfit fit lamp.stl --preset balanced --seed 7" in page.texts
    assert [card["data-iou"] for card in page.named("article")] == ["0.930000"] * 2
    for link in (*page.named("a"), *page.named("img")):
        target = tmp_path / "out" / (link.get("href") or link["src"] or "")
        assert target.is_file() or target in made
    assert made == [tmp_path / "out" / "fits" / "lamp.stl" / "viewer.html"]
    assert (tmp_path / "out" / "fits" / "chair.glb" / "viewer.html").read_text() == "its own page"
    copied = tmp_path / "out" / "fits" / "lamp.stl" / "assembly.json"
    assert copied.read_bytes() == (lamp / "assembly.json").read_bytes()
    with Image.open(tmp_path / "out" / "fits" / "lamp.stl" / "preview.webp") as picture:
        assert picture.format == "WEBP"


def test_what_a_report_lacks_is_left_out(tmp_path: Path) -> None:
    contents = [
        {"format": "resfit-report"},
        {
            "format": "resfit-report",
            "input": 3,
            "metrics": {"iou": "high", "primitive_count": True},
            "options": [],
        },
        report("x.glb", metrics={}, status=None, options={"preset": "none such"}),
    ]
    folders = [
        save_fit(tmp_path / f"{index}.resfit", content, picture=False)
        for index, content in enumerate(contents)
    ]
    found = entries_of(*folders)
    assert [entry.name for entry in found] == ["0", "1", "x.glb"]
    assert {(entry.iou, entry.parts, entry.seconds, entry.command) for entry in found} == {
        (None, None, None, "")
    }
    write_gallery(found, tmp_path / "out", lambda entry, path: None)
    page = Page((tmp_path / "out" / "index.html").read_text())
    assert len(page.named("article")) == 3 and page.named("img") == [] and "None" not in " ".join(page.texts)
    assert summary(found) == "3 fits"
    for text in ("", "[]", '{"format": "another"}', "[" * 100000):
        (folders[0] / "report.json").write_text(text)
        assert read_entry(folders[0]) is None
    assert read_entry(tmp_path / "nowhere") is None


def test_names_are_text(tmp_path: Path) -> None:
    hostile = report(HOSTILE)
    hostile["input"]["sentence"] = HOSTILE
    found = entries_of(save_fit(tmp_path / "fit", hostile))
    write_gallery(found, tmp_path / "out", lambda entry, path: None, HOSTILE)
    page = Page((tmp_path / "out" / "index.html").read_text())
    assert (
        len(page.named("script")) == 1
        and len(page.named("img")) == 1
        and "onerror" not in page.named("img")[0]
    )
    assert page.named("article")[0]["data-name"] == HOSTILE
    assert page.texts.count(HOSTILE) >= 3


def test_folders_have_plain_names(tmp_path: Path) -> None:
    names = ["../../etc/passwd", "Chair.glb", "chair.glb", "…", "", "a b/c\\d", "con.glb" * 40, ".hidden"]
    found = [Entry(name, "", tmp_path, "", None, None, None, None, None, "", True, "") for name in names]
    made = item_names(found)
    assert len({name.lower() for name in made}) == len(names)
    assert all(re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,90}", name) for name in made)


def test_command_names_what_differs_from_the_preset() -> None:
    options = {
        "preset": "fast", "primitive": "cuboid", "max_primitives": 9, "union": "smooth", "snap": True, "pareto": False,
        "per_part": "off", "samples": 77,
    }  # fmt: skip
    command = fit_command({"input": {"name": "a b.glb"}, "options": options, "seed": 3})
    assert command == (
        "resfit fit 'a b.glb' --preset fast --primitive cuboid --max-primitives 9 --snap --whole --seed 3"
        "  # and in Python: samples=77"
    )
    assert fit_command({"input": None, "options": {}}) == fit_command({}) == ""


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    """A folder of two meshes."""
    folder = tmp_path / "meshes"
    folder.mkdir()
    trimesh.creation.box((1, 1, 2)).export(folder / "box.stl")
    trimesh.creation.box((1, 3, 2)).export(folder / "other.ply")
    return folder


def test_only_what_is_missing_is_fitted(
    meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    status = {"name": "saturated"}

    def fitted(mesh: Path, work: Path, preset: str, timeout: float) -> dict[str, Any]:
        calls.append(mesh.name)
        content = report(mesh.name, options={"preset": preset}, status=status)
        content["input"]["sha256"] = hashlib.sha256(mesh.read_bytes()).hexdigest()
        if mesh.name == "broken.obj":
            return {"mesh": mesh.name, "exit_code": 2, "error": "it is empty."}
        save_fit(work / f"{mesh.name}-{len(calls)}.resfit", content)
        return {"mesh": mesh.name, "exit_code": 0, "iou": 0.9, "primitive_count": 3}

    monkeypatch.setattr(results, "fit_one", fitted)

    def run(*more: str) -> int:
        return main(["gallery", str(meshes), "-o", str(tmp_path / "out"), *more])

    assert run() == 0 and calls == ["box.stl", "other.ply"]
    page = (tmp_path / "out" / "fits" / "box.stl" / "viewer.html").read_text()
    assert '"mesh":{' in page and "IoU 0.930" not in page
    assert run() == 0 and len(calls) == 2
    assert run("--preset", "fast") == 0 and calls[2:] == ["box.stl", "other.ply"]
    assert Page((tmp_path / "out" / "index.html").read_text()).texts.count("box.stl") == 2
    # Fits from elsewhere count, what stopped by hand does not, and what cannot be fitted is said.
    assert (
        run("--work", str(tmp_path / "w"), str(tmp_path / "out.fits" / "balanced")) == 0 and len(calls) == 4
    )
    status["name"] = "interrupted"
    trimesh.creation.box((4, 1, 2)).export(meshes / "new.stl")
    assert run() == 0 and run() == 0 and calls[4:] == ["new.stl", "new.stl"]
    (meshes / "broken.obj").touch()
    status["name"] = "saturated"
    assert run() == 3 and calls[6:] == ["broken.obj", "new.stl"]
    assert main(["gallery", str(tmp_path / "nothing")]) == 2
    (tmp_path / "empty").mkdir()
    assert (
        main(["gallery", str(tmp_path / "empty"), "-o", str(tmp_path / "no")]) == 2
        and not (tmp_path / "no").exists()
    )


@pytest.mark.browser
def test_search_and_sort(browser: Browser, tmp_path: Path) -> None:
    numbers = {"b.glb": 0.9, "a 10.glb": 0.5, "a 9.glb": 0.7, HOSTILE: None}
    folders = [
        save_fit(tmp_path / str(index), report(name, metrics={} if iou is None else {"iou": iou}))
        for index, (name, iou) in enumerate(numbers.items())
    ]
    write_gallery(entries_of(*folders), tmp_path / "out", lambda entry, path: path.touch())
    page, problems = browser.new_page(), []
    page.on("console", lambda message: problems.append(message.text))
    page.on("pageerror", lambda error: problems.append(str(error)))
    requests: list[str] = []
    page.on("request", lambda request: requests.append(request.url))
    page.goto((tmp_path / "out" / "index.html").as_uri())

    def shown() -> list[str | None]:
        return [card.get_attribute("data-name") for card in page.locator("article:not([hidden])").all()]

    assert shown()[1:] == ["a 9.glb", "a 10.glb", "b.glb"]
    page.select_option("#order", "iou")
    assert shown() == ["b.glb", "a 9.glb", "a 10.glb", HOSTILE]
    page.select_option("#order", "iou reversed")
    assert shown() == ["a 10.glb", "a 9.glb", "b.glb", HOSTILE]
    page.fill("#search", "A .glb 1")
    assert shown() == ["a 10.glb", HOSTILE][: len(shown())] and "a 10.glb" in shown()
    assert page.evaluate("window.bad") is None
    assert page.evaluate("document.images[0].naturalWidth") == 960
    assert problems == [] and all(url.startswith((tmp_path / "out").as_uri()) for url in requests)
    page.close()


def test_damaged_fits_are_left_out_and_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, report, assembly in (
        ("cut", '{"format": "resfit', "{}"),
        ("null", "null", "{}"),
        ("gone", '{"format": "resfit-report", "version": 1}', None),
    ):
        folder = tmp_path / "fits" / name
        folder.mkdir(parents=True)
        (folder / "report.json").write_text(report)
        (folder / "viewer.html").write_text("")
        if assembly is not None:
            (folder / "assembly.json").write_text(assembly)
    other = tmp_path / "fits" / "other"
    other.mkdir()
    (other / "report.json").write_text("{}")
    assert read_entries(find_fits([tmp_path / "fits"])) == []
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3 and all(line.startswith("resfit: left out: ") for line in lines)
    assert [name for name in ("cut", "null", "gone") if any(f"/{name}/" in line for line in lines)] == [
        "cut", "null", "gone",
    ]  # fmt: skip
