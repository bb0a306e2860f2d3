"""The registry of proposals: a new file is enough, and what behaviour hangs on is in its entry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import warp as wp

from resfit.decomposition import proposals, propose
from resfit.decomposition.proposals import PROPOSALS, check_without, proposal_of, proposals_for
from resfit.decomposition.proposals.components import PROPOSAL as COMPONENTS
from resfit.decomposition.proposals.proposal import Unexplained
from resfit.decomposition.proposals.whole import whole_region
from resfit.decomposition.region import Region
from resfit.decomposition.residual import find_residual
from resfit.decomposition.target_cells import target_cells
from resfit.errors import InputError
from resfit.eval.bench.ablation import MOVES
from resfit.eval.methods.ours import configuration
from resfit.fitter.config import CHOICES, preset_config
from resfit.fitter.presets import ProposeConfig

CORNER = """
from resfit.decomposition.proposals.proposal import Proposal


def corner(unexplained):
    residual = unexplained.residual
    return [residual.region(residual.cells.all_places()[:20], "corner"), None]


PROPOSAL = Proposal(name="corner", find=corner, title="corners", first_round=True)
"""


@pytest.fixture
def with_corner(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One file more in the folder of the proposals."""
    (tmp_path / "corner.py").write_text(CORNER)
    monkeypatch.setattr(proposals, "__path__", [*proposals.__path__, str(tmp_path)])
    monkeypatch.setattr(proposals, "PROPOSALS", proposals._scan())


def solid() -> np.ndarray:
    """Signed distances (32, 32, 32) of a box."""
    centre = (np.arange(32) + 0.5) / 16 - 1
    x, y, z = np.meshgrid(centre, centre, centre, indexing="ij")
    return np.maximum.reduce([np.abs(x) - 0.8, np.abs(y) - 0.5, np.abs(z) - 0.3]).astype(np.float32)


def sources(first_round: bool, device: wp.Device) -> set[str]:
    found = propose.find_parts(target_cells(solid()), None, first_round=first_round, device=device)
    return {region.source for region in found}


@pytest.mark.usefixtures("with_corner")
def test_a_proposal_is_one_file(device: wp.Device) -> None:
    assert proposals.PROPOSALS.keys() == {*PROPOSALS, "corner"}
    assert "corner" in sources(True, device) and "corner" not in sources(False, device)
    assert "corner" not in [entry.name for entry in proposals_for("msd", without=["corner"])]
    preset_config("fast", propose=ProposeConfig(without=("corner",)))


def test_regions_know_their_proposal(device: wp.Device) -> None:
    cells = target_cells(solid())
    for proposal in proposals_for("msd"):
        found = propose.find_parts(cells, None, first_round=True, device=device, proposals=[proposal])
        assert {proposal_of(region) for region in found} <= {proposal}
    plate = Region(np.zeros(3, np.int32), np.ones((1, 1, 1), bool), 32, "plate")
    assert proposal_of(plate).name == "straight"


def test_whole_and_components(device: wp.Device) -> None:
    residual = find_residual(target_cells(np.minimum(solid(), np.roll(solid(), 16, axis=2))))
    assert residual is not None
    unexplained = Unexplained(residual, device, most=1)
    (whole,) = whole_region(unexplained)
    assert whole is not None and whole.volume == residual.volume
    (component,) = COMPONENTS.find(unexplained)
    assert component is not None and component.volume < whole.volume


def test_order_decides_which_of_two_equal_regions_stays() -> None:
    assert [*PROPOSALS][:2] == ["solid", "component"]
    ranks = [proposal.rank for proposal in PROPOSALS.values()]
    assert ranks == sorted(ranks) and len(set(ranks)) == len(ranks)


def test_choices_of_decompose_are_those_that_stand_alone() -> None:
    alone = {name for name, proposal in PROPOSALS.items() if proposal.alone}
    assert set(CHOICES["decompose"]) == {"msd", *alone}
    assert [entry.name for entry in proposals_for("coacd")] == ["coacd"]
    assert not alone & {entry.name for entry in proposals_for("msd")}


def test_bulky_ones_and_named_ones_are_left_out() -> None:
    every, slim = proposals_for("msd"), proposals_for("msd", ["hole"], bulky=False)
    assert {entry.name for entry in every} - {entry.name for entry in slim} == {"slab", "hole"}
    with pytest.raises(InputError, match="no such proposal to leave out; choose block, slab, hole"):
        check_without(["solid"])
    with pytest.raises(InputError, match=r"propose\.without edge: there is no such proposal"):
        preset_config("fast", propose=ProposeConfig(without=("edge",)))


def test_the_ablation_has_a_row_for_each_that_can_be_left_out() -> None:
    rows = {variant.label: variant.method for variant in MOVES.variants}
    for name, proposal in PROPOSALS.items():
        if proposal.title:
            assert rows[f"no {proposal.title}"] == f"ours:propose.without={name}"
    assert configuration({"propose.without": "slab+hole"}).propose.without == ("slab", "hole")
