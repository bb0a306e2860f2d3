"""The options of a fit as the command line reads them."""

from __future__ import annotations

from typing import Any

import pytest

import resfit.cli
from resfit.cli import fit as command
from resfit.cli.fit_options import values
from resfit.fitter.config import CHOICES, PUBLIC, TYPES

EXAMPLES: dict[Any, Any] = {int: 3, float: 0.5, str: "cpu"}
"""A value of each type that is no word of a few."""


def test_flags_are_the_values_that_they_stand_for() -> None:
    assert values({"snap": True, "per_part": False, "seed": 3}) == {
        "snap": True,
        "per_part": "off",
        "seed": 3,
    }
    assert values({"per_part": True}) == {"per_part": "on"} and values(None) == {}


@pytest.mark.parametrize("name", list(PUBLIC))
def test_every_option_arrives(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = PUBLIC[name]
    value = next(iter(entry.flags.values()), None) or next(iter(CHOICES.get(name, ())), None)
    value = value if value is not None else EXAMPLES[TYPES[name]]
    seen: list[dict[str, Any]] = []

    def run_fit(mesh: Any, folder: Any, progress: Any, options: dict[str, Any], *more: Any) -> int:
        seen.append(options)
        return 0

    monkeypatch.setattr(command, "run_fit", run_fit)
    assert resfit.cli.main(["fit", "a.glb", *entry.words(value)]) == 0
    assert seen == [{name: value, "init": None, "objective": None}]


def test_help_shows_every_option(capsys: pytest.CaptureFixture[str]) -> None:
    texts = []
    for flag in ("--help", resfit.cli.HELP_ALL):
        assert resfit.cli.main(["fit", flag]) == 0
        texts.append(" ".join(capsys.readouterr().out.replace("│", " ").split()))
    for entry in PUBLIC.values():
        # Long flags stand on lines of their own, and helps are broken; their first words are not.
        first = " ".join(entry.help.split()[:4])
        assert (first in texts[0]) != entry.rare and first in texts[1]
        assert all(flag in texts[1] for flag in entry.flags or [entry.spelled()])
