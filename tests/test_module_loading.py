"""Compiling is said where something is compiled, and not where loading is merely slow."""

# No postponed annotations here: Warp reads the kernels' own.

import time

import pytest
import warp as wp

from resfit.kernels import launch as launching
from resfit.kernels import module_loading

NAMES = ("resfit.tests.loading.known", "resfit.tests.loading.new")


def kernel_in(module: str) -> wp.Kernel:
    wp.set_module_options(launching.PLAIN_OPTIONS, module=module)

    @wp.kernel(module=module)
    def add_one_kernel(first: int, out: wp.array[int]):
        t = first + wp.tid()
        out[t] = out[t] + 1

    return add_one_kernel


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Loading takes longer than it takes to be noticed, and nothing was said yet."""
    load = wp.load_module

    def load_late(*args, **options):
        time.sleep(0.3)
        return load(*args, **options)

    monkeypatch.setattr(module_loading, "_NOTICE_SECONDS", 0.01)
    monkeypatch.setattr(module_loading, "_noticed", False)
    monkeypatch.setattr(wp, "load_module", load_late)


def test_a_slow_load_from_the_cache_says_nothing(slow, device, capfd) -> None:
    known = kernel_in(NAMES[0])
    wp.load_module(known.module, device=device)
    assert module_loading.is_cached(known.module, device)
    module_loading._loaded.discard((known.module.name, device.alias))
    module_loading.load(known, device)
    assert capfd.readouterr().err == ""


def test_compiling_is_said_once(slow, device, capfd, tmp_path, monkeypatch) -> None:
    new = kernel_in(NAMES[1])
    # An empty cache.
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    assert not module_loading.is_cached(new.module, device)
    module_loading._loaded.discard((new.module.name, device.alias))
    module_loading.load(new, device)
    assert module_loading.is_cached(new.module, device)
    module_loading._notice_compiling(new.module, device)
    assert capfd.readouterr().err.count("compiling kernels for this machine (first run only") == 1
