"""Writing to stdout and stderr where they may be closed, full, read by nobody, or ASCII only.

What becomes of a command does not depend on who listens: progress and complaints that cannot be told are dropped. Only
where what is printed is the result itself is its loss an error.
"""

from __future__ import annotations

import errno
import io
import os
import select
import sys
from contextlib import suppress
from typing import Any, TextIO, cast

STDOUT, STDERR = 1, 2

_lost: list[OSError] = []
"""Why what was printed to stdout could not be written."""


class TolerantFile(io.FileIO):
    """A descriptor on which writing never fails: what cannot be written is dropped."""

    def __init__(self, descriptor: int, error: OSError | None = None) -> None:
        """A descriptor that stays open; with an error, all is dropped because of that."""
        super().__init__(descriptor, "w", closefd=False)
        self.error = error

    def write(self, data: Any, /) -> int:
        """Write `data`, or drop it; returns how many bytes of it are dealt with."""
        try:
            if self.error is not None:
                raise self.error
            while (count := super().write(data)) is None:
                # The descriptor was made not to wait, by somebody who shares it.
                select.select([], [self], [])
            return count
        except OSError as error:
            if self.fileno() == STDOUT:
                _lost.append(error)
            return memoryview(data).nbytes


def guard_streams() -> None:
    """Put tolerant streams in the place of stdout and stderr, for the rest of the process."""
    for number in (0, STDOUT, STDERR):
        try:
            os.fstat(number)
        except OSError:
            # Else the next file that is opened gets this number, and with it what is printed.
            os.open(os.devnull, os.O_RDWR)
    sys.stdout, sys.stderr = _guarded(sys.stdout, STDOUT), _guarded(sys.stderr, STDERR)


def _guarded(stream: TextIO | None, number: int) -> TextIO:
    """A tolerant stream in the place of one of the process's own; any other one stays."""
    if stream is None:
        closed = OSError(errno.EBADF, "it is closed")
        return io.TextIOWrapper(io.BufferedWriter(TolerantFile(number, closed)), "utf-8", "backslashreplace")
    binary = getattr(stream, "buffer", None)
    if type(getattr(binary, "raw", binary)) is not io.FileIO or stream.fileno() != number:
        # Consoles of Windows, and streams that somebody else has put there.
        return stream
    old, raw = cast(io.TextIOWrapper, stream), TolerantFile(number)
    return io.TextIOWrapper(
        cast(io.BufferedWriter, raw) if old.write_through else io.BufferedWriter(raw),
        old.encoding,
        "backslashreplace",
        line_buffering=old.line_buffering,
        write_through=old.write_through,
    )


def printable(line: str) -> str:
    """A line without what a terminal would obey or hide: control and direction characters of names, line ends."""
    return "".join(
        letter
        if letter.isprintable() or "\ud800" <= letter <= "\udfff"
        else letter.encode("unicode_escape").decode()
        for letter in line
    )


def tell(line: str) -> None:
    """One line on stderr, or none where it cannot be written."""
    with suppress(OSError, ValueError, AttributeError):
        sys.stderr.write(f"{printable(line)}\n")
        sys.stderr.flush()


def summarise(text: str) -> None:
    """Write to stdout about a result that lies in files: nothing is lost where nobody can read it."""
    flush()
    lost = list(_lost)
    with suppress(OSError, ValueError, AttributeError):
        sys.stdout.write(text)
    flush()
    _lost[:] = lost


def flush() -> None:
    """Write what stdout and stderr still hold."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):
            stream.flush()


def loss() -> str:
    """Error message of a printed result that did not arrive; empty if it did, or its reader had enough."""
    flush()
    if not _lost or _lost[0].errno == errno.EPIPE:
        return ""
    reason = (_lost[0].strerror or "it failed").lower()
    return f"the result could not be written to the standard output: {reason}."
