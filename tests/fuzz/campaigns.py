"""Running campaigns: cases until the time is over, and the smallest input of each fault kept in a folder."""

from __future__ import annotations

import random
import re
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fuzz.harness import OK, REFUSED, SKIPPED, WRONG, Campaign, Case, Outcome, Worker

HEAD = f"{'campaign':20} {'cases':>6} {'ok':>6} {'refused':>8} {'skipped':>8} {'faults':>7} {'slowest':>9}"


@dataclass
class Tally:
    """What became of the cases of a campaign."""

    name: str
    counts: Counter[str] = field(default_factory=Counter)
    faults: dict[str, tuple[Case, Outcome]] = field(default_factory=dict)
    """The smallest case of each fault, by `fault_name`."""
    skips: set[str] = field(default_factory=set)
    slowest: float = 0.0
    missing: str = ""
    """Why it did not run."""

    def add(self, case: Case, outcome: Outcome) -> bool:
        """Count a case; whether it is the first or the smallest of its kind of fault."""
        self.counts[outcome.kind] += 1
        if outcome.kind == SKIPPED:
            self.skips.add(outcome.text)
            return False
        self.slowest = max(self.slowest, outcome.seconds)
        if not outcome.fault:
            return False
        key = fault_name(case, outcome)
        if key in self.faults and len(self.faults[key][0].data) <= len(case.data):
            return False
        self.faults[key] = case, outcome
        return True

    @property
    def fault_count(self) -> int:
        """Cases that showed a fault."""
        return sum(self.counts.values()) - sum(self.counts[kind] for kind in (OK, REFUSED, SKIPPED))

    def row(self) -> str:
        """One line of the table."""
        if self.missing:
            return f"{self.name:20} skipped: {self.missing}"
        counts = self.counts
        line = (
            f"{self.name:20} {sum(counts.values()):6} {counts[OK]:6} {counts[REFUSED]:8} {counts[SKIPPED]:8}"
            f" {self.fault_count:7} {self.slowest:7.1f} s"
        )
        return line + (f"  (skipped: {'; '.join(sorted(self.skips))})" if self.skips else "")


def run_campaign(campaign: Campaign, seed: int, seconds: float, only: str, keep: Path) -> Tally:
    """Try the cases of a campaign whose `campaign/name` contains `only`, for so many seconds times its weight.

    Faults are told on stdout as they come, and their inputs kept in `keep`.
    """
    tally = Tally(campaign.name, missing=campaign.unavailable())
    if tally.missing:
        return tally
    worker = Worker(campaign)
    begin = time.monotonic()
    try:
        for case in campaign.cases(random.Random(seed)):
            if time.monotonic() - begin > seconds * campaign.weight:
                break
            if only not in f"{campaign.name}/{case.name}":
                continue
            outcome, known = worker.run(case), len(tally.faults)
            if tally.add(case, outcome):
                keep_fault(keep / campaign.name, case, outcome)
            if len(tally.faults) > known:
                tell(campaign.name, case, outcome)
    finally:
        worker.close()
    return tally


def tell(name: str, case: Case, outcome: Outcome) -> None:
    """One line about a fault."""
    size = f" ({len(case.data)} bytes)" if case.data else ""
    place = f" [{outcome.where}]" if outcome.where else ""
    figures = f"{outcome.seconds:.1f} s, {outcome.memory / 1e9:.1f} GB"
    text = f"{outcome.kind:6} {name}/{case.name}{size}: {outcome.text[:400]}{place}, {figures}"
    # Names of cases and files may be anything: here they are printable and take one line.
    sys.stdout.write("".join(c if c.isprintable() else ascii(c)[1:-1] for c in text) + "\n")
    sys.stdout.flush()


def fault_name(case: Case, outcome: Outcome) -> str:
    """A file's name that is the same for the same fault: by its place, else by what is wrong, else by the case."""
    said = re.sub(r"/[^\s']+|\d+", "", outcome.text if outcome.kind == WRONG else case.name)
    return re.sub(r"\W+", "_", f"{outcome.kind}_{outcome.where or said}")[:100].strip("_")


def keep_fault(folder: Path, case: Case, outcome: Outcome) -> None:
    """Write the input of a fault, and beside it what happened; a smaller one of the same place replaces it."""
    folder.mkdir(parents=True, exist_ok=True)
    stem = folder / fault_name(case, outcome)
    stem.with_name(stem.name + ".txt").write_text(
        f"{case.name}\n{outcome.text}\n{outcome.where}\n", encoding="utf-8", errors="replace"
    )
    if case.data:
        stem.with_name(f"{stem.name}.{case.suffix or 'bin'}").write_bytes(case.data)


def shuffled(rng: random.Random, cases: Sequence[Case]) -> Iterator[Case]:
    """All of them in random order: where the time is short, another seed tries others."""
    return iter(rng.sample(cases, len(cases)))
