"""The table of options: keywords and command line agree with it, and nothing in it is without effect unsaid."""

from __future__ import annotations

import math
import subprocess
import sys
from typing import Any, get_type_hints

import pytest

from resfit.errors import InputError
from resfit.fitter.config import CHOICES, OPTIONS, PUBLIC, TYPES, FitConfig, FitOptions, preset_config
from resfit.fitter.option import Interval, Option
from resfit.fitter.presets import AdamConfig, SelectConfig
from resfit.kernels.primitives import FAMILIES


def test_keywords_are_those_of_the_table() -> None:
    """`fit` has the preset as a keyword of its own."""
    expected = {name: TYPES[name] | None for name in PUBLIC if name != "preset"}
    assert get_type_hints(FitOptions) == expected


def test_families_are_named_in_their_help() -> None:
    assert all(name in PUBLIC["primitive"].help for name in FAMILIES)


def test_other_options_that_an_entry_names_exist() -> None:
    for entry in OPTIONS.values():
        for name, value in entry.idle_with.items():
            assert value in CHOICES[name]


@pytest.mark.parametrize("name", [name for name, entry in PUBLIC.items() if entry.flags])
def test_flags_stand_for_values(name: str) -> None:
    for value in PUBLIC[name].flags.values():
        assert getattr(FitConfig(**{name: value}), name) == value  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"optimizer": "sgd"}, "--optimizer sgd: there is no such choice; choose levenberg, adam."),
        ({"per_part": "maybe"}, "--per-part maybe: there is no such choice; choose auto, on, off."),
        ({"preset": "slow"}, "--preset slow: there is no such preset; choose fast, balanced, best."),
        ({"target_iou": 0.0}, "--target-iou 0.0 is out of range; it must be above 0 and at most 1."),
        ({"parsimony": math.nan}, "--parsimony nan is out of range; it must be at least 0 and below 1."),
        ({"seed": "one"}, "--seed one is out of range; it must be a whole number, at least 0."),
        (
            {"max_primitives": 2.5},
            "--max-primitives 2.5 is out of range; it must be a whole number, at least 1.",
        ),
        ({"rounds": 101}, "--rounds 101 is out of range; it must be a whole number, between 1 and 100."),
    ],
)
def test_values_are_checked(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError) as error:
        FitConfig(**options)
    assert str(error.value) == sentence


def test_options_without_effect_are_refused_by_name() -> None:
    preset_config("fast", optimizer="adam", adam=AdamConfig(steps=3)).check_effect()
    preset_config("best", per_part="on").check_effect()
    with pytest.raises(InputError, match=r"^adam has no effect with --optimizer levenberg"):
        preset_config("fast", adam=AdamConfig(steps=3)).check_effect()
    with pytest.raises(InputError, match=r"^select has no effect with --optimizer adam"):
        preset_config("fast", optimizer="adam", select=SelectConfig(beam=1)).check_effect()
    with pytest.raises(InputError, match=r"^--tolerance has no effect with --per-part;"):
        preset_config("fast", per_part="on", tolerance=0.1).check_effect()


def test_intervals() -> None:
    inside = Interval(least=0, below=1)
    assert [value in inside for value in (0, 0.5, 1, -1, math.nan, "0", None)] == [True, True, *[False] * 5]
    assert str(Interval(least=1)) == "at least 1"


def test_words_of_a_command() -> None:
    assert PUBLIC["max_primitives"].words(9) == ["--max-primitives", "9"]
    assert PUBLIC["per_part"].words("off") == ["--whole"] and PUBLIC["per_part"].words("auto") == []
    assert Option(name="probes").spelled() == "probes"


def test_the_table_loads_no_kernel() -> None:
    """Modules of commands import it, and their help is quick."""
    code = "import sys, resfit.fitter.config; assert not {'warp', 'numpy'} & set(sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
