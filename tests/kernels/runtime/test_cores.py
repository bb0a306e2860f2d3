"""How many cores are used: RESFIT_THREADS within reason."""

from __future__ import annotations

import pytest

from resfit.kernels.runtime.cores import MOST_THREADS, core_count


@pytest.mark.parametrize("asked", ["1", "3", " 5 ", "007", str(MOST_THREADS)])
def test_a_number_is_taken(asked: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RESFIT_THREADS", asked)
    assert core_count() == int(asked)


@pytest.mark.parametrize("asked", ["", "0", "-1", "abc", "²", "1.5", "٣", "1e3"])
def test_what_is_no_number_from_1_counts_as_unset(asked: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RESFIT_THREADS", raising=False)
    present = core_count()
    monkeypatch.setenv("RESFIT_THREADS", asked)
    assert core_count() == present >= 1


@pytest.mark.parametrize("asked", ["1000000", "999999999999", "9" * 5000])
def test_huge_numbers_start_no_threads_for_ever(asked: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RESFIT_THREADS", raising=False)
    present = core_count()
    monkeypatch.setenv("RESFIT_THREADS", asked)
    assert core_count() == max(present, MOST_THREADS)
