"""The connected components of the residual."""

from __future__ import annotations

from ..residual import residual_components
from .proposal import Proposal

PROPOSAL = Proposal(
    name="component",
    find=lambda unexplained: residual_components(unexplained.residual, most=unexplained.most),
    rank=1,
)
