"""The folder of a fit: which one may be used, and how it is filled so that nothing is half-written or lost."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from resfit.errors import InputError

from ..assembly.atomic_write import sync
from ..assembly.report import REPORT, read_report
from ..assembly.temporary import abandoned, is_temporary, temporary_name
from .exchange import exchange, locked

OURS = ("assembly.json", "parts.glb", "preview.png", "history.npz", "viewer.html", REPORT)
"""Files that a fit writes, the report last: it is what makes a folder ours."""

PARETO = ("pareto.csv", "pareto.json", "pareto.svg")
"""Files that a fit writes if the trade-off was asked for."""

PARETO_FOLDER = "pareto"
"""Where the assemblies of the trade-off lie, assembly_NN.json."""

BEGUN = "replacing"
"""File of a temporary folder within that of an earlier fit: its files are being replaced one by one, and until the new
report is there it is still a folder of ours."""


def default_folder(mesh: Path) -> Path:
    """Default folder of the fit of a mesh file: STEM.resfit in the current folder."""
    return Path(f"{mesh.stem}.resfit")


def holds_fit(folder: Path) -> bool:
    """True if a report.json of ours lies in `folder`."""
    return bool(read_report(folder))


def check_folder(folder: Path, inputs: Iterable[Path] = ()) -> None:
    """Refuse a folder that may not be filled, before any work is done for it.

    Args:
        folder: where a fit is to go; it need not exist.
        inputs: files that must survive.

    Raises:
        InputError: if it is no folder, holds other things than a fit of ours, cannot be written to, or one of the
            inputs would be overwritten.
    """
    try:
        if folder.is_dir():
            if not _is_free(folder):
                raise InputError(
                    f"'{folder}' is not empty and holds no earlier fit; give another folder with -o, or empty it."
                )
        elif os.path.lexists(folder):
            raise InputError(f"'{folder}' is there and is no folder; give another one with -o.")
        taken = {os.path.realpath(folder / name) for name in (*OURS, *PARETO)}
        for path in inputs:
            if os.path.realpath(path) in taken:
                raise InputError(
                    f"the fit would overwrite '{path}', which it reads; give another folder with -o."
                )
        base = next(parent for parent in (folder, *folder.absolute().parents) if os.path.lexists(parent))
        # Asking for permission does not tell about read-only and full file systems. Where it can be, this file has no
        # name: nothing is left of it, whatever happens.
        with tempfile.TemporaryFile(dir=base, prefix=temporary_name()) as probe:
            probe.write(b"\0")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "the name is not a valid path"
        raise InputError(f"cannot write to '{folder}': {reason}.") from error


@contextmanager
def filling(folder: Path) -> Iterator[Path]:
    """A temporary folder to write to, whose files become those of `folder` when the block ends well.

    Files of an earlier fit are replaced or removed, other files stay. Where the folder holds nothing else, old and new
    change places in one operation; else the report goes first and comes last, so that a mixture is never a fit.

    Raises:
        InputError: if the folder may not be used, or writing fails; what was in it before is untouched.
    """
    check_folder(folder)
    place = Path(os.path.realpath(folder))
    try:
        temporary = _make_temporary(place)
        try:
            yield temporary
            for path in (*temporary.rglob("*"), temporary):
                sync(path)
            _put(temporary, place)
        finally:
            if not (temporary / BEGUN).exists():
                _remove(temporary)
        sync(place.parent)
    except OSError as error:
        reason = error.strerror or "the file system refused"
        raise InputError(f"cannot write to '{folder}': {reason}.") from error
    for left in (*abandoned(place), *abandoned(place.parent)):
        _remove(left)


def _is_free(folder: Path) -> bool:
    """True if a folder is empty, or holds a fit, or one being replaced when its process was killed."""
    entries = list(folder.iterdir())
    if all(is_temporary(entry.name) for entry in entries) or holds_fit(folder):
        return True
    return any(is_temporary(entry.name) and (entry / BEGUN).exists() for entry in entries)


def _make_temporary(folder: Path) -> Path:
    """An empty folder on the file system of `folder`: beside it, or within it where that is not possible."""
    if not (folder.is_dir() and _is_other_device(folder)):
        beside = folder.with_name(temporary_name(folder.name))
        try:
            beside.mkdir(parents=True)
            return beside
        except OSError:
            if not folder.is_dir():
                raise
    within = folder / temporary_name()
    within.mkdir()
    return within


def _is_other_device(folder: Path) -> bool:
    return folder == folder.parent or folder.stat().st_dev != folder.parent.stat().st_dev


def _put(source: Path, folder: Path) -> None:
    """Make the files of `source` those of `folder`, which may have come to be there by now."""
    while not os.path.lexists(folder):
        try:
            os.rename(source, folder)
            return
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
    with locked(folder):
        if not _is_free(folder):
            raise InputError(
                f"'{folder}' has come to hold other files meanwhile; the fit is in '{_put_aside(source, folder)}'."
            )
        if _is_exchangeable(source, folder) and exchange(source, folder):
            # What has come into the old one since goes to the new one.
            for path in source.iterdir():
                if not _is_ours(path) and not os.path.lexists(folder / path.name):
                    os.rename(path, folder / path.name)
        else:
            _replace_files(_moved_within(source, folder), folder)


def _put_aside(source: Path, folder: Path) -> Path:
    """Give `source` a name beside `folder` that people find, and return it."""
    for number in range(2, 1000):
        aside = folder.with_name(f"{folder.name[:80]}-{number}")
        if not os.path.lexists(aside):
            os.rename(source, aside)
            return aside
    raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST))


def _is_exchangeable(source: Path, folder: Path) -> bool:
    """True if nobody misses the old folder itself, and `source`, which becomes it, is made its equal."""
    if source.parent == folder or not all(_is_ours(path) for path in folder.iterdir()):
        return False
    with suppress(OSError):
        # A shell that works in there would be left in a folder that is gone.
        if Path.cwd().is_relative_to(folder):
            return False
    old, new = folder.stat(), source.stat()
    if (old.st_uid, old.st_gid) != (new.st_uid, new.st_gid):
        return False
    shutil.copystat(folder, source)
    os.utime(source)
    return True


def _is_ours(path: Path) -> bool:
    """True if an entry of a fit's folder is one that a fit writes."""
    if path.name == PARETO_FOLDER:
        return path.is_dir() and all(_is_of_curve(entry) for entry in path.iterdir())
    return path.name in (*OURS, *PARETO)


