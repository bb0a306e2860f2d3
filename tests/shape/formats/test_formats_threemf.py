"""3MF: components and build items where they are placed, what is left out named, and nothing unpacked without limit."""

from __future__ import annotations

import io
import random
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from resfit.errors import InputError
from resfit.shape.formats import threemf, unpacking
from resfit.shape.formats.mesh_file import MeshFile
from resfit.shape.load import load_mesh

DATA = Path(__file__).resolve().parents[2] / "data" / "field_inputs"

CORE = 'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"'
PRODUCTION = 'xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06"'
CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
TRIANGLES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))


def mesh(number: int, attributes: str = "", extra: str = "") -> str:
    """An object that is a tetrahedron of edge 1 in the corner of the axes."""
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in CORNERS)
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}" pid="7"/>' for a, b, c in TRIANGLES)
    return (
        f'<object id="{number}" {attributes}><mesh><vertices>{vertices}</vertices>'
        f"<triangles>{triangles}</triangles>{extra}</mesh></object>"
    )


def group(number: int, *components: str, attributes: str = "") -> str:
    """An object of components, each given by its attributes."""
    inside = "".join(f"<component {component}/>" for component in components)
    return f'<object id="{number}" {attributes}><components>{inside}</components></object>'


def model(resources: str, *items: str, attributes: str = "", before: str = "") -> str:
    build = "".join(f"<item {item}/>" for item in items)
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>{before}<model {CORE} {PRODUCTION} {attributes}>'
        f"<resources>{resources}</resources><build>{build}</build></model>"
    )


