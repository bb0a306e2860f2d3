"""The harness of `make fuzz`: workers that crash, hang or eat memory are told apart, and faults are kept."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fuzz.__main__ import campaigns
from fuzz.campaigns import Tally, run_campaign
from fuzz.damage import damaged_bytes, damaged_document, damaged_gltf, places_in
from fuzz.harness import Campaign, Case, Skip, Worker, Wrong, descendants
from fuzz.samples import glb, gltf

from resfit.errors import InputError

pytestmark = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs Linux")

MEMORY = 3.0e8
ADDRESS_SPACE = 8 << 30


def misbehave(case: Case, folder: Path) -> str | None:
    """Do what the case is called; runs in the worker."""
    (folder / "file").write_bytes(case.data)
    return ACTIONS[case.name]() if case.name in ACTIONS else str(os.getpid())


def fail(error: Exception) -> None:
    raise error


def hang() -> None:
    # The process that it started, in a session of its own, must end with it.
    subprocess.run(
        [sys.executable, "-c", "import time; time.sleep(600)"], start_new_session=True, check=False
    )


ACTIONS: dict[str, Callable[[], str | None]] = {
    "refuse": lambda: fail(InputError("no.")),
    "refuse at length": lambda: fail(InputError("no\nand no.")),
    "raise": lambda: fail(KeyError("x")),
    "wrong": lambda: fail(Wrong("not right")),
    "skip": lambda: fail(Skip("no root")),
    "crash": lambda: os.kill(os.getpid(), signal.SIGSEGV),
    "exit": lambda: os._exit(3),
    "hang": hang,
    "eat": lambda: str(len(b"x" * int(2 * MEMORY))),
    "ask for all": lambda: str(len(bytes(2 * ADDRESS_SPACE))),
}


def three(rng: random.Random) -> Iterator[Case]:
    """A large case, a small one of the same fault, and a good one."""
    yield Case("raise", b"x" * 10, "bin")
    yield Case("raise", b"y", "bin")
    yield Case("good")


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    made = Worker(Campaign("test", three, misbehave, 3.0, MEMORY, ADDRESS_SPACE))
    yield made
    made.close()


@pytest.mark.parametrize(
    ("name", "kind", "text"),
    [
        ("good", "ok", ""),
        ("refuse", "refused", "no."),
        ("refuse at length", "wrong", "more than one sentence"),
        ("raise", "raw", "KeyError"),
        ("wrong", "wrong", "not right"),
        ("skip", "skipped", "no root"),
        ("crash", "crash", "SIGSEGV"),
        ("exit", "crash", "exit code 3"),
        ("hang", "hang", "not done"),
        ("eat", "memory", "0.6 GB"),
        ("ask for all", "memory", "MemoryError"),
    ],
)
def test_outcomes_are_told_apart(worker: Worker, name: str, kind: str, text: str) -> None:
    found = worker.run(Case(name))
    assert found.kind == kind and text in found.text
    assert found.fault == (kind not in ("ok", "refused", "skipped"))
    assert kind != "raw" or "test_fuzz_harness.py" in found.where


def test_the_worker_goes_on_after_a_refusal_and_is_replaced_after_a_crash(worker: Worker) -> None:
    first = worker.run(Case("good")).text
    assert worker.run(Case("refuse")).kind == "refused"
    assert worker.run(Case("good")).text == first
    assert worker.run(Case("crash")).kind == "crash"
    assert worker.run(Case("good")).text not in ("", first)


def test_nothing_lives_on_and_nothing_is_left(worker: Worker) -> None:
    process = int(worker.run(Case("good")).text)
    assert process in descendants(os.getpid())
    assert worker.run(Case("hang")).kind == "hang"
    assert process not in descendants(os.getpid())
    assert list(worker._base.iterdir()) == []


def test_the_smallest_input_of_a_fault_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tally = run_campaign(Campaign("test", three, misbehave), 0, 60.0, "", tmp_path)
    assert (tally.fault_count, tally.counts["ok"]) == (2, 1)
    assert [path.read_bytes() for path in (tmp_path / "test").glob("*.bin")] == [b"y"]
    assert "KeyError" in next((tmp_path / "test").glob("*.txt")).read_text()
    assert capsys.readouterr().out.count("test/raise") == 1
    assert tally.row().split()[:6] == ["test", "3", "1", "0", "0", "2"]


def test_only_some_cases_run(tmp_path: Path) -> None:
    tally = run_campaign(Campaign("test", three, misbehave), 0, 60.0, "test/go", tmp_path)
    assert sum(tally.counts.values()) == 1


def test_a_campaign_that_cannot_run_says_why(tmp_path: Path) -> None:
    tally = run_campaign(
        Campaign("test", three, misbehave, unavailable=lambda: "no disk"), 0, 60.0, "", tmp_path
    )
    assert "no disk" in tally.row() and tally.fault_count == 0
    assert Tally("test").row().split()[1:6] == ["0"] * 5


def test_damage_depends_on_the_seed_alone() -> None:
    def made(seed: int) -> list[object]:
        rng = random.Random(seed)
        found: list[object] = [damaged_bytes(rng, gltf()) for _ in range(50)]
        return [*found, *(damaged_gltf(rng, glb(), "glb") for _ in range(20))]

    assert made(1) == made(1) != made(2)


def test_damage_leaves_the_document_as_it_is() -> None:
    document = {"a": [1, {"b": 2}]}
    assert places_in(document) == [("a",), ("a", 0), ("a", 1), ("a", 1, "b")]
    rng = random.Random(3)
    assert any(damaged_document(rng, document) != document for _ in range(20))
    assert document == {"a": [1, {"b": 2}]}


def test_campaigns_have_names_of_their_own_and_cases() -> None:
    found = campaigns()
    assert len({campaign.name for campaign in found}) == len(found) > 10
    # Those that make files beforehand, or fit, take seconds.
    for campaign in found:
        if campaign.name not in ("fit-folders", "mesh-files", "whole-fits"):
            names = [case.name for case, _ in zip(campaign.cases(random.Random(0)), range(50), strict=False)]
            assert len(set(names)) == len(names) > 1, campaign.name
