"""The facade: what scripts and the command line call."""

from __future__ import annotations

from resfit.assembly.assembly import Assembly
from resfit.export.by_suffix import export_assembly as export

__all__ = ["Assembly", "export"]
