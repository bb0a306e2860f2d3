"""An assembly on a device: its rows, and the frames and table entries that the kernels derive from them."""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
import warp as wp

from ..primitives import family
from ..primitives.family import Family
from ..rows import GATE, ROW, ROW_C
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import PLAIN_OPTIONS, launch
from .frame import Frame, derive_frame


@wp.struct
class Primitives:
    """A run of primitives of one family as an argument of kernels."""

    frames: wp.array[Frame]
    """(count,), of all primitives, as are the rows."""
    rows: wp.array[float]
    begin: int
    """First primitive of the run."""
    end: int
    """One past its last."""
    count: int
    """Of all primitives."""


@cached_kernel
def derive_kernel(name: str) -> wp.Kernel:
    """The kernel that fills frames and tables of the family called `name`."""
    module = f"resfit.kernels.derive.{name}"
    wp.set_module_options(PLAIN_OPTIONS, module=module)
    entry = family(name)
    derive, table = entry.derive, entry.table

    @wp.kernel(module=module)
    def derive_primitives_kernel(
        first: int,
        rows: wp.array[float],
        begin: int,
        # outputs
        out_frames: wp.array[Frame],
        out_tables: wp.array[table],
    ):
        k = begin + first + wp.tid()
        out_frames[k] = derive_frame(rows, k * ROW_C)
        out_tables[k] = derive(rows, k * ROW_C)

    return derive_primitives_kernel


@dataclass(frozen=True)
class Run:
    """Neighbours in the list that are of one family: primitives begin .. end - 1."""

    family: Family
    begin: int
    end: int

    @property
    def count(self) -> int:
        """Number of primitives."""
        return self.end - self.begin


class PrimitiveSet:
    """Primitives in list order, on a device. Families may mix; the union folds in this order.

    `rows` (primitive_count * ROW,) is what kernels read and what gradients refer to. After changing it, call
    `derive`.
    """

    def __init__(
        self, rows: np.ndarray, families: Sequence[str], device: wp.Device, requires_grad: bool = False
    ):
        rows = np.ascontiguousarray(rows, np.float32).reshape(-1, ROW)
        if len(rows) != len(families):
            raise ValueError(f"{len(rows)} rows but {len(families)} families")
        self.device = device
        self.families = tuple(families)
        self.rows = wp.array(rows.ravel(), dtype=float, device=device, requires_grad=requires_grad)
        self.runs = _runs(self.families)
        self.frames = wp.empty(len(rows), dtype=Frame, device=device)
        self.tables: dict[str, Any] = {
            run.family.name: wp.empty(len(rows), dtype=run.family.table, device=device) for run in self.runs
        }
        self._arguments = {run.begin: self._argument(run) for run in self.runs}
        self.derive()

    def _argument(self, run: Run) -> Any:
        argument = Primitives()
        argument.frames, argument.rows = self.frames, self.rows
        argument.begin, argument.end, argument.count = run.begin, run.end, len(self)
        return argument

    def arguments(self, run: Run) -> Any:
        """One of the `runs` as an argument of a kernel: a `Primitives`."""
        return self._arguments[run.begin]

    def __len__(self) -> int:
        return len(self.families)

    def derive(self) -> None:
        """Recompute frames and tables from the rows."""
        for run in self.runs:
            launch(
                derive_kernel(run.family.name),
                run.count,
                [self.rows, run.begin],
                [self.frames, self.tables[run.family.name]],
                self.device,
            )

    def rows_numpy(self) -> np.ndarray:
        """A copy of the rows (primitive_count, ROW) on the host."""
        return self.rows.numpy().reshape(-1, ROW).copy()

    def set_rows(self, rows: np.ndarray) -> None:
        """Replace all rows (primitive_count, ROW) and derive."""
        self.rows.assign(np.ascontiguousarray(rows, np.float32).ravel())
        self.derive()

    @property
    def gates(self) -> np.ndarray:
        """Gates (primitive_count,)."""
        return self.rows_numpy()[:, GATE]


def _runs(families: Sequence[str]) -> tuple[Run, ...]:
    runs, begin = [], 0
    for name, members in groupby(families):
        end = begin + len(list(members))
        runs.append(Run(family(name), begin, end))
        begin = end
    return tuple(runs)
