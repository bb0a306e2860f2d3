"""Errors that users may meet. Each message is one plain sentence: what, where, why, what to do."""

from __future__ import annotations


class ResfitError(Exception):
    """Base of every error raised on purpose; `exit_code` is what the command line ends with."""

    exit_code = 1


class InputError(ResfitError):
    """A file, folder or option that cannot be used; nothing was written."""

    exit_code = 2


class AssemblyError(InputError):
    """An assembly that is not valid: the message names the field."""


class StoppedError(ResfitError):
    """A fit that was stopped before there was anything to write."""

    exit_code = 4


class DeviceError(InputError):
    """A compute device that is not there."""
