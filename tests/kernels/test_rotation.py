"""Quaternions and matrices say the same, and turns about the axes are exact."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from resfit.kernels.rotation import matrix_of, multiply, quaternion_of, rotation_about


def test_quaternions_and_matrices_undo_each_other() -> None:
    matrices = Rotation.random(200, random_state=0).as_matrix()
    quaternions = quaternion_of(matrices)
    np.testing.assert_allclose(matrix_of(quaternions), matrices, atol=1e-12)
    np.testing.assert_allclose(matrix_of(1.01 * quaternions[0]), matrices[0], atol=1e-12)
    np.testing.assert_array_equal(np.abs(quaternions).max(1), quaternions.max(1))
    assert matrix_of(np.zeros((0, 4))).shape == (0, 3, 3)


def test_products_turn_by_the_second_first() -> None:
    first, second = quaternion_of(Rotation.random(2, random_state=1).as_matrix())
    both = matrix_of(multiply(second, first))
    np.testing.assert_allclose(both, matrix_of(second) @ matrix_of(first), atol=1e-12)


def test_half_turns_are_exact() -> None:
    half = np.array([0.0, 1.0, 0.0, 0.0])
    np.testing.assert_array_equal(quaternion_of(np.diag([1.0, -1.0, -1.0])), half)
    np.testing.assert_array_equal(matrix_of(half), np.diag([1.0, -1.0, -1.0]))
    np.testing.assert_array_equal(multiply(half, half), [-1.0, 0.0, 0.0, 0.0])
    random = quaternion_of(Rotation.random(100, random_state=2).as_matrix()).astype(np.float32)
    assert set(np.abs(multiply(half, random)).ravel()) == set(np.abs(random.astype(np.float64)).ravel())


def test_rotation_about_an_axis_is_right_handed() -> None:
    np.testing.assert_allclose(rotation_about([0.0, 0.0, 1.0], np.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
