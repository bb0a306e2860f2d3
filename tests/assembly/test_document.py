"""assembly.json: exact round trips, and one plain sentence that names the field for all that is wrong."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from resfit.assembly.assembly import Assembly
from resfit.assembly.document import MAX_BYTES, MAX_PRIMITIVES
from resfit.assembly.schema import SCHEMA_PATH, assembly_schema, schema_bytes
from resfit.errors import AssemblyError
from resfit.kernels.primitives import FAMILIES


def good_document() -> dict[str, Any]:
    """A valid document with one primitive of every family."""
    primitives = [
        {
            "family": family.name,
            "name": f"part_{family.index:02d}",
            "translation": [0.1, -0.25, 0.3],
            "rotation": [0.5, 0.5, -0.5, 0.5],
            "parameters": {
                entry.name: list(entry.default) if entry.count > 1 else entry.default[0]
                for entry in family.parameters
            },
            "blend": 0.05,
            "color": "#4477aa",
        }
        for family in FAMILIES.values()
    ]
    return {
        "format": "resfit-assembly",
        "version": 1,
        "transform": {"scale": 2.5, "translation": [1e6, 0.1, -3.0]},
        "primitives": primitives,
        "provenance": {"resfit": "0.1", "seed": 3, "options": {"preset": "fast"}, "input_sha256": "ab" * 32},
    }


FRUSTUM = list(FAMILIES).index("superfrustum")
ITEM = f"primitives[{FRUSTUM}]"
REMOVE = object()


def changed(path: list[str | int], value: Any) -> dict[str, Any]:
    """The good document with one value replaced, or removed."""
    document = good_document()
    place: Any = document
    for step in path[:-1]:
        place = place[step]
    if value is REMOVE:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return document


def in_frustum(*path: str | int) -> list[str | int]:
    return ["primitives", FRUSTUM, *path]


WRONG_FIELDS: list[tuple[list[str | int], Any, str]] = [
    (["format"], REMOVE, "format is missing"),
    (["format"], "gltf", 'format is "gltf"'),
    (["version"], REMOVE, "version is missing"),
    (["version"], 2, "version is 2; this release reads version 1"),
    (["version"], True, "version is true"),
    (["version"], 1.0, "version is 1.0"),
    (["version"], "1", 'version is "1"'),
    (["transform"], REMOVE, "transform is missing"),
    (["transform"], [], "transform is []; it must be an object"),
    (["transform", "scale"], 0, "transform.scale is 0; it must be above 0"),
    (["transform", "scale"], -1.5, "transform.scale is -1.5"),
    (["transform", "scale"], "1", 'transform.scale is "1"; it must be a number'),
    (["transform", "scale"], 10**400, "transform.scale"),
    (["transform", "translation"], [0, 0], "transform.translation has 2 values; it must have 3"),
    (["transform", "translation", 1], None, "transform.translation[1] is null; it must be a number"),
    (["transform", "matrix"], [], "transform.matrix is not a known field"),
    (["primitives"], REMOVE, "primitives is missing"),
    (["primitives"], {"length": 10**9}, "primitives is"),
    (["primitives"], 10**9, "primitives is 1000000000; it must be a list"),
    (["primitives"], [3], "primitives[0] is 3; it must be an object"),
    (["primitives"], [{}] * (MAX_PRIMITIVES + 1), "primitives has 20001 entries"),
    (["provenance"], REMOVE, "provenance is missing"),
    (["provenance", "time"], "12:00", "provenance.time is not a known field"),
    (["provenance", "seed"], 1.5, "provenance.seed is 1.5; it must be a whole number"),
    (["provenance", "seed"], True, "provenance.seed is true; it must be a whole number"),
    (["provenance", "input_sha256"], "xyz", 'provenance.input_sha256 is "xyz"'),
    (["provenance", "options"], [], "provenance.options is []; it must be an object"),
    (["comment"], "hello", "comment is not a known field"),
    (["a\nb c"], 1, '["a\\nb c"] is not a known field'),
    (in_frustum("family"), REMOVE, f"{ITEM}.family is missing"),
    (in_frustum("family"), "sphere", f'{ITEM}.family is "sphere"; there are'),
    (in_frustum("family"), 3, f"{ITEM}.family is 3; it must be text"),
    (in_frustum("name"), REMOVE, f"{ITEM}.name is missing"),
    (in_frustum("name"), "", f"{ITEM}.name is empty"),
    (in_frustum("name"), "a\nb", f'{ITEM}.name is "a\\nb"'),
    (in_frustum("name"), "x" * 129, f"{ITEM}.name is longer than 128"),
    (in_frustum("name"), "part_00", f'{ITEM}.name is "part_00", as is that of primitives[0]'),
    (in_frustum("translation"), [0, 0, 0, 0], f"{ITEM}.translation has 4 values; it must have 3"),
    (in_frustum("translation", 2), "0", f'{ITEM}.translation[2] is "0"; it must be a number'),
    (in_frustum("translation", 0), 1e39, f"{ITEM}.translation[0] must be a finite number"),
    (in_frustum("rotation"), [0, 0, 0, 0], f"{ITEM}.rotation is zero"),
    (in_frustum("rotation"), [1, 1, 0, 0], f"{ITEM}.rotation has length 1.414"),
    (in_frustum("rotation"), [0, 0, 0], f"{ITEM}.rotation has 3 values; it must have 4"),
    (in_frustum("rotation"), [True, 0, 0, 0], f"{ITEM}.rotation[0] is true; it must be a number"),
    (in_frustum("parameters"), REMOVE, f"{ITEM}.parameters is missing"),
    (in_frustum("parameters"), [1, 2], f"{ITEM}.parameters is [1, 2]; it must be an object"),
    (in_frustum("parameters", "taper"), REMOVE, f"{ITEM}.parameters.taper is missing"),
    (in_frustum("parameters", "taper"), 2.5, f"{ITEM}.parameters.taper is 2.5; it must lie in [0, 2]"),
    (in_frustum("parameters", "taper"), "1", f'{ITEM}.parameters.taper is "1"; it must be a number'),
    (in_frustum("parameters", "taper"), [1], f"{ITEM}.parameters.taper is [1]; it must be a number"),
    (in_frustum("parameters", "roundness"), -0.01, f"{ITEM}.parameters.roundness is -0.01"),
    (in_frustum("parameters", "bulge"), -1.01, f"{ITEM}.parameters.bulge is -1.01"),
    (in_frustum("parameters", "onion"), 1.01, f"{ITEM}.parameters.onion is 1.01"),
    (
        in_frustum("parameters", "dilation"),
        -1e-9,
        f"{ITEM}.parameters.dilation is -1e-09; it must be 0",
    ),
    (in_frustum("parameters", "size"), 1.0, f"{ITEM}.parameters.size is 1.0; it must be a list of 3 numbers"),
    (in_frustum("parameters", "size"), [1, 1], f"{ITEM}.parameters.size has 2 values; it must have 3"),
    (in_frustum("parameters", "size", 1), -0.5, f"{ITEM}.parameters.size[1] is -0.5; it must be 0 or more"),
    (in_frustum("parameters", "size"), "abc", f"{ITEM}.parameters.size is"),
    (in_frustum("parameters", "length"), 1, f'{ITEM}.parameters has an unknown field "length"'),
    (in_frustum("blend"), -0.1, f"{ITEM}.blend is -0.1; it must be 0 or more"),
    (in_frustum("blend"), None, f"{ITEM}.blend is null; it must be a number"),
    (in_frustum("color"), REMOVE, f"{ITEM}.color is missing"),
    (in_frustum("color"), "red", f'{ITEM}.color is "red"; it must look like'),
    (in_frustum("visible"), True, f"{ITEM}.visible is not a known field"),
]


def refusal(path: Path, content: bytes) -> str:
    """The sentence with which these bytes are refused; it is one line and names the file."""
    path.write_bytes(content)
    with pytest.raises(AssemblyError) as caught:
        Assembly.load(path)
    sentence = str(caught.value)
    assert "\n" not in sentence and len(sentence) < 400
    assert sentence.startswith(f"{path}: ")
    assert caught.value.exit_code == 2
    return sentence.removeprefix(f"{path}: ")


@pytest.mark.parametrize(("path", "value", "sentence"), WRONG_FIELDS, ids=lambda value: str(value)[:40])
def test_wrong_fields_are_named(path: list[str | int], value: Any, sentence: str, tmp_path: Path) -> None:
    content = json.dumps(changed(path, value)).encode()
    assert refusal(tmp_path / "wrong.json", content).startswith(sentence)


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999", "-1e999"])
def test_numbers_that_are_not_finite(number: str, tmp_path: Path) -> None:
    text = json.dumps(changed(in_frustum("parameters", "taper"), 12345)).replace("12345", number)
    assert "finite" in refusal(tmp_path / "wrong.json", text.encode())
    text = json.dumps(changed(in_frustum("translation"), [0, 12345, 0])).replace("12345", number)
    assert "finite" in refusal(tmp_path / "wrong.json", text.encode())


WRONG_BYTES = [
    (b"", "empty"),
    (b"  \n", "empty"),
    (b"{", "not JSON"),
    (b"solid cube\nfacet", "not JSON"),
    (b"[]", "must be a JSON object"),
    (b"3", "must be a JSON object"),
    (b"null", "must be a JSON object"),
    (b'"text"', "must be a JSON object"),
    (b"{}", "format is missing"),
    (b"\x89PNG\r\n\x1a\n\x00\xff", "not text"),
    (bytes(range(256)), "not text"),
    (b"[" * 200_000, "nested too deeply"),
    (b'{"a": ' * 200_000, "nested too deeply"),
    (b'{"format": 1, "format": 2}', "twice"),
    (b'{"format": ' + b"9" * 5000 + b"}", "too many digits"),
    (b'{"format": "resfit-assembly", "version": 1, "\\ud800": 1}', "Unicode"),
]


@pytest.mark.parametrize(("content", "part"), WRONG_BYTES, ids=lambda value: repr(value)[:24])
def test_files_that_are_no_assemblies(content: bytes, part: str, tmp_path: Path) -> None:
    assert part in refusal(tmp_path / "wrong.json", content)


@pytest.mark.parametrize("depth", [62, 985, 100_000])
def test_options_nested_deeply(depth: int, tmp_path: Path) -> None:
    (tmp_path / "good.json").write_bytes(Assembly().to_json())
    text = (
        (tmp_path / "good.json")
        .read_text()
        .replace('"provenance": {}', '"provenance": {"options": {"x": DEEP}}')
    )
    path = tmp_path / "deep.json"
    path.write_text(text.replace("DEEP", "[" * (depth - 3) + "]" * (depth - 3)))
    if depth < 64:
        assert Assembly.load(path).to_json() == Assembly.from_json(Assembly.load(path).to_json()).to_json()
        return
    with pytest.raises(AssemblyError, match="nested too deeply"):
        Assembly.load(path)


def test_giant_files_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "giant.json"
    with path.open("wb") as stream:
        stream.truncate(MAX_BYTES * 1000)
    with pytest.raises(AssemblyError, match="larger than 32 MiB"):
        Assembly.load(path)


def test_places_without_a_file(tmp_path: Path) -> None:
    with pytest.raises(AssemblyError, match="No such file"):
        Assembly.load(tmp_path / "missing.json")
    with pytest.raises(AssemblyError, match="is a folder"):
        Assembly.load(tmp_path)
    with pytest.raises(AssemblyError, match="not a valid path"):
        Assembly.load("a\0b")
    os.mkfifo(tmp_path / "pipe.json")
    with pytest.raises(AssemblyError, match="no regular file"):
        Assembly.load(tmp_path / "pipe.json")


def test_saved_bytes_load_and_save_again_the_same(tmp_path: Path) -> None:
    path = tmp_path / "good.json"
    path.write_text(json.dumps(good_document()))
    assembly = Assembly.load(path)
    assembly.save(path)
    again = Assembly.load(path)
    assert again == assembly
    assert again.to_json() == path.read_bytes()
    assert json.loads(path.read_bytes()) == good_document()


def test_every_family_table_bound_is_legal(tmp_path: Path) -> None:
    for family in FAMILIES.values():
        for entry in family.parameters:
            for bound in entry.legal:
                if abs(bound) < 1e30:
                    value = [bound] * entry.count if entry.count > 1 else bound
                    document = changed(["primitives", family.index, "parameters", entry.name], value)
                    path = tmp_path / "bound.json"
                    path.write_text(json.dumps(document))
                    Assembly.load(path)


def test_byte_order_mark_and_empty_provenance(tmp_path: Path) -> None:
    path = tmp_path / "bom.json"
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(good_document() | {"provenance": {}}).encode())
    assert Assembly.load(path).provenance.options == {}


def test_the_readme_shows_a_valid_file(tmp_path: Path) -> None:
    readme = (Path(__file__).resolve().parents[2] / "README.md").read_text()
    path = tmp_path / "readme.json"
    path.write_text(readme.partition("```json\n")[2].partition("```")[0])
    assert [primitive.name for primitive in Assembly.load(path).primitives] == ["base"]


def test_shipped_schema_is_up_to_date() -> None:
    assert SCHEMA_PATH.read_bytes() == schema_bytes(), "run `make schema`"


def test_schema_lists_every_field_of_every_family() -> None:
    schema = assembly_schema()
    document = good_document()
    assert set(schema["required"]) == set(document)
    for primitive in document["primitives"]:
        entry = schema["$defs"][primitive["family"]]
        assert set(entry["required"]) == set(primitive)
        parameters = entry["properties"]["parameters"]
        assert parameters["required"] == list(primitive["parameters"])
        assert parameters["additionalProperties"] is entry["additionalProperties"] is False
    taper = schema["$defs"]["superfrustum"]["properties"]["parameters"]["properties"]["taper"]
    assert (taper["minimum"], taper["maximum"]) == (0.0, 2.0)
