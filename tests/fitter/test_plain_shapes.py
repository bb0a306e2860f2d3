"""The plainest solids come back as themselves: one part each, exact, in their standard form."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from plain_shapes import BENT, SHAPES, TAPERED, longest_side, plain_shape

import resfit
from resfit.result.fit_result import FitResult

TOLERANCE = {"fast": 0.002, "balanced": 0.001}
"""Share of the size within which 95 % of the surface lies."""


def assert_itself(result: FitResult, name: str, preset: str) -> None:
    (part,) = result.assembly.primitives
    assert result.deviation is not None
    assert result.deviation.p95 <= TOLERANCE[preset] * longest_side(name)
    parameters = part.parameters
    if name not in BENT:
        assert parameters["bulge"] == 0.0
    if name not in TAPERED:
        assert parameters["taper"] == 1.0


@pytest.mark.parametrize("name", SHAPES)
def test_turned_and_fast(name: str) -> None:
    assert_itself(resfit.fit(plain_shape(name, turned=True), preset="fast"), name, "fast")


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("name", SHAPES)
def test_balanced(name: str, turned: bool) -> None:
    result = resfit.fit(plain_shape(name, turned), preset="balanced")
    assert_itself(result, name, "balanced")
    if not turned and name not in BENT:
        # The smallest rotation that brings the axis there is none.
        assert np.allclose(result.assembly.primitives[0].pose.rotation, (1.0, 0.0, 0.0, 0.0), atol=1e-3)


@pytest.mark.slow
def test_side_by_side_in_one_file() -> None:
    meshes, place = [], 0.0
    for name in SHAPES:
        mesh = plain_shape(name, turned=True)
        mesh.apply_translation([place - mesh.bounds[0, 0], 0.0, 0.0])
        place = mesh.bounds[1, 0] + 1.0
        meshes.append(mesh)
    # Unless told, the thin rod is not worth a fit of its own: it is less than a part's price of the whole.
    result = resfit.fit(trimesh.util.concatenate(meshes), preset="balanced", per_part="on")
    assert len(result.assembly.primitives) == len(SHAPES)


def test_a_ball_has_no_size_but_its_radius() -> None:
    (part,) = resfit.fit(
        trimesh.creation.icosphere(subdivisions=4, radius=10.0), preset="fast"
    ).assembly.primitives
    assert list(part.parameters["size"]) == [0.0, 0.0, 0.0]
    assert list(part.pose.rotation) == [1.0, 0.0, 0.0, 0.0]


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True])
def test_an_ellipsoid_is_three_parts_within_a_hundredth(turned: bool) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=5).apply_scale((1.0, 1.6, 0.7))
    if turned:
        mesh.apply_transform(trimesh.transformations.euler_matrix(0.5, -0.8, 0.3))
    result = resfit.fit(mesh, preset="balanced", max_primitives=3)
    assert len(result.assembly.primitives) <= 3
    assert result.deviation is not None
    assert result.deviation.p95 < 0.01 * 3.2
