"""Device choice, quiet start, and launches split over the cores."""

# No postponed annotations here: Warp reads the kernels' own.

import ast
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import warp as wp

from resfit.errors import DeviceError
from resfit.kernels.precompile import precompile_kernels
from resfit.kernels.runtime import launch as launching
from resfit.kernels.runtime import module_loading
from resfit.kernels.runtime.cores import core_count
from resfit.kernels.runtime.launch_graph import LaunchGraph

MODULE = "resfit.tests.launch"
wp.set_module_options(launching.PLAIN_OPTIONS, module=MODULE)


@wp.kernel(module=MODULE)
def write_index_kernel(first: int, scale: int, out: wp.array[int]):
    """Each thread writes its own index, so that a gap or an overlap shows."""
    t = first + wp.tid()
    out[t] = out[t] + scale * t + 1


@pytest.mark.parametrize("cores", [1, 2, 3, 7])
@pytest.mark.parametrize("count", [0, 1, 2, 5, 1000])
def test_every_thread_runs_once(cores, count, device, monkeypatch):
    monkeypatch.setattr(launching, "core_count", lambda: cores)
    out = wp.zeros(1000, dtype=int, device=device)
    launching.launch(write_index_kernel, count, [3], [out], device, seconds_per_thread=1.0)
    expected = np.zeros(1000, int)
    expected[:count] = 3 * np.arange(count) + 1
    np.testing.assert_array_equal(out.numpy(), expected)


def test_an_error_in_a_split_launch_is_raised(device, monkeypatch):
    monkeypatch.setattr(launching, "core_count", lambda: 2)
    with pytest.raises(Exception, match=r"[Aa]rgument|array|type"):
        launching.launch(write_index_kernel, 10, [3], ["no array"], device, seconds_per_thread=1.0)


def test_unknown_device_names_those_present():
    with pytest.raises(DeviceError, match=r"'cuda:97' is not available here; present: cpu"):
        launching.choose_device("cuda:97")


def test_auto_takes_no_device_that_was_not_measured_to_be_faster():
    """Whatever GPUs are present."""
    assert launching.choose_device("auto").is_cpu
    assert launching.serial_device().is_cpu


def test_the_last_of_several_threads_restores_the_switch_interval():
    """The first one in is the first one out."""
    usual = sys.getswitchinterval()
    first_is_in, second_is_in, first_is_out = (threading.Event() for _ in range(3))
    met = []

    def second():
        first_is_in.wait(10.0)
        with launching.often_switching():
            second_is_in.set()
            first_is_out.wait(10.0)
            met.append(sys.getswitchinterval())

    thread = threading.Thread(target=second)
    thread.start()
    with launching.often_switching():
        first_is_in.set()
        second_is_in.wait(10.0)
    first_is_out.set()
    thread.join()
    assert met == [pytest.approx(launching.SWITCH_SECONDS)]
    assert sys.getswitchinterval() == usual


def test_core_count_follows_the_environment(monkeypatch):
    monkeypatch.setenv("RESFIT_THREADS", "3")
    assert core_count() == 3
    monkeypatch.setenv("RESFIT_THREADS", "none")
    assert core_count() >= 1


def test_start_is_silent():
    """Nothing on stdout or stderr when Warp starts: JSON goes to stdout."""
    code = "from resfit.kernels.runtime.launch import choose_device; choose_device()"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "" and run.stderr == ""


def test_warm_compiles_everything_once(device):
    precompile_kernels(device)
    before = module_loading.compile_seconds
    precompile_kernels(device)
    assert module_loading.compile_seconds == before


def test_a_replay_repeats_its_launches(device):
    """Fixed counts are packed once, counts that are functions are asked each time; one that is 0 launches nothing."""
    sizes = [10]
    out, other = (wp.zeros(20, dtype=int, device=device) for _ in range(2))

    def body() -> None:
        launching.launch(write_index_kernel, 20, [0], [out], device)
        launching.launch(write_index_kernel, lambda: sizes[0], [0], [other], device, seconds_per_thread=1.0)

    run = LaunchGraph(body, device, capture=False)
    for size in (10, 20, 0):
        sizes[0] = size
        run()
    np.testing.assert_array_equal(out.numpy(), 3)
    np.testing.assert_array_equal(other.numpy(), [2] * 10 + [1] * 10)


@pytest.mark.parametrize("cores", [1, 2, 5])
def test_a_replay_runs_every_thread_once(cores, device, monkeypatch):
    monkeypatch.setattr(launching, "core_count", lambda: cores)
    out = wp.zeros(1000, dtype=int, device=device)
    run = LaunchGraph(
        lambda: launching.launch(write_index_kernel, 1000, [3], [out], device, seconds_per_thread=1.0), device
    )
    run()
    with launching.on_cores(2):
        run()
    np.testing.assert_array_equal(out.numpy(), 2 * (3 * np.arange(1000) + 1))


def test_a_thread_keeps_to_its_cores(device, monkeypatch):
    """On one core nothing is handed over to other threads."""
    monkeypatch.setattr(launching, "core_count", lambda: 4)
    monkeypatch.setattr(launching, "pool", lambda: pytest.fail("a launch was split"))
    out = wp.zeros(1000, dtype=int, device=device)
    with launching.on_cores(1):
        launching.launch(write_index_kernel, 1000, [3], [out], device, seconds_per_thread=1.0)
    assert out.numpy()[-1] == 3 * 999 + 1


@pytest.mark.parametrize("cores", [1, 2, 8])
def test_jobs_run_side_by_side_on_their_share(cores, monkeypatch):
    monkeypatch.setattr(launching, "core_count", lambda: cores)
    with launching.side_by_side(*[launching._cores_here] * 3) as found:
        assert [future.result() for future in found] == [max(1, cores // 3)] * 3
    assert launching._cores_here() == cores


def test_a_job_that_fails_keeps_others_from_beginning(monkeypatch):
    monkeypatch.setattr(launching, "core_count", lambda: 1)
    begun = []

    def fail():
        raise OSError("the disk is full")

    def begin():
        time.sleep(0.2)
        begun.append(1)

    with pytest.raises(OSError, match="full"), launching.side_by_side(fail, begin, begin, begin) as found:
        found[0].result()
    assert len(begun) <= 1


def test_modules_of_a_fit_are_those_that_it_uses(device):
    """Nothing that a fit launches is missing from what is loaded ahead, the odd small module aside."""
    code = (
        "import trimesh, warp as wp, resfit;"
        "from resfit.kernels.runtime import module_loading; from resfit.kernels import prefetch;"
        "from resfit.kernels.runtime.launch import choose_device;"
        "choose_device('cpu');"
        "ahead = {make().name for make, _ in prefetch.modules_of_fit('superfrustum', wp.get_device('cpu'))};"
        "resfit.fit(trimesh.creation.capsule(), preset='fast', device='cpu').preview();"
        "print(sorted(name for name, _ in module_loading._loaded if name not in ahead));"
        "print(sorted(ahead - {name for name, _ in module_loading._loaded}))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    missing, idle = (ast.literal_eval(line) for line in run.stdout.splitlines()[-2:])
    assert len(missing) <= 6, missing
    assert idle == []
