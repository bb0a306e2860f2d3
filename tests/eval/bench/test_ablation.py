"""Variants of our fit, the studies made of them, and sentences that follow the numbers."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest
import trimesh

from resfit.cli import main
from resfit.errors import InputError
from resfit.eval.batch import compare
from resfit.eval.bench.ablation import OPTIMIZER, STUDIES, check_studies, ours, whole
from resfit.eval.bench.ablation_report import UNFINISHED, common_rows, markdown, say
from resfit.eval.methods import find_method, split_methods
from resfit.eval.methods.ours import configuration, known_options

STAND_IN = """
import sys
from resfit.assembly.assembly import Assembly
from resfit.assembly.primitive import Pose, Primitive
from resfit.assembly.transform import Transform
method, mesh, out = sys.argv[1:]
with open(out + "/../../calls.txt", "a") as calls:
    calls.write(method + "\\n")
if "coacd" in method and "rounds=1" in method:
    sys.exit("resfit: this is too hard.")
width = 0.9 if "cuboid" in method else 1.0
part = Primitive("cuboid", "a", Pose(), {"size": (1.8 * width, 0.9, 0.9)})
Assembly((part,), Transform(10.0)).save(out + "/assembly.json")
"""


def row(method: str, mesh: str = "a", **values: Any) -> dict[str, Any]:
    usual = {
        "status": "ok", "closed": True, "mesh": mesh, "method": method, "iou": 0.9, "bisurf_iou": 0.8,
        "primitive_count": 10, "overlap": 0.1, "unoverlap": 0.01, "floats": 150, "cpu_s": 5.0,
    }  # fmt: skip
    return usual | values


def test_variants_change_fields_of_the_configuration() -> None:
    method = find_method(
        "ours-fast:union=hard,propose.splits=0,optimizer=adam,adam.axis=learned,parsimony=0.01"
    )
    config = configuration(method.options)
    assert (config.preset, config.union, config.propose.splits, config.adam.axis) == (
        "fast",
        "hard",
        0,
        "learned",
    )
    assert (
        config.parsimony == 0.01
        and config.propose.regions == configuration({"preset": "fast"}).propose.regions
    )
    assert configuration({"rounds": 2}).rounds == 2 and configuration({"rounds": "2"}).rounds == 2
    assert {"excursions", "refine.overlap", "select.beam"} <= set(known_options(config))
    assert "refine.betas" not in known_options(config), "two numbers are no scalar"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("ours:cake=1", "no option cake; there are: preset"),
        ("ours:refine.betas=1", "no option refine.betas"),
        ("ours:cake.size=1", "no option cake.size"),
        ("ours:union=loose", "choose smooth, hard"),
        ("ours:excursions=some", "a whole number"),
        ("ours:rounds=0", "rounds"),
        ("ours:adam.axis=learned", "adam has no effect with --optimizer levenberg"),
        ("ours:primitive=blob", "no such family"),
        ("ours:preset=slow", "preset"),
        ("ours:rounds", "key=value"),
        ("theirs:rounds=1", "no method theirs"),
    ],
)
def test_mistakes_in_a_variant_are_one_sentence(text: str, said: str) -> None:
    with pytest.raises(InputError, match=re.escape(said)) as error:
        configuration(find_method(text).options)
    assert "\n" not in str(error.value)


def test_lists_of_methods_may_hold_variants() -> None:
    assert split_methods("mps, ours:a=1,b.c=2,coacd,ours:d=3") == [
        "mps",
        "ours:a=1,b.c=2",
        "coacd",
        "ours:d=3",
    ]
    assert split_methods("ours,,mps") == ["ours", "mps"]


def test_every_variant_of_every_study_is_legal_and_named_once() -> None:
    assert ours(union="smooth", rounds=2) == "ours:rounds=2" and ours(union="smooth") == "ours"
    assert whole(rounds=1) == "ours:rounds=1,per_part=off"
    for study in STUDIES.values():
        for variant in study.variants:
            configuration(find_method(variant.method).options)
        assert len({variant.label for variant in study.variants}) == len(study.variants)
    with pytest.raises(InputError, match="no study 'all'"):
        check_studies(["all"])


@pytest.mark.parametrize("name", STUDIES)
def test_sentences_follow_the_numbers(name: str) -> None:
    study = STUDIES[name]
    for better in (0, len(study.variants) - 1):
        rows = [
            row(variant.method, iou=0.9 + 0.05 * (place == better), primitive_count=10 + place)
            for place, variant in enumerate(study.variants)
        ]
        first, second = say(study, common_rows(study, rows))
        assert re.search(r"\d", first) and re.search(r"\d", second) and "nan" not in first + second
        if name == "primitive":
            assert first.startswith(
                ("Cuboid, smooth", "Superfrustum, hard")[better > 0] + " has the highest mean IoU"
            )
        if name == "optimizer" and not better:
            assert "Adam is 5.00 points of mean IoU below Levenberg (90.00 against 95.00)" in first
    same = say(study, common_rows(study, [row(variant.method) for variant in study.variants]))
    assert "above" not in " ".join(same) and "below" not in " ".join(same)


def test_only_meshes_that_every_row_finished_count() -> None:
    methods = [variant.method for variant in OPTIMIZER.variants]
    rows = [row(method, mesh) for mesh in ("a", "b") for method in methods]
    rows[-1] |= {"status": "timeout", "error": "it took too long"}
    assert {found["mesh"] for found in common_rows(OPTIMIZER, rows)} == {"a"}
    text = markdown({"optimizer": rows})
    assert "Mean over the 1 closed mesh that every row finished" in text and "it took too long" in text
    assert say(OPTIMIZER, common_rows(OPTIMIZER, rows[:2])) == [UNFINISHED]


def test_the_command_goes_on_from_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    script, out = tmp_path / "stand_in.py", tmp_path / "out"
    script.write_text(STAND_IN)
    monkeypatch.setattr(compare, "WARM", "")
    monkeypatch.setattr(
        compare.Comparison,
        "command",
        lambda self, method, mesh, folder: [sys.executable, str(script), method, str(mesh), str(folder)],
    )
    trimesh.creation.box((18.0, 9.0, 9.0)).export(tmp_path / "box.stl")
    command = ["bench", "ablation", str(tmp_path / "box.stl"), "-o", str(out), "--studies"]
    assert main([*command, "primitive"]) == 0
    assert main([*command, "primitive,rounds"]) == 3, "one variant fails"
    calls = (out / "calls.txt").read_text().split()
    assert len(calls) == len(set(calls)) == 8 + 3, "the variant that both studies have is fitted once"
    shown = capsys.readouterr()
    assert (
        "superfrustum, smooth is" in shown.out
        and UNFINISHED in shown.out
        and "1 of 12 fits failed" in shown.err
    )
    text = (out / "ablation.md").read_text()
    assert "## Primitive family and union" in text and "this is too hard" in text
    assert re.search(r"\| cuboid, smooth \| (89|90|91)\.", text)
    assert "\\begin{tabular}" in (out / "ablation.tex").read_text()
    assert len([json.loads(line) for line in (out / "rows.jsonl").read_text().splitlines()]) == 11
    assert main(["bench", "kernels", str(tmp_path / "box.stl")]) == 2
    assert main(["bench", "ablation"]) == 2
    assert main([*command, "all"]) == 2
