"""Worker process that reads a mesh for another process: see `reader.py`.

It may take a share of the machine's memory and no more, is the first to go where memory runs out all the same, and ends
with its parent.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import sys
import traceback
from contextlib import suppress
from pathlib import Path

from resfit.errors import InputError

MEMORY_SHARE = 0.75
"""Of the machine's memory, for reading one mesh."""

PR_SET_PDEATHSIG = 1
"""Of Linux's prctl: the signal that ends a process when its parent is gone."""


def read_for_parent() -> None:
    """Read the file that the command line names, and write the mesh or the error to stdout, pickled."""
    # Whatever packages print must not get in between.
    answer = os.dup(1)
    os.dup2(2, 1)
    _end_with_parent()
    content = _pickled_mesh(sys.argv[1])
    with open(answer, "wb") as stream:
        stream.write(content)


def _pickled_mesh(path: str) -> bytes:
    allowed = 0
    try:
        from .load import load_mesh

        allowed = _limit_memory(int(MEMORY_SHARE * machine_memory()))
        return pickle.dumps(load_mesh(path), protocol=pickle.HIGHEST_PROTOCOL)
    except InputError as error:
        found = error
    except MemoryError:
        more = f"more than {allowed / 1e9:.1f} GB of" if allowed else "too much"
        found = InputError(
            f"reading '{path}' takes {more} memory; reduce the mesh, or fit it on a machine with more memory."
        )
    except Exception as error:
        # A defect: the parent's log is to have what is known about it.
        found = RuntimeError(f"{type(error).__name__} while reading '{path}': {error}")
        found.add_note(traceback.format_exc())
    return pickle.dumps(found)


def machine_memory() -> int:
    """Bytes of memory that the machine or the container has; 0 where that cannot be told."""
    limits = []
    with suppress(OSError, ValueError, AttributeError):
        limits.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    for name in ("memory.max", "memory/memory.limit_in_bytes"):
        # Containers: version 2 and 1 of control groups; "max" stands for no limit.
        with suppress(OSError, ValueError):
            limits.append(int(Path("/sys/fs/cgroup", name).read_text()))
    return min(limits, default=0)


def _limit_memory(allowance: int) -> int:
    """Let this process have so many bytes more than it has now; returns how many it may have, 0 for no limit.

    Addresses are counted, of which libraries reserve many that they never use: hence those of now do not count.
    """
    try:
        import resource

        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    except (ImportError, OSError, ValueError):
        # Other systems know no such limit, or do not keep it.
        return 0
    unlimited = resource.RLIM_INFINITY
    limits = [limit for limit in (soft, hard) if limit != unlimited]
    limits += [used + allowance] if allowance else []
    if not limits:
        return 0
    resource.setrlimit(resource.RLIMIT_AS, (min(limits), hard))
    return max(0, min(limits) - used)


def _end_with_parent() -> None:
    """Let no reading go on that nobody waits for, and let the system end this process before any other one."""
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("1000")
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
