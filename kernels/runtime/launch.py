"""Starting Warp and launching kernels: device choice, CPU threads, quiet start.

Warp runs a CPU launch on one core but lets go of the interpreter lock meanwhile, so a launch is split over the
cores here. Every kernel takes `first: int` as its first argument and works on index `first + wp.tid()`: a launch of
any number of threads is then any number of launches over fixed, contiguous ranges. A thread writes only its own
outputs, so that results are the same bytes on one core and on many.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import warp as wp

from resfit.errors import DeviceError

from .address_space import require_address_space
from .cache import init_warp
from .cores import core_count
from .forks import after_fork_in_child, unforked
from .module_loading import load

VECTOR_FLAGS = (
    "-march=native -mllvm=-inline-threshold=9000 -mllvm=-inline-cold-callsite-threshold=3000"
    " -mllvm=-capture-tracking-max-uses-to-explore=1000 -mllvm=-unroll-full-max-count=8"
    " -ffp-contract=fast -fno-slp-vectorize -mreassociate -fno-signed-zeros"
)
"""LLVM flags under which a constant loop over a block of points becomes vector code: everything must be inlined, local
matrices that are used in many places must be seen to be local, loops of 16 must not be unrolled before they are looked
at (nor are Warp's own over the components of long vectors: write those out), and sums may be reassociated (they
vectorise only then; maxima never do). `-ffast-math` gains nothing more and breaks tests for NaN."""

VECTOR_OPTIONS = {"enable_backward": False, "cpu_compiler_flags": VECTOR_FLAGS}
"""Module options of every kernel that loops over a block of points; its adjoint, where it has one, is a kernel too."""

PLAIN_OPTIONS = VECTOR_OPTIONS
"""Module options of kernels without such a loop (queries, scans). The same flags on purpose: the compiler's
precompiled header is made once for each set of flags, which takes as long as several modules."""

SPLIT_SECONDS = 1.5e-4
"""A launch shorter than this loses more by the hand-over to a second thread (about 15 us) than it gains."""

SWITCH_SECONDS = 5e-4
"""After which a thread that holds the interpreter lock passes it on, where several work side by side."""

_start_lock = threading.Lock()
_local = threading.local()
"""Of each thread: the launches being recorded, and the cores that it may use."""
_started = False
_pool: ThreadPoolExecutor | None = None
_switching: list[int] = []
"""The thread of each block of `often_switching` that is being run."""
_usual_switching = 0.0
"""Switch interval of the interpreter where there is none."""
_usage: dict[str, Usage] | None = None
_NOT_COUNTED = nullcontext()


def start() -> None:
    """Initialise Warp without its banner and module messages; safe to call often."""
    global _started
    with unforked(), _start_lock:
        if not _started:
            wp.config.log_level = wp.LOG_ERROR
            require_address_space()
            with _quiet_stderr():
                notice = init_warp()
            _started = True
            if notice:
                with suppress(OSError, ValueError, AttributeError):
                    sys.stderr.write(f"resfit: {notice}\n")


@contextmanager
def _quiet_stderr() -> Iterator[None]:
    """Silence native code: without a driver, Warp's start writes a CUDA warning straight to the descriptor."""
    with suppress(OSError, ValueError, AttributeError):
        sys.stderr.flush()
    try:
        saved = os.dup(2)
    except OSError:
        # It is closed: there is nothing to silence.
        yield
        return
    with open(os.devnull, "wb") as sink:
        os.dup2(sink.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)


def _cores_here() -> int:
    """Cores that launches of this thread are split over."""
    return getattr(_local, "cores", None) or core_count()


@contextmanager
def on_cores(count: int) -> Iterator[None]:
    """Within, launches of this thread are split over so many cores: where several threads work side by side."""
    before = getattr(_local, "cores", None)
    _local.cores = max(1, count)
    try:
        yield
    finally:
        _local.cores = before


