"""Exit codes of commands that fail, each with one sentence on stderr."""

from __future__ import annotations

import os
import sys
import tempfile
import traceback
from collections.abc import Callable

from resfit.cli.terminal import tell
from resfit.errors import ResfitError

DEFECT, UNUSABLE, FAILED, STOPPED = 1, 2, 3, 4
"""Exit codes: a defect of ours, unusable input, some of several failed, stopped early."""


def answered(run: Callable[[], int]) -> int:
    """Exit code that `run` returns, or that of what it raises, which is told.

    Raises:
        KeyboardInterrupt: as `run` does.
    """
    try:
        return run()
    except ResfitError as error:
        return complain(str(error), error.exit_code)
    except MemoryError:
        return complain("there is not enough memory for this here; free some, or raise its limit.", UNUSABLE)
    except Exception as error:
        sentence = f"this is a defect of resfit ({type(error).__name__}): {error}; the log is {_write_log()}"
        return complain(sentence, DEFECT)


def complain(sentence: str, code: int) -> int:
    """One line on stderr, whatever the message was made of; returns `code`."""
    tell("resfit: " + " ".join(sentence.split()))
    return code


def _write_log() -> str:
    """Write the traceback of the current exception to a new file and return its path."""
    try:
        descriptor, path = tempfile.mkstemp(prefix="resfit-", suffix=".log")
        with os.fdopen(descriptor, "w", encoding="utf-8", errors="replace") as stream:
            stream.write(f"resfit {' '.join(sys.argv[1:])}\npython {sys.version}\n\n{traceback.format_exc()}")
        return path
    except OSError:
        return "lost, because no temporary file can be written"
