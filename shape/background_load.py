"""A mesh that another process reads, while this one loads its kernels.

trimesh and what it imports take long to load, and hold the interpreter all the while: on another core they cost
little time. On one core too, a reading that takes all memory, crashes or does not end does no harm there. What comes
back is what `load_mesh` would have returned or raised. Imports nothing heavy.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from resfit.children import python_command
from resfit.errors import InputError, StoppedError

if TYPE_CHECKING:
    from .loaded_mesh import LoadedMesh

CODE = "import gc; gc.disable(); from resfit.shape.reading import read_for_parent; read_for_parent()"
"""What the other process does. It ends with the reading: nothing that it loads is garbage."""

LOOK_SECONDS = 0.05
"""Between two looks at whether to stop."""


class MeshReader(os.PathLike[str]):
    """The path of a mesh, which is being read already: `load_mesh` takes one wherever it takes a path."""

    should_stop: Callable[[], bool]
    """Asked often while the reading goes on, which ends as soon as this is True."""

    def __init__(self, path: str | os.PathLike[str], should_stop: Callable[[], bool] = lambda: False) -> None:
        """Begin to read.

        Raises:
            InputError: if no process can be started.
        """
        self.path = os.fspath(path)
        self.should_stop = should_stop
        try:
            # In a session of its own: Ctrl-C at a terminal is for the fit to handle.
            self._process = subprocess.Popen(
                python_command("-c", CODE, self.path),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"'{self.path}' cannot be read in a process of its own: {reason}.") from error

    def __fspath__(self) -> str:
        return self.path

    def read(self) -> LoadedMesh:
        """Result of the reading; once only.

        Raises:
            InputError: if the file cannot be read or holds no surface, or reading it ended the other process.
            StoppedError: if it was stopped before.
        """
        answer, code = self._wait(), self._process.returncode
        if code == -signal.SIGKILL:
            raise InputError(
                f"the process that read '{self.path}' was killed, as happens where memory runs out; reduce the mesh,"
                " or fit it on a machine with more memory."
            )
        if code < 0:
            raise InputError(
                f"reading '{self.path}' crashed ({signal.Signals(-code).name}); export the file again, or convert it"
                " to another format."
            )
        if code:
            raise RuntimeError(f"the process that read '{self.path}' ended with exit code {code}")
        found = pickle.loads(answer)
        if isinstance(found, Exception):
            raise found
        return found

    def close(self) -> None:
        """End the other process, whether or not it has come to an end."""
        with self._process as process:
            process.kill()

    def _wait(self) -> bytes:
        """All that the other process writes."""
        while True:
            try:
                return self._process.communicate(timeout=LOOK_SECONDS)[0]
            except subprocess.TimeoutExpired:
                if self.should_stop():
                    self.close()
                    raise StoppedError("stopped before the mesh was read; nothing was written.") from None


@contextmanager
def reading(source: Any, should_stop: Callable[[], bool] = lambda: False) -> Iterator[Any]:
    """`source`; a path is read meanwhile, by a process that ends as soon as it is to stop.

    Args:
        source: a path, a reader, whose reading is to be stopped by this from now on, or anything else.
        should_stop: whether to stop.
    """
    if isinstance(source, MeshReader):
        source.should_stop = should_stop
    elif isinstance(source, str | os.PathLike):
        reader = MeshReader(source, should_stop)
        try:
            yield reader
        finally:
            reader.close()
        return
    yield source