@contextmanager
def often_switching() -> Iterator[None]:
    """Within, threads pass the interpreter lock on soon: a launch takes far less than the 5 ms that are usual.

    Several threads may be in such blocks at once: the last one out brings back what the first one met.
    """
    global _usual_switching
    me = threading.get_ident()
    with _start_lock:
        if not _switching:
            _usual_switching = sys.getswitchinterval()
            sys.setswitchinterval(SWITCH_SECONDS)
        _switching.append(me)
    try:
        yield
    finally:
        with _start_lock:
            _switching.remove(me)
            if not _switching:
                sys.setswitchinterval(_usual_switching)


@contextmanager
def side_by_side(*jobs: Callable[[], Any]) -> Iterator[list[Future[Any]]]:
    """Run jobs on threads, each on its share of the cores; what they return or raise is in their futures.

    The first ones begin first: let those be the longest. The block ends when all have ended; if it fails, those that
    have not begun never do.
    """
    workers = min(len(jobs), core_count())

    def run(job: Callable[[], Any]) -> Any:
        with on_cores(core_count() // workers):
            return job()

    with often_switching(), ThreadPoolExecutor(workers, thread_name_prefix="resfit-job") as threads:
        futures = [threads.submit(run, job) for job in jobs]
        try:
            yield futures
        except BaseException:
            threads.shutdown(wait=False, cancel_futures=True)
            raise


def choose_device(name: str = "auto") -> wp.Device:
    """The device called `name`: `auto` (see `_fastest_device`), `cpu`, `cuda` (the first GPU) or `cuda:0`.

    Raises:
        DeviceError: if there is no such device.
    """
    start()
    if name == "auto":
        device = _fastest_device()
    elif name == "cuda" and wp.get_cuda_device_count():
        device = wp.get_cuda_devices()[0]
    elif name in (present := [found.alias for found in wp.get_devices()]):
        device = wp.get_device(name)
    else:
        raise DeviceError(
            f"device '{name}' is not available here; present: {', '.join(present)}. Use --device auto or cpu."
        )
    with _start_lock:
        # Warp makes a GPU's context when it is first asked for, and not safely where several threads ask at once.
        _ = device.context
    return device


def _fastest_device() -> wp.Device:
    """The device on which whole fits were measured to be fastest on this machine: the CPU, as no GPU is measured yet.

    A probe that times a fit on a GPU belongs here.
    """
    return serial_device()


def serial_device() -> wp.Device:
    """The CPU: for kernels of few threads and long chains of dependent steps, such as the greedy choice.

    One thread of a GPU takes tens of times as long for them. They are given and give NumPy arrays.
    """
    return wp.get_device("cpu")


def pool() -> ThreadPoolExecutor:
    """The worker threads that CPU launches are split over."""
    global _pool
    with _start_lock:
        if _pool is None:
            _pool = ThreadPoolExecutor(
                max_workers=max(1, core_count() - 1), thread_name_prefix="resfit-launch"
            )
        return _pool


def _start_anew() -> None:
    """In a forked child: without the threads of the parent, what they hold and what they asked for."""
    global _pool, _start_lock
    # As locked as it was: the fork may have met other threads anywhere.
    _start_lock = threading.Lock()
    _pool = None
    me = threading.get_ident()
    if _switching and me not in _switching:
        sys.setswitchinterval(_usual_switching)
    _switching[:] = [thread for thread in _switching if thread == me]


after_fork_in_child(_start_anew)


def launch(
    kernel: wp.Kernel,
    count: int | Callable[[], int],
    inputs: Sequence[Any],
    outputs: Sequence[Any],
    device: wp.Device,
    seconds_per_thread: float = 0.0,
) -> None:
    """Run `kernel` over `count` threads, never recorded on a tape.

    Args:
        kernel: its first parameter is `first: int`, added to `wp.tid()`; it is passed here, not in `inputs`.
        count: number of threads; 0 launches nothing. A function is asked anew each time that a `LaunchGraph` repeats
            the launch.
        inputs, outputs: the other arguments, in order.
        device: where the arrays are.
        seconds_per_thread: a guess of one thread's time on one core; launches worth it are split over the cores.
    """
    commands: list[Callable[[], None]] | None = getattr(_local, "commands", None)
    if commands is not None:
        load(kernel, device)
        commands.append(_RecordedLaunch(kernel, count, inputs, outputs, device, seconds_per_thread).run)
        commands[-1]()
        return
    threads = count() if callable(count) else count
    if threads <= 0:
        return
    load(kernel, device)

    def run(low: int, high: int) -> None:
        wp.launch(kernel, high - low, [low, *inputs], outputs, device=device, record_tape=False)

    with _counted(kernel):
        _run_in_parts(run, _edges(threads, seconds_per_thread, device))


def _edges(count: int, seconds_per_thread: float, device: wp.Device) -> list[int]:
    """Edges of the ranges that a launch is cut into for the cores."""
    parts = 1
    if device.is_cpu and count * seconds_per_thread > SPLIT_SECONDS:
        parts = min(_cores_here(), count)
    return [count * part // parts for part in range(parts + 1)]


def _run_in_parts(run: Callable[[int, int], None], edges: list[int]) -> None:
    """Run the ranges between edges side by side, the first one on this thread."""
    workers = [pool().submit(run, low, high) for low, high in pairwise(edges[1:])]
    run(edges[0], edges[1])
    for worker in workers:
        worker.result()


@dataclass
class Usage:
    """Launch count and run time of a kernel."""

    launches: int = 0
    seconds: float = 0.0
    """Wall seconds on the CPU, all parts of a launch together."""


@contextmanager
def profiled() -> Iterator[dict[str, Usage]]:
    """Within, launches of all threads are counted and timed, by their kernels' names."""
    global _usage
    _usage = {}
    try:
        yield _usage
    finally:
        _usage = None


@contextmanager
def _profiling(kernel: wp.Kernel, usage: dict[str, Usage]) -> Iterator[None]:
    begin = time.perf_counter()
    yield
    seconds = time.perf_counter() - begin
    with _start_lock:
        found = usage.setdefault(kernel.key.rsplit("__", 1)[-1], Usage())
        found.launches += 1
        found.seconds += seconds


def _counted(kernel: wp.Kernel) -> AbstractContextManager[None]:
    """Counts a launch where launches are profiled."""
    return _NOT_COUNTED if _usage is None else _profiling(kernel, _usage)


@contextmanager
def recorded() -> Iterator[list[Callable[[], None]]]:
    """Within, this thread's launches on the CPU run and are kept; calling what is yielded in order repeats them."""
    _local.commands = []
    try:
        yield _local.commands
    finally:
        _local.commands = None


class _RecordedLaunch:
    """A launch on the CPU whose arguments are packed."""

    def __init__(
        self,
        kernel: wp.Kernel,
        count: int | Callable[[], int],
        inputs: Sequence[Any],
        outputs: Sequence[Any],
        device: wp.Device,
        seconds_per_thread: float,
    ):
        self.kernel, self.count, self.device, self.seconds = kernel, count, device, seconds_per_thread
        self.inputs, self.outputs = inputs, outputs
        self.edges: list[int] = []
        self.parts: dict[int, wp.Launch] = {}

    def run(self) -> None:
        """Launch it once more."""
        if callable(self.count) or not self.edges:
            count = self.count() if callable(self.count) else self.count
            edges = _edges(count, self.seconds, self.device)
            if edges != self.edges:
                self.edges = edges
                for number, (low, high) in enumerate(pairwise(edges)):
                    self._part(number).set_dim(high - low)
                    self._part(number).set_param_at_index(0, low)
        if self.edges[-1] > 0:
            with _counted(self.kernel):
                _run_in_parts(self._launch, self.edges)

    def _part(self, number: int) -> wp.Launch:
        if number not in self.parts:
            self.parts[number] = wp.launch(
                self.kernel,
                1,
                [0, *self.inputs],
                self.outputs,
                device=self.device,
                record_tape=False,
                record_cmd=True,
            )
        return self.parts[number]

    def _launch(self, low: int, high: int) -> None:
        self.parts[self.edges.index(low)].launch()
