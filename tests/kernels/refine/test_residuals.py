"""The table of the refinement's residuals."""

from __future__ import annotations

from resfit.fitter.presets import RefineConfig
from resfit.kernels.refine.residual_points import OF_SECOND_C
from resfit.kernels.refine.residuals import RESIDUALS, residual_weights


def test_weights_come_from_the_configuration() -> None:
    assert residual_weights(RefineConfig(overlap=0.2)) == (1.0, 1.0, 0.2)


def test_bits_follow_the_table() -> None:
    rows = [residual.name for n, residual in enumerate(RESIDUALS) if int(OF_SECOND_C) >> n & 1]
    assert rows == [residual.name for residual in RESIDUALS if residual.of_second] == ["blended", "covering"]
