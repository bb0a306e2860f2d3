"""Forked and spawned children go on with kernels, whatever their parent and its threads were doing."""

# No postponed annotations here: Warp reads the kernels' own.

import multiprocessing
import os
import subprocess
import sys
import threading

import numpy as np
import pytest
import warp as wp

from resfit.kernels.runtime import forks
from resfit.kernels.runtime import launch as launching
from resfit.kernels.runtime.forks import unforked

MODULE = "resfit.tests.forks"
wp.set_module_options(launching.PLAIN_OPTIONS, module=MODULE)
needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="no process is forked here")


@wp.kernel(module=MODULE)
def square_index_kernel(first: int, out: wp.array[int]):
    t = first + wp.tid()
    out[t] = t * t


def squares(cores: int = 2) -> bytes:
    """What a launch that is split over the pool's threads writes."""
    device = launching.choose_device("cpu")
    out = wp.zeros(1000, dtype=int, device=device)
    with launching.on_cores(cores):
        launching.launch(square_index_kernel, 1000, [], [out], device, seconds_per_thread=1.0)
    return out.numpy().tobytes()


def answer_of(method: str, seconds: float = 100.0) -> bytes:
    """What `squares` gives in a child, started by a method of multiprocessing; it is given up after a while."""
    context = multiprocessing.get_context(method)
    with context.Pool(1) as pool:
        return pool.apply_async(squares).get(seconds)


@needs_fork
@pytest.mark.parametrize("method", ["fork", "forkserver", "spawn"])
def test_a_child_launches_after_its_parent(method: str) -> None:
    expected = np.arange(1000, dtype=np.int32) ** 2
    assert squares() == expected.tobytes()
    assert answer_of(method) == expected.tobytes()


@needs_fork
def test_a_fork_waits_for_what_other_threads_are_at() -> None:
    begun, end, order = threading.Event(), threading.Event(), []

    def work() -> None:
        with unforked(), unforked():
            begun.set()
            end.wait(10.0)
            order.append("worked")

    worker = threading.Thread(target=work)
    worker.start()
    begun.wait(10.0)
    threading.Timer(0.2, end.set).start()
    with unforked():
        # Its own block keeps no thread from forking.
        child = os.fork()
        if not child:
            os._exit(7 if order == ["worked"] and not forks._held else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
    worker.join()
    assert not forks._busy


@needs_fork
def test_a_child_has_none_of_the_locks_and_intervals_of_other_threads() -> None:
    usual, begun, end = sys.getswitchinterval(), threading.Event(), threading.Event()

    def work() -> None:
        with launching.often_switching(), launching._start_lock:
            begun.set()
            end.wait(10.0)

    worker = threading.Thread(target=work)
    worker.start()
    begun.wait(10.0)
    child = os.fork()
    if not child:
        free = launching._start_lock.acquire(timeout=1.0)
        os._exit(7 if free and sys.getswitchinterval() == usual else 1)
    end.set()
    worker.join()
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7


FORK_AFTER_A_FIT = """
import multiprocessing, trimesh, resfit

def fitted():
    return resfit.fit(trimesh.creation.box((1, 2, 3)), preset='fast', max_primitives=2, device='cpu').assembly.to_json()

before = fitted()
with multiprocessing.get_context('fork').Pool(1) as pool:
    print(pool.apply_async(fitted).get(200) == before)
"""


@needs_fork
@pytest.mark.slow
def test_a_forked_child_fits_what_its_parent_fitted() -> None:
    """The same bytes, and no hang."""
    run = subprocess.run(
        [sys.executable, "-c", FORK_AFTER_A_FIT], capture_output=True, text=True, check=True, timeout=400
    )
    assert run.stdout.strip() == "True", run.stderr
