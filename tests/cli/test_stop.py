"""Ctrl-C as a wish to stop: the first is kept, the second aborts, and handlers are put back."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from resfit.cli.stop import catching_signals


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_asks_and_the_second_aborts(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with catching_signals() as stop:
        assert not stop()
        os.kill(os.getpid(), number)
        assert stop() and stop.requested
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)
    assert signal.getsignal(number) is before


def test_in_another_thread_nothing_is_caught() -> None:
    """Python lets only the main thread ask for signals."""
    before, asked = signal.getsignal(signal.SIGINT), []

    def work() -> None:
        with catching_signals() as stop:
            asked.append((stop(), signal.getsignal(signal.SIGINT)))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert asked == [(False, before)]
