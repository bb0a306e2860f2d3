"""Kernels that are made when they are first needed, by whichever thread that is."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from .forks import unforked

Arguments = ParamSpec("Arguments")
Made = TypeVar("Made")

_lock = threading.RLock()


def cached_kernel(make: Callable[Arguments, Made]) -> Callable[Arguments, Made]:
    """Make something once for each tuple of positional arguments, also where several threads ask at the same time.

    `functools.cache` may call a function twice then: two kernels of one name in one module, of which Warp knows only
    the later, while the other one is launched.
    """
    made: dict[tuple[Any, ...], Made] = {}

    @wraps(make)
    def get(*args: Arguments.args, **options: Arguments.kwargs) -> Made:
        if args not in made:
            with unforked(), _lock:
                if args not in made:
                    made[args] = make(*args, **options)
        return made[args]

    return get