def write(path: Path, root: str | bytes, **parts: str | bytes) -> Path:
    """A 3MF file without the list of parts, which many programs leave out."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", root)
        for name, content in parts.items():
            archive.writestr(f"3D/Objects/{name}.model", content)
    return path


def read(folder: Path, root: str | bytes, **parts: str | bytes) -> MeshFile:
    return threemf.read(write(folder / "x.3mf", root, **parts))


def bounds(file: MeshFile) -> list[list[list[float]]]:
    return [
        [piece.vertices.min(axis=0).tolist(), piece.vertices.max(axis=0).tolist()] for piece in file.pieces
    ]


@pytest.mark.parametrize("name", ["mf_box.3mf", "mf_production.3mf"])
def test_field_inputs_are_boxes_in_millimetres(name: str) -> None:
    assert threemf.read(DATA / name).unit == "mm"
    loaded = load_mesh(DATA / name)
    assert (len(loaded.vertices), len(loaded.faces), loaded.reader) == (8, 12, "resfit")
    assert np.ptp(loaded.vertices, axis=0).tolist() == [10.0, 10.0, 10.0]


def test_items_and_components_are_placed(tmp_path: Path) -> None:
    moved, twice = 'transform="1 0 0 0 1 0 0 0 1 {} 0 0"', 'transform="2 0 0 0 2 0 0 0 2 0 0 0"'
    root = model(
        mesh(1, 'name="tip"')
        + group(2, 'objectid="1"', f'objectid="1" {moved.format(3)}', attributes='name="pair"'),
        f'objectid="2" {twice}',
        f'objectid="1" {moved.format(9)}',
    )
    file = read(tmp_path, root)
    assert bounds(file) == [[[0, 0, 0], [2, 2, 2]], [[6, 0, 0], [8, 2, 2]], [[9, 0, 0], [10, 1, 1]]]
    assert [piece.name for piece in file.pieces] == ["tip", "tip 2", "tip 3"]
    assert file.notes == ()


def test_mirrored_items_keep_their_outside(tmp_path: Path) -> None:
    (piece,) = read(tmp_path, model(mesh(1), 'objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"')).pieces
    assert trimesh.Trimesh(piece.vertices, piece.faces).volume == pytest.approx(1 / 6)


def test_names_come_from_the_nearest_that_has_one(tmp_path: Path) -> None:
    root = model(
        mesh(1)
        + mesh(2, 'partnumber="P-7"')
        + group(3, 'objectid="1"', 'objectid="2"', attributes='name="arm"'),
        'objectid="3"',
        'objectid="1" partnumber="spare"',
        'objectid="1"',
    )
    assert [piece.name for piece in read(tmp_path, root).pieces] == ["arm", "P-7", "spare", "object 1"]


def test_other_model_parts_are_read(tmp_path: Path) -> None:
    inner = model(mesh(4, 'name="far"') + group(5, 'objectid="4"'))
    file = read(
        tmp_path,
        model(group(1, 'objectid="5" p:path="/3D/Objects/Inner.model"'), 'objectid="1"'),
        inner=inner,
    )
    assert [piece.name for piece in file.pieces] == ["far"]


def test_the_list_of_parts_names_the_root(tmp_path: Path) -> None:
    path = tmp_path / "x.3mf"
    kind = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "_rels/.rels", f'<Relationships><Relationship Type="{kind}" Target="/B.model"/></Relationships>'
        )
        archive.writestr("A.model", model(mesh(1, 'name="a"'), 'objectid="1"'))
        archive.writestr("B.model", model(mesh(1, 'name="b"'), 'objectid="1"', attributes='unit="inch"'))
    file = threemf.read(path)
    assert ([piece.name for piece in file.pieces], file.unit) == (["b"], "in")


def test_supports_and_modifiers_are_left_out_and_counted(tmp_path: Path) -> None:
    resources = mesh(1) + mesh(2, 'type="support"') + mesh(3, 'type="other"') + mesh(4, 'type="surface"')
    root = model(resources + group(5, *(f'objectid="{k}"' for k in (1, 2, 3, 4))), 'objectid="5"')
    file = read(tmp_path, root)
    assert [piece.name for piece in file.pieces] == ["object 1", "object 4"]
    assert file.notes == ("2 support structures were left out.",)
    with pytest.raises(InputError, match="support structures only"):
        read(tmp_path, model(mesh(2, 'type="support"'), 'objectid="2"'))


def test_a_file_that_builds_nothing_gives_all_objects(tmp_path: Path) -> None:
    file = read(tmp_path, model(mesh(1) + mesh(2, 'name="two"') + group(3, 'objectid="1"')))
    assert [piece.name for piece in file.pieces] == ["two", "object 1"]
    assert len(file.notes) == 1 and "to be built" in file.notes[0]


def test_what_is_no_triangle_is_named(tmp_path: Path) -> None:
    lattice = '<b:beamlattice xmlns:b="urn:b"><b:beams><b:beam v1="0" v2="1"/></b:beams></b:beamlattice>'
    vertices = '<s:vertices><s:vertex x="0" y="0"/></s:vertices>'
    slices = f'<s:slicestack xmlns:s="urn:s" id="9"><s:slice>{vertices}</s:slice></s:slicestack>'
    file = read(tmp_path, model(mesh(1, extra=lattice) + slices, 'objectid="1"'))
    assert file.notes == ("The file holds a beam lattice and slices, of which only the triangles were read.",)
    assert len(file.pieces[0].vertices) == 4
    implicit = '<object id="1"><v:levelset xmlns:v="urn:v" functionid="3"/></object>'
    with pytest.raises(InputError, match="holds an implicit shape but no triangles"):
        read(tmp_path, model(implicit, 'objectid="1"'))


def nested(levels: int) -> str:
    """Objects of which each holds the one before ten times."""
    return mesh(1) + "".join(group(k + 2, *([f'objectid="{k + 1}"'] * 10)) for k in range(levels))


ENTITIES = '<!DOCTYPE m [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]>'


@pytest.mark.parametrize(
    ("root", "said"),
    [
        (model("", before=ENTITIES), "declares a document type"),
        (model(mesh(1), 'objectid="1"')[:-300], "is damaged in line 1"),
        (model(mesh(1), 'objectid="1"').replace('x="1"', 'x="1,5"'), "is damaged in line 1"),
        (model(mesh(1), 'objectid="1"').replace('v3="2"', ""), "is damaged in line 1"),
        (model(mesh(1) * 2, 'objectid="1"'), "is damaged in line 1"),
        (model(mesh(1), 'objectid="1" transform="1 0 0"'), "is damaged in line 1"),
        (model(mesh(1), 'objectid="8"'), "places an object 8 that is not in it"),
        (model(mesh(1), 'objectid="1" p:path="/3D/none.model"'), "names a part '3d/none.model'"),
        (model(group(1, 'objectid="1"'), 'objectid="1"'), "objects within objects without end"),
        (model(nested(9), 'objectid="10"'), "asks for 4,000,000,000 triangles"),
        (model(mesh(1), 'objectid="1"') + " " * (4 << 20), "unpacks to more than 100 times its size"),
    ],
    ids=lambda value: "" if len(value) > 100 else value,
)
def test_damaged_and_hostile_files_end_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, root: str, said: str
) -> None:
    monkeypatch.setattr(unpacking, "ALWAYS", 1 << 20)
    with pytest.raises(InputError, match=said) as caught:
        read(tmp_path, root)
    assert "x.3mf" in str(caught.value) and str(caught.value).endswith(".")


def test_what_is_no_3mf_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.3mf"
    path.write_bytes((DATA / "mf_box.3mf").read_bytes()[:-80])
    with pytest.raises(InputError, match="is no 3MF file, or its end is missing"):
        threemf.read(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("part.stl", "solid")
    with pytest.raises(InputError, match="is a ZIP archive without a 3D model"):
        threemf.read(path)


def mutated(chance: random.Random, content: bytes) -> bytes:
    """Bytes changed, cut out or put in; and numbers changed, where there are any."""
    found = bytearray(content)
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(len(found))
        numbers = list(re.finditer(rb"\d+", found))
        if numbers and chance.random() < 0.5:
            number = chance.choice(numbers)
            found[number.start() : number.end()] = chance.choice(
                (b"-1", b"0", b"2", b"4294967296", b"9" * 400, b"nan")
            )
        else:
            found[at : at + chance.choice((0, 1, 20))] = chance.choice(
                (b"", b"<", b'"', b"&x;", chance.randbytes(3))
            )
    return bytes(found)


def test_mutated_files_are_read_or_refused(tmp_path: Path) -> None:
    chance = random.Random(0)
    root = model(mesh(1) + group(2, 'objectid="1"', 'objectid="1"'), 'objectid="2"').encode()
    whole = (DATA / "mf_production.3mf").read_bytes()
    path = tmp_path / "x.3mf"
    for _ in range(400):
        if chance.random() < 0.5:
            write(path, mutated(chance, root))
        else:
            path.write_bytes(mutated(chance, whole))
        try:
            threemf.read(path)
        except InputError as error:
            assert "x.3mf" in str(error)


def test_sizes_that_lie_are_found(tmp_path: Path) -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", model(mesh(1), 'objectid="1"'))
        size = archive.infolist()[0].file_size
    content = stream.getvalue()
    path = tmp_path / "x.3mf"
    path.write_bytes(content.replace(size.to_bytes(4, "little"), (100).to_bytes(4, "little")))
    with pytest.raises(InputError, match=r"damaged"):
        threemf.read(path)


@pytest.mark.parametrize(
    ("attributes", "said"),
    [
        ('xmlns:v="http://vendor.example/shapes" requiredextensions="p v"', "http://vendor.example/shapes"),
        ('unit="parsec"', "unknown unit, 'parsec'"),
    ],
)
def test_what_the_model_requires_and_is_not_known_is_refused(
    tmp_path: Path, attributes: str, said: str
) -> None:
    path = write(tmp_path / "odd.3mf", model(mesh(1), 'objectid="1"', attributes=attributes))
    with pytest.raises(InputError, match=said):
        threemf.read(path)
