"""The registry of exporters: a new file is enough, and no option is swallowed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import get_type_hints

import pytest
from pages import desk_lamp

import resfit
import resfit.exports
from resfit.assembly.assembly import Assembly
from resfit.cli import main
from resfit.cli.export import export as command
from resfit.errors import InputError
from resfit.exports import glb, html, obj, ply, stl
from resfit.exports.by_suffix import check_options, check_path, export_assembly, exporters
from resfit.exports.exporter import Exporter, ExportOptions

COUNT = """
from resfit.exports.exporter import Exporter


def write_count(assembly, path, *, title=None):
    path.write_text(f"{title}: {len(assembly.primitives)}")


EXPORTER = Exporter((".count", ".num"), write_count)
"""


@pytest.fixture
def lamp() -> Assembly:
    return desk_lamp()


@pytest.fixture
def with_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """One file more in the folder of the exporters."""
    folder = tmp_path / "more"
    folder.mkdir()
    (folder / "count.py").write_text(COUNT)
    monkeypatch.setattr(resfit.exports, "__path__", [*resfit.exports.__path__, str(folder)])
    exporters.cache_clear()
    yield
    exporters.cache_clear()


@pytest.mark.usefixtures("with_count")
def test_an_exporter_is_one_file(lamp: Assembly, tmp_path: Path) -> None:
    export_assembly(lamp, tmp_path / "lamp.NUM", title="parts")
    assert (tmp_path / "lamp.NUM").read_text() == f"parts: {len(lamp.primitives)}"
    lamp.save(tmp_path / "assembly.json")
    assert main(["export", str(tmp_path / "assembly.json"), str(tmp_path / "lamp.count")]) == 0
    assert (tmp_path / "lamp.count").exists()
    with pytest.raises(InputError, match=r"^--merged has no effect on .*lamp\.count; it is for \.glb, \.obj"):
        export_assembly(lamp, tmp_path / "lamp.count", merged=True)


def test_every_format_is_found_with_options_that_exist() -> None:
    assert {suffix: entry.write for suffix, entry in exporters().items()} == {
        ".glb": glb.write_glb,
        ".html": html.write_html,
        ".obj": obj.write_obj,
        ".ply": ply.write_ply,
        ".stl": stl.write_stl,
    }
    known = get_type_hints(ExportOptions, localns={"Surface": object}).keys()
    assert {option for entry in exporters().values() for option in entry.options} == known
    assert exporters()[".html"].options == ("mesh", "up", "title", "facts")


@pytest.mark.parametrize("text", [command.__doc__, export_assembly.__doc__])
def test_every_suffix_is_in_the_help(text: str) -> None:
    assert all(suffix in text for suffix in exporters())


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["a.html", "--merged"], "--merged has no effect on DIR/a.html; it is for .glb, .obj, .ply, .stl."),
        (
            ["a.html", "--device", "cpu"],
            "--device has no effect on DIR/a.html; it is for .glb, .obj, .ply, .stl.",
        ),
        (["a.obj", "b.stl", "--up", "z"], "--up has no effect on DIR/a.obj, DIR/b.stl; it is for .html."),
        (["a.doc"], "cannot export to DIR/a.doc: the name must end in one of .glb, .html, .obj, .ply, .stl."),
        (["no/a.obj"], "cannot write DIR/no/a.obj: there is no folder DIR/no."),
    ],
)
def test_options_that_a_format_does_not_take(
    arguments: list[str], sentence: str, lamp: Assembly, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lamp.save(tmp_path / "assembly.json")
    words = [str(tmp_path / word) if "." in word else word for word in arguments]
    assert main(["export", str(tmp_path / "assembly.json"), *words]) == 2
    assert capsys.readouterr().err == f"resfit: {sentence.replace('DIR', str(tmp_path))}\n"
    assert [path.name for path in tmp_path.iterdir()] == ["assembly.json"]


def test_each_of_several_files_gets_its_own_options(lamp: Assembly, tmp_path: Path) -> None:
    lamp.save(tmp_path / "assembly.json")
    paths = [tmp_path / "lamp.obj", tmp_path / "lamp.html"]
    arguments = ["--resolution", "8", "--up", "z"]
    assert main(["export", str(tmp_path / "assembly.json"), *map(str, paths), *arguments]) == 0
    assert all(path.exists() for path in paths)
    # The worth of parts is measured on a device, whatever is written.
    assert (
        main(["export", str(tmp_path / "assembly.json"), str(paths[1]), "--top", "2", "--device", "cpu"]) == 0
    )


def test_unknown_options(lamp: Assembly, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no format has such an option\.$"):
        check_options([tmp_path / "a.glb"], ["speed"])
    with pytest.raises(InputError, match="--mesh has no effect"):
        resfit.export(lamp, tmp_path / "a.glb", mesh=lamp.to_mesh(8))
    assert isinstance(check_path(tmp_path / "a.GLB"), Exporter)
