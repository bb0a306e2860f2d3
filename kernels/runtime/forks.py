"""Forks of the process: what other threads do to kernels and modules is finished first, so that the child can go on.

A forked child has the memory of its parent, but of its threads only the one that forked. A lock that another thread
held stays locked there for ever, and a module that it was loading stays half loaded. Imports nothing heavy.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

_changed = threading.Condition(threading.RLock())
_busy: dict[int, int] = {}
"""Threads that are in a block of `unforked`, and how deep."""
_held: list[Any] = []
"""Locks of Warp that are held over a fork."""


@contextmanager
def unforked() -> Iterator[None]:
    """Within, other threads cannot fork this process: they wait."""
    me = threading.get_ident()
    with _changed:
        _busy[me] = _busy.get(me, 0) + 1
    try:
        yield
    finally:
        with _changed:
            _busy[me] -= 1
            if not _busy[me]:
                del _busy[me]
            _changed.notify_all()


def after_fork_in_child(reset: Callable[[], None]) -> None:
    """Have `reset` called in every forked child."""
    # There are no forks on Windows.
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=reset)


def _wait_for_others() -> None:
    """Before a fork: until no other thread is in a block of `unforked`, and from then on none can enter one."""
    _changed.acquire()
    while set(_busy) - {threading.get_ident()}:
        _changed.wait()
    # Many a launch holds this one for a moment. The name is private, so it may be gone one day.
    lock = getattr(sys.modules.get("warp._src.codegen"), "_codegen_lock", None)
    if lock is not None:
        lock.acquire()
        _held.append(lock)


def _let_go() -> None:
    """After a fork, in the parent and in the child."""
    while _held:
        _held.pop().release()
    _changed.release()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_wait_for_others, after_in_parent=_let_go, after_in_child=_let_go)
