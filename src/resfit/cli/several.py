"""`resfit fit` of several meshes: one after the other, whatever becomes of one."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from resfit.cli.failures import FAILED, STOPPED, answered, complain
from resfit.cli.inputs import check_mesh
from resfit.cli.progress import ProgressMode
from resfit.cli.single import fit_and_write
from resfit.cli.stop import Stop, catching_signals
from resfit.cli.watching import Watcher
from resfit.clock import Clock
from resfit.errors import InputError
from resfit.loading import without_collector
from resfit.result.folder import check_folder, default_folder


def fit_each(
    meshes: Sequence[Path],
    output: Path | None,
    progress: ProgressMode,
    options: dict[str, Any],
    quiet: bool,
) -> int:
    """Fit meshes one after the other, each into its own folder; returns the exit code.

    Args:
        meshes: the files.
        output: folder that the fits come to lie in; the current one unless given.
        progress: how to show it.
        options: keywords of `resfit.api.fit`.
        quiet: whether to leave out the summaries.

    Raises:
        InputError: before the work begins, if a mesh is not there, an option or a folder cannot be used, or two meshes
            would have the same folder. A file that cannot be read is one failed fit among others.
    """
    folders = own_folders(meshes, output or Path())
    for mesh, folder in folders.items():
        if mesh.is_dir() or not mesh.exists():
            check_mesh(mesh)
        check_folder(folder, meshes)
    _check_options(options)
    with catching_signals() as stop:
        return _fit_in_turn(folders, progress, options, quiet, stop)


def own_folders(meshes: Sequence[Path], output: Path) -> dict[Path, Path]:
    """Mesh to folder of its fit, below `output`.

    Raises:
        InputError: if two meshes would have the same folder.
    """
    folders: dict[Path, Path] = {}
    taken: dict[str, Path] = {}
    for mesh in meshes:
        if mesh in folders:
            raise InputError(f"'{mesh}' is given twice; give it once.")
        folder = output / default_folder(mesh)
        # Some file systems do not tell capital letters from small ones.
        first = taken.setdefault(os.path.realpath(folder).casefold(), mesh)
        if first is not mesh:
            raise InputError(
                f"'{first}' and '{mesh}' would both be written to '{folder}'; fit one of them alone, with -o."
            )
        folders[mesh] = folder
    return folders


def _check_options(options: dict[str, Any]) -> None:
    """Refuse options that no mesh can be fitted with: that is to be said once.

    Raises:
        InputError: if so.
    """
    with without_collector():
        from resfit.api import check_objective, make_config
        from resfit.kernels.runtime.launch import choose_device

    own = ("preset", "init", "objective")
    fields = {name: value for name, value in options.items() if name not in own}
    config = make_config(None, options.get("preset"), fields)
    check_objective(options.get("objective"), None, config)
    choose_device(config.device)


def _fit_in_turn(
    folders: dict[Path, Path], progress: ProgressMode, options: dict[str, Any], quiet: bool, stop: Stop
) -> int:
    """Fit every mesh until it is to stop, say which ones have no fit, and return the exit code."""
    written: dict[Path, int] = {}

    def fit(mesh: Path, clock: Clock) -> int:
        check_mesh(mesh)
        code, result = fit_and_write(mesh, folders[mesh], progress, options, stop, clock, quiet, Watcher())
        if not result.placeholder:
            written[mesh] = code
        return code

    for number, mesh in enumerate(folders):
        if stop.requested:
            break
        clock = Clock.now() if number else Clock.of_process()
        answered(lambda mesh=mesh, clock=clock: fit(mesh, clock))
    missing = [mesh for mesh in folders if mesh not in written]
    if missing:
        names = ", ".join(f"'{mesh}'" for mesh in missing)
        count = f"{len(missing)} of {len(folders)} meshes {'was' if len(missing) == 1 else 'were'} not fitted"
        complain(f"{'stopped; ' if stop.requested else ''}{count}: {names}.", FAILED)
    if stop.requested:
        return STOPPED
    return FAILED if missing else max(written.values())
