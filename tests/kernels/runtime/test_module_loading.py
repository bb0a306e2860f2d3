"""Compiling is said where something is compiled, and not where loading is merely slow."""

# No postponed annotations here: Warp reads the kernels' own.

import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from resfit.kernels.runtime import launch as launching
from resfit.kernels.runtime import module_loading

NAMES = ("resfit.tests.loading.known", "resfit.tests.loading.new", "resfit.tests.loading.damaged")


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


def test_two_modules_that_are_compiled_at_once_are_said_once(slow, device, capfd, monkeypatch) -> None:
    both = threading.Barrier(2, timeout=10.0)
    monkeypatch.setattr(module_loading, "is_cached", lambda *_: both.wait() < 0)
    module = kernel_in(NAMES[1]).module
    threads = [
        threading.Thread(target=module_loading._notice_compiling, args=(module, device)) for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert capfd.readouterr().err.count("compiling kernels") == 1


DAMAGES = {
    "cut short": lambda code: code[: len(code) // 2],
    "empty": lambda code: b"",
    "zeros": lambda code: bytes(len(code)),
    "zeros at the end": lambda code: code[: len(code) // 2].ljust(len(code), b"\0"),
    "noise": lambda code: np.random.default_rng(0).bytes(len(code)),
}


@pytest.fixture
def damaged(device, tmp_path, monkeypatch) -> tuple[wp.Kernel, Path]:
    """A kernel that is not loaded, and its machine code in a cache of its own."""
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    kernel = kernel_in(NAMES[2])
    kernel.module.unload()
    wp.load_module(kernel.module, device=device)
    kernel.module.unload()
    module_loading._loaded.discard((kernel.module.name, device.alias))
    return kernel, module_loading._cached_code(kernel.module, device)


def add_one(kernel: wp.Kernel, device: wp.Device) -> list[int]:
    out = wp.zeros(2, dtype=int, device=device)
    launching.launch(kernel, 2, [], [out], device)
    return out.numpy().tolist()


@pytest.mark.parametrize("change", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_module_is_compiled_again(change, damaged, device) -> None:
    kernel, code = damaged
    whole = code.read_bytes()
    code.write_bytes(change(whole))
    assert add_one(kernel, device) == [1, 1]
    assert len(code.read_bytes()) == len(whole)


def test_a_module_whose_description_is_damaged_is_compiled_again(damaged, device) -> None:
    kernel, code = damaged
    (description,) = code.parent.glob("*.meta")
    description.write_bytes(b"{")
    assert add_one(kernel, device) == [1, 1]
    assert description.stat().st_size > 1


@pytest.mark.skipif(os.name != "posix", reason="needs links")
def test_a_damaged_module_of_a_cache_that_can_only_be_read_is_left_there(
    damaged, device, tmp_path, monkeypatch
) -> None:
    kernel, code = damaged
    code.write_bytes(b"")
    linked = tmp_path / "linked"
    linked.mkdir()
    (linked / code.parent.name).symlink_to(code.parent)
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(linked))
    assert add_one(kernel, device) == [1, 1]
    assert code.read_bytes() == b"" and (linked / code.parent.name / code.name).stat().st_size


def test_an_error_of_the_compiler_is_raised(device, tmp_path, monkeypatch) -> None:
    def fail(*args, **options):
        raise RuntimeError("no compiler")

    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    monkeypatch.setattr(wp, "load_module", fail)
    with pytest.raises(RuntimeError, match="no compiler"):
        module_loading._load_or_compile(kernel_in(NAMES[1]).module, device)
