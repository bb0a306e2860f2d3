"""Small hostile files: each is read or refused in one sentence, whatever its numbers, headers and references claim.

Larger and damaged ones are for `make fuzz`.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fuzz import archive_cases, gltf_cases, mesh_cases
from fuzz.assemblies import check_page
from fuzz.assembly_cases import BOX, FRUSTUM, NAMES, changed, document, text_of
from fuzz.harness import Case
from fuzz.samples import CORNERS, glb, gltf, obj, off, ply, stl, tetrahedron

from resfit import Assembly, export
from resfit.errors import InputError
from resfit.shape.load import load_mesh

SMALL = 100_000
"""Bytes."""


@pytest.mark.parametrize(
    "source",
    [
        mesh_cases.number_cases, mesh_cases.header_cases, mesh_cases.obj_cases, mesh_cases.other_cases,
        mesh_cases.shape_cases, gltf_cases.node_cases, gltf_cases.length_cases, gltf_cases.index_cases,
        gltf_cases.feature_cases, gltf_cases.document_cases, archive_cases.xml_cases,
    ],
)  # fmt: skip
def test_files_are_read_or_refused_in_one_sentence(
    tmp_path: Path, source: Callable[[], Iterator[Case]]
) -> None:
    wrong, outcomes = {}, Counter()
    for case in source():
        if len(case.data) > SMALL:
            continue
        path = tmp_path / f"m.{case.suffix}"
        path.write_bytes(case.data)
        try:
            load_mesh(path)
            outcomes["read"] += 1
        except InputError as error:
            outcomes["refused"] += 1
            if "\n" in str(error) or not str(error).endswith(".") or path.name not in str(error):
                wrong[case.name] = str(error)
        except Exception as error:
            wrong[case.name] = repr(error)
    assert wrong == {}
    assert outcomes["refused"] > 0


def test_the_same_files_are_read_where_nothing_is_wrong(tmp_path: Path) -> None:
    good = {
        "stl": stl(tetrahedron()),
        "obj": obj(CORNERS),
        "off": off(CORNERS),
        "ply": ply(),
        "glb": glb(),
        "gltf": gltf(),
    }
    for suffix, content in good.items():
        path = tmp_path / f"m.{suffix}"
        path.write_bytes(content)
        assert (len(load_mesh(path).vertices), len(load_mesh(path).faces)) == (4, 4)


def test_no_name_leaves_its_place_in_a_page(tmp_path: Path) -> None:
    loaded = 0
    for name in NAMES:
        try:
            assembly = Assembly.from_json(text_of(document(changed(BOX, name=name), FRUSTUM)))
        except InputError:
            continue
        loaded += 1
        export(assembly, tmp_path / "page.html")
        check_page(tmp_path / "page.html", assembly)
    assert loaded > len(NAMES) // 2


def test_names_that_cannot_be_printed_are_refused() -> None:
    for name in ("a\nb", "a\0b", "\ud800", "\u2028", "x\u202ey"):
        with pytest.raises(InputError):
            Assembly.from_json(json.dumps(document(changed(BOX, name=name))).encode())
