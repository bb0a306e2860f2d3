"""Kernels are made once, however many threads ask for them at the same time."""

import threading
import time

from resfit.kernels.runtime.cached_kernel import cached_kernel


def test_threads_that_ask_at_once_get_the_same() -> None:
    calls: list[str] = []
    begin = threading.Barrier(8)

    @cached_kernel
    def make(name: str) -> object:
        calls.append(name)
        time.sleep(0.02)
        return object()

    found: list[object] = []

    def ask() -> None:
        begin.wait()
        found.append(make("one"))

    threads = [threading.Thread(target=ask) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert calls == ["one"]
    assert len(found) == 8 and len(set(map(id, found))) == 1
    assert make("two") is not found[0]
