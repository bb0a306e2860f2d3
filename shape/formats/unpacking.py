"""Limits for packed data: what a file of a few bytes may unpack to."""

from __future__ import annotations

import bz2
import errno
import gzip
import struct
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import disk_usage
from typing import Protocol

from resfit.errors import InputError

RATIO = 100
"""How many times its size a file may unpack to; meshes in text get to about 20."""
ALWAYS = 256 << 20
"""Bytes that any file may unpack to."""
MOST_MEMBERS = 10_000
GIVE = "unpack it and give the mesh in it"
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2)
"""The methods of ZIP whose decoders take little memory whatever the file says."""


class Stream(Protocol):
    """Protocol of a readable stream."""

    def read(self, size: int = -1, /) -> bytes: ...


def allowance(path: Path) -> int:
    """Bytes that a file may unpack to, at most half of what is free for temporary files."""
    return min(max(ALWAYS, RATIO * path.stat().st_size), disk_usage(tempfile.gettempdir()).free // 2)


class Metered:
    """A stream that is read in small steps, and refused once more has come than allowed."""

    def __init__(self, stream: Stream, allowed: int, path: Path) -> None:
        self._stream, self._left, self._path = stream, allowed, path

    def read(self, size: int = 1 << 16, /) -> bytes:
        """At most `size` bytes.

        Raises:
            InputError: if that is more than allowed.
        """
        # A damaged length must not be allocated.
        found = self._stream.read(min(size, 1 << 20))
        self._left -= len(found)
        if self._left < 0:
            raise _too_large(self._path)
        return found


def _too_large(path: Path, way: str = GIVE) -> InputError:
    """Error about a file that unpacks to more than it may; `way` is what to do."""
    return InputError(
        f"'{path}' unpacks to more than {RATIO} times its size, or than half of the free disk; {way}."
    )


@contextmanager
def refusing_damage(path: Path, kind: str) -> Iterator[None]:
    """Within, what a decoder raises means that the file is damaged.

    Raises:
        InputError: in place of that.
    """
    try:
        yield
    except InputError:
        raise
    except _DAMAGE as error:
        # Decoders raise OSError without a number; a seek to a place that a damaged file names is an invalid argument.
        if isinstance(error, OSError) and error.errno not in (None, errno.EINVAL):
            raise
        raise InputError(f"'{path}' is a damaged {kind}; export or download it again.") from error


_DAMAGE = (
    zipfile.BadZipFile, tarfile.TarError, gzip.BadGzipFile, zlib.error, EOFError, OSError, ValueError, LookupError,
    OverflowError, NotImplementedError, struct.error, RuntimeError,
)  # fmt: skip


def open_packed(path: Path, magic: bytes) -> gzip.GzipFile | bz2.BZ2File | None:
    """The unpacked content of a gzip or bzip2 file; None if it is neither, by its first bytes."""
    if magic.startswith(b"\x1f\x8b"):
        return gzip.open(path)
    return bz2.open(path) if magic.startswith(b"BZh") else None


def check_members(path: Path, members: Iterable[zipfile.ZipInfo], way: str = GIVE) -> None:
    """Check members of a ZIP archive before any is unpacked. None can give more bytes than it declares.

    Raises:
        InputError: if they are encrypted, or are too many or too large.
    """
    members = list(members)
    if len(members) > MOST_MEMBERS:
        raise too_many(path)
    if sum(member.file_size for member in members) > allowance(path):
        raise _too_large(path, way)
    for member in members:
        if member.flag_bits & 1:
            raise InputError(f"'{path}' is encrypted; {way}.")
        if member.compress_type not in METHODS:
            raise InputError(f"'{path}' is packed by a method that is not read here; {way}.")


def too_many(path: Path) -> InputError:
    """Error about an archive of too many files."""
    return InputError(
        f"'{path}' holds more than {MOST_MEMBERS} files; unpack it and give one of the meshes in it."
    )
