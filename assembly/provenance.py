"""Provenance of an assembly: enough to make it again, and nothing that differs between two runs that agree.

Times, paths and core counts stay out: same input, same seed and same options are the same bytes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from resfit.errors import InputError


@dataclass(frozen=True)
class Provenance:
    """Versions, seed, options and input of the fit; what is None or empty is left out of the file."""

    resfit: str | None = None
    """Version of this package."""
    warp: str | None = None
    """Version of NVIDIA Warp, whose compiler decides the last bits."""
    seed: int | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    """Options of the fit, JSON values."""
    input_sha256: str | None = None
    """SHA-256 of the bytes of the input file, 64 hexadecimal digits."""

    @classmethod
    def current(
        cls,
        *,
        seed: int | None = None,
        options: Mapping[str, Any] | None = None,
        input_sha256: str | None = None,
    ) -> Provenance:
        """The provenance of a fit by the installed versions."""
        return cls(_version("resfit"), _version("warp-lang"), seed, dict(options or {}), input_sha256)


def sha256_of_file(path: str | Path) -> str:
    """SHA-256 of a file's bytes.

    Raises:
        InputError: if it cannot be read.
    """
    try:
        with open(path, "rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
