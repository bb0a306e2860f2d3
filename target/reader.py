"""A mesh that another process reads, while this one loads its kernels.

trimesh and what it imports take long to load, and hold the interpreter all the while: on another core they cost
little time. What comes back is what `load_mesh` would have returned or raised. Imports nothing heavy.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from resfit.errors import InputError

from ..kernels.cores import core_count

if TYPE_CHECKING:
    from .load import LoadedMesh

CODE = "import gc; gc.disable(); from resfit.target.reader import read_for_parent; read_for_parent()"
"""What the other process does. It ends with the reading: nothing that it loads is garbage."""


class MeshReader(os.PathLike[str]):
    """The path of a mesh, which is being read already: `load_mesh` takes one wherever it takes a path."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Begin to read."""
        self.path = os.fspath(path)
        # In a session of its own: Ctrl-C at a terminal is for the fit to handle.
        self._process = subprocess.Popen(
            [sys.executable, "-c", CODE, self.path],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def __fspath__(self) -> str:
        return self.path

    def read(self) -> LoadedMesh:
        """What was read; once only. If the other process failed, this one tries for itself.

        Raises:
            InputError: if the file cannot be read or holds no surface.
        """
        from .load import load_mesh

        answer = self._process.communicate()[0]
        if self._process.returncode:
            return load_mesh(self.path)
        found = pickle.loads(answer)
        if isinstance(found, InputError):
            raise found
        return found

    def close(self) -> None:
        """End the other process, whether or not it has come to an end."""
        with self._process as process:
            process.kill()


@contextmanager
def reading_ahead(path: Path) -> Iterator[Path | MeshReader]:
    """The path of a mesh which is read meanwhile, where that gains time: where there is another core."""
    if core_count() < 2:
        yield path
        return
    reader = MeshReader(path)
    try:
        yield reader
    finally:
        reader.close()


def read_for_parent() -> None:
    """The other process: read the file that the command line names, and write the mesh or the error to stdout."""
    from .load import load_mesh

    try:
        found = load_mesh(sys.argv[1])
    except InputError as error:
        found = error
    sys.stdout.buffer.write(pickle.dumps(found, protocol=pickle.HIGHEST_PROTOCOL))
