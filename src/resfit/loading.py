"""Loading modules quickly. Imports nothing heavy, so that it can be loaded first."""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module

from resfit.kernels.runtime.forks import unforked

_process_is_ours = False


def own_process() -> None:
    """Say that this process is a command's: what is loaded stays until it ends."""
    global _process_is_ours
    _process_is_ours = True


@contextmanager
def without_collector() -> Iterator[None]:
    """Within, modules load without the garbage collector: a fit's are very many objects, none of which goes again.

    The collector would look through them again and again while they load, and each time that it looks at everything
    later: in a process of ours it leaves them out for good.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if _process_is_ours:
            gc.freeze()
        if enabled:
            gc.enable()


def load_behind(*names: str) -> None:
    """Load modules on another thread; who imports one of them meanwhile waits for it."""

    def load() -> None:
        # Whoever needs it will meet the same error, and say so.
        with unforked(), suppress(Exception):
            for name in names:
                import_module(name)

    threading.Thread(target=load, name="resfit-loading", daemon=True).start()