def _is_of_curve(path: Path) -> bool:
    """True if an entry of the trade-off's folder is one that a fit writes."""
    return path.match("assembly_*.json") and not path.is_dir()


def _moved_within(source: Path, folder: Path) -> Path:
    """`source` as a temporary folder in `folder`."""
    if source.parent == folder:
        return source
    within = folder / temporary_name()
    try:
        os.rename(source, within)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        # The folder is a mount of the same file system.
        shutil.copytree(source, within)
    return within


def _replace_files(source: Path, folder: Path) -> None:
    """Move all files of `source`, which lies in `folder`, there; what else is there from an earlier fit goes."""
    new = {path.name for path in source.iterdir() if path.is_file()}
    try:
        os.replace(folder / REPORT, source / BEGUN)
    except FileNotFoundError:
        (source / BEGUN).touch()
    _replace_curve(source / PARETO_FOLDER, folder / PARETO_FOLDER)
    for name in (*OURS, *PARETO):
        if name not in new:
            (folder / name).unlink(missing_ok=True)
    for name in sorted(new, key=lambda name: (name == REPORT, name)):
        os.replace(source / name, folder / name)
    sync(folder)
    _remove(source)


def _replace_curve(source: Path, folder: Path) -> None:
    """The same for the assemblies of the trade-off; other files in their folder stay."""
    if folder.is_dir():
        for path in folder.glob("assembly_*.json"):
            path.unlink()
        if not source.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
    if source.is_dir():
        folder.mkdir(exist_ok=True)
        for path in sorted(source.iterdir()):
            os.replace(path, folder / path.name)


def _remove(temporary: Path) -> None:
    """Remove a temporary folder or file, as far as it holds what we write: never anything else."""
    with suppress(OSError):
        if not temporary.is_dir() or temporary.is_symlink():
            temporary.unlink()
            return
        curve = temporary / PARETO_FOLDER
        for path in [*temporary.iterdir(), *(curve.iterdir() if curve.is_dir() else ())]:
            if path.name in (*OURS, *PARETO, BEGUN) or is_temporary(path.name) or _is_of_curve(path):
                with suppress(OSError):
                    path.unlink()
        with suppress(OSError):
            curve.rmdir()
        temporary.rmdir()
