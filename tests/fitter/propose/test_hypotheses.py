"""Guesses of what regions could be: for a shape that is known, one of the first has its parameters."""

from __future__ import annotations

import numpy as np
import pytest

from resfit.fitter.propose.hypotheses import Hypotheses, guess_shapes

STEP = 0.02
LINE = np.arange(-0.6 + 0.5 * STEP, 0.6, STEP)
X, Y, Z = np.stack(np.meshgrid(LINE, LINE, LINE, indexing="ij")).reshape(3, -1)
R = np.hypot(X, Y)
SHAPES = {
    "box": (abs(X) < 0.5) & (abs(Y) < 0.3) & (abs(Z) < 0.1),
    "tube": (R < 0.5) & (R > 0.3) & (abs(Z) < 0.4),
    "cone": (R < 0.25 - 0.5 * Z) & (abs(Z) < 0.4),
    "arc": (abs(R - 0.4) < 0.08) & (abs(Z) < 0.06) & (X < 0.0),
    "ring": (abs(R - 0.4) < 0.08) & (abs(Z) < 0.06),
}


def guesses(*names: str, count: int = 1500) -> Hypotheses:
    rng = np.random.default_rng(5)
    every = [np.stack([X, Y, Z], axis=1)[SHAPES[name]] for name in names]
    points = np.stack([rng.choice(cloud, count) for cloud in every])
    covariance = np.stack([np.cov(cloud.T) for cloud in every])
    return guess_shapes(points, covariance, np.full(len(names), 0.5 * STEP))


def along_z(found: Hypotheses, kind: str) -> Hypotheses:
    """The first guess of a kind that is swept along z."""
    fits = np.flatnonzero((found.kind == kind) & (np.abs(found.axes[:, 2, 2]) > 0.999))
    return found.take(fits[:1])


def test_order_frames_and_ranges() -> None:
    found = guesses(*SHAPES)
    assert found.region.tolist() == sorted(found.region)
    for region in range(len(SHAPES)):
        assert (np.diff(found.priority[found.region == region]) >= 0).all()
    np.testing.assert_allclose(np.linalg.det(found.axes), 1.0, atol=1e-9)
    assert (found.size > 0.0).all() and (found.dilation >= 0.0).all()
    assert (found.onion >= -1.0).all() and (found.onion < 1.0).all()
    assert (found.taper > 0.0).all() and (found.taper <= 1.0).all()
    assert (np.abs(found.bulge) <= 1.0).all()


def test_first_guess_of_a_box_is_that_box() -> None:
    found = guesses("box")
    # Swept along its longest side, which is x.
    assert found.kind[0] == "box"
    np.testing.assert_allclose(found.size[0], [0.6, 0.2, 1.0], atol=0.04)
    np.testing.assert_allclose(np.abs(found.axes[0][:, 2]), [1.0, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(found.centre[0], 0.0, atol=0.02)
    assert (found.taper[0], found.bulge[0], found.onion[0]) == (1.0, 0.0, -1.0)


def test_a_tube_is_guessed_hollow_before_it_is_guessed_solid() -> None:
    found = guesses("tube")
    tube, cylinder = along_z(found, "tube"), along_z(found, "cylinder")
    assert tube.onion[0] == pytest.approx(0.6, abs=0.06)
    np.testing.assert_allclose(tube.size[0], [1.0, 1.0, 0.8], atol=0.06)
    assert found.kind[0] in ("box", "cylinder") and np.abs(found.axes[0][2, 2]) > 0.999
    assert tube.priority[0] < 4.0 < along_z(guesses("box"), "tube").priority[0]
    assert cylinder.onion[0] == -1.0


def test_a_cone_points_to_its_narrow_end() -> None:
    cone = along_z(guesses("cone"), "cone")
    assert cone.axes[0, 2, 2] == pytest.approx(1.0)
    assert cone.taper[0] == pytest.approx(0.1, abs=0.1)


def test_an_arc_has_its_chord_and_bulge() -> None:
    found = guesses("arc")
    arc = found.take(np.flatnonzero((found.kind == "arc") & (np.abs(found.axes[:, 2, 1]) > 0.999))[:1])
    assert arc.bulge[0] == pytest.approx(1.0, abs=0.05)
    np.testing.assert_allclose(arc.size[0], [0.16, 0.12, 0.8], atol=0.06)
    # A half ring's chord goes through the centre, and the arc bulges to where the ring is.
    np.testing.assert_allclose(arc.centre[0], 0.0, atol=0.04)
    np.testing.assert_allclose(-arc.axes[0][:, 0], [-1.0, 0.0, 0.0], atol=0.1)
    assert (found.kind != "hoop").all()


def test_a_whole_ring_is_a_hoop() -> None:
    hoop = along_z(guesses("ring"), "hoop")
    np.testing.assert_allclose(hoop.size[0], [0.96, 0.96, 0.12], atol=0.05)
    assert hoop.onion[0] == pytest.approx(0.32 / 0.48, abs=0.05)


def test_bent_bars_bend_to_all_four_sides() -> None:
    found = guesses("box")
    bent = found.take(np.array([kind.startswith("bent") for kind in found.kind]))
    assert {kind: int((bent.kind == kind).sum()) for kind in set(bent.kind)} == {
        "bent -x": 3, "bent +x": 3, "bent -y": 3, "bent +y": 3,
    }  # fmt: skip
    assert (bent.bulge == 0.5).all()
