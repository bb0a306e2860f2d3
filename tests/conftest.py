"""Fixtures shared by all tests: the devices present here, and seeded random numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    import warp as wp


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run tests that ask for `device` on the CPU and, where there is one, on the first GPU."""
    if "device" not in metafunc.fixturenames:
        return
    # Imported here because tests that touch no kernel (documents, the architecture) need not wait for Warp.
    import warp

    from resfit.kernels.launch import start

    start()
    names = ["cpu"] + [found.alias for found in warp.get_cuda_devices()[:1]]
    metafunc.parametrize("device", names, indirect=True)


@pytest.fixture
def device(request: pytest.FixtureRequest) -> wp.Device:
    """The device to test on; see `pytest_generate_tests`."""
    from resfit.kernels.launch import choose_device

    return choose_device(request.param)


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers that are the same in every run."""
    return np.random.default_rng(20240229)
