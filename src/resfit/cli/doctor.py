"""`resfit doctor`: what works on this machine, and how to get what does not."""

from __future__ import annotations

import json
import sys
from typing import Annotated

from cyclopts import Parameter


def doctor(
    *,
    warm: Annotated[bool, Parameter(negative="")] = False,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
    device: str = "auto",
) -> int:
    """Say what works here; exit code 0 if the core does.

    Args:
        warm: compile every kernel for this machine now, so that no later run has to.
        as_json: print JSON and nothing else.
        device: auto (the CPU), cpu or cuda:0.
    """
    from resfit.cli.checks import run_checks

    checks = run_checks(device, warm)
    works = all(check.ok for check in checks if check.core)
    if as_json:
        entries = [check.as_dict() for check in checks]
        sys.stdout.write(json.dumps({"ok": works, "checks": entries}, indent=2) + "\n")
    else:
        width = max(len(check.name) for check in checks)
        for check in checks:
            mark = "ok" if check.ok else ("FAIL" if check.core else "-")
            fix = f"  ({check.fix})" if check.fix and not check.ok else ""
            sys.stdout.write(f"{mark:>4}  {check.name:<{width}}  {check.detail}{fix}\n")
        sys.stdout.write("Everything the core needs works.\n" if works else "The core does not work here.\n")
    return 0 if works else 1
