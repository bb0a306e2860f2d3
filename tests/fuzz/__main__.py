"""`python -m fuzz`: all campaigns, two at a time, and a row for each.

Faults are told as they are found, the smallest input of each is kept. Exit code 1 if there was one. Hand-made cases
come in an order that depends on the seed, damaged files are made from it.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path

from fuzz.campaigns import HEAD, Tally, run_campaign
from fuzz.harness import Campaign

MODULES = (
    "whole_fits", "surroundings", "kernel_caches", "same_bytes", "mesh_files", "assemblies", "extreme_assemblies",
    "fit_folders", "saves", "kills", "side_by_side", "one_process", "current_folder", "web_door",
)  # fmt: skip
"""The longest first."""

KEEP = Path(__file__).resolve().parents[2] / "out" / "fuzz"


def campaigns() -> list[Campaign]:
    """All of them, in order."""
    return [import_module(f"fuzz.{name}").CAMPAIGN for name in MODULES]


def main() -> int:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__)
    parser.add_argument("names", nargs="*", help="campaigns to run; all unless given")
    parser.add_argument("--list", action="store_true", help="the names of all campaigns")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--seconds", type=float, default=75.0, help="for each campaign, some take more of them"
    )
    parser.add_argument("--only", default="", help="cases whose CAMPAIGN/NAME contains this")
    parser.add_argument("--keep", type=Path, default=KEEP, help="folder for the smallest input of each fault")
    parser.add_argument("--jobs", type=int, default=2, help="campaigns at a time")
    given = parser.parse_args()
    known = {campaign.name: campaign for campaign in campaigns()}
    if given.list:
        sys.stdout.write("\n".join(known) + "\n")
        return 0
    unknown = [name for name in given.names if name not in known]
    if unknown:
        parser.error(f"there is no campaign {unknown[0]}; choose from {', '.join(known)}")
    chosen = [known[name] for name in given.names] or list(known.values())

    def run(campaign: Campaign) -> Tally:
        return run_campaign(campaign, given.seed, given.seconds, given.only, given.keep)

    with ThreadPoolExecutor(max(1, given.jobs)) as threads:
        tallies = list(threads.map(run, chosen))
    sys.stdout.write("\n".join([HEAD, *(tally.row() for tally in tallies)]) + "\n")
    faults = sum(tally.fault_count for tally in tallies)
    if faults:
        sys.stdout.write(f"inputs of the faults: {given.keep}\n")
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
