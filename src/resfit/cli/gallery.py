"""`resfit gallery`: a static page of many fits; meshes that have none yet are fitted first."""

from __future__ import annotations

import hashlib
import re
import shlex
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from resfit.assembly.report import REPORT
from resfit.cli.failures import FAILED
from resfit.cli.terminal import summarise, tell
from resfit.errors import AssemblyError, InputError
from resfit.fitter.config import Preset

if TYPE_CHECKING:
    from resfit.eval.report.gallery import Entry


def gallery(
    *paths: Path,
    output: Annotated[Path, Parameter(name=("--output", "-o"))] = Path("gallery"),
    work: Path | None = None,
    preset: Preset = "balanced",
    timeout: float = 600.0,
    title: str = "Fits by resfit",
) -> int:
    """Write a static page of many fits: input beside assembly, numbers, commands, and each fit's own page.

    The folder may be opened from disk or put on any web server. Meshes without a fit of this preset among the given
    ones and those of earlier calls are fitted first, one process each; called again, it goes on where it was stopped.

    Args:
        paths: folders of fits, at any depth; meshes, and folders of meshes. The bundled mesh unless given.
        output: folder for index.html and what it links to.
        work: folder for the fits that this makes; OUTPUT.fits unless given.
        preset: of the fits that this makes.
        timeout: seconds a fit, after which the best so far is taken; 0 is off.
        title: of the page.
    """
    from importlib.resources import as_file, files

    from resfit.cli.demo import MESH

    work = work or output.with_name(f"{output.name}.fits")
    for path in paths:
        if not path.exists():
            raise InputError(f"there is no {path}; give meshes, and folders of meshes or of fits.")
    if paths:
        return write(list(paths), output, work, preset, timeout, title)
    with as_file(files("resfit.data") / MESH) as mesh:
        return write([mesh], output, work, preset, timeout, title)


def write(paths: list[Path], output: Path, work: Path, preset: str, timeout: float, title: str) -> int:
    """The same with all that is needed given."""
    from resfit.eval.report.gallery import find_fits, summary, write_gallery
    from resfit.eval.report.results import find_meshes

    folders = [path for path in paths if path.is_dir()]
    files = [path for path in paths if not path.is_dir()]
    # What lies in a fit's own folder is its result.
    inputs = [folder for folder in folders if not (folder / "report.json").exists()]
    meshes = {digest_of(mesh): mesh for mesh in [*files, *find_meshes(inputs)]}
    entries = read_entries(find_fits([*folders, *([work] if work.is_dir() else [])]))
    done = {entry.sha256 for entry in entries if entry.preset == preset and entry.status != "interrupted"}
    missing = [mesh for digest, mesh in meshes.items() if digest not in done]
    code = 0
    if missing:
        code = fit_all(missing, work, preset, timeout)
        entries = read_entries(find_fits([*folders, work]))
    if not entries:
        raise InputError("there is no fit to show; give meshes, or folders of meshes or of fits.")
    page = write_gallery(
        entries, output, lambda entry, path: write_page(entry, path, meshes.get(entry.sha256)), title
    )
    summarise(f"{page}: {summary(entries)}\n")
    return code


def digest_of(mesh: Path) -> str:
    """SHA-256 digest of an input, as a report has it."""
    with mesh.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_entries(folders: list[Path]) -> list[Entry]:
    """The fits in these folders by name; of one that is there twice, given in two ways, the first.

    Those whose assembly cannot be read are left out, and said.
    """
    from resfit.assembly.assembly import Assembly
    from resfit.eval.report.gallery import read_entry

    found = {folder.resolve(): read_entry(folder, fit_command) for folder in folders}
    entries = []
    for folder, entry in found.items():
        try:
            if entry is None:
                raise AssemblyError(f"{folder / REPORT} is no report of a fit, or damaged")
            if not Assembly.load(entry.folder / "assembly.json").primitives:
                raise AssemblyError(f"{entry.folder / 'assembly.json'} has no part")
            entries.append(entry)
        except AssemblyError as error:
            tell(f"resfit: left out: {error}")
    return sorted(entries, key=lambda entry: (entry.name.lower(), entry.folder))


def fit_all(meshes: list[Path], work: Path, preset: str, timeout: float) -> int:
    """Fit meshes, one process each; returns 3 if one failed, else 0. A fit's folder is filled at once or not at all."""
    from resfit.eval.report.results import fit_one

    failed = 0
    work = work / preset
    work.mkdir(parents=True, exist_ok=True)
    for number, mesh in enumerate(meshes, 1):
        row = fit_one(mesh, work, preset, timeout)
        failed += "error" in row
        told = row.get("error") or f"IoU {row['iou']:.3f}, {row['primitive_count']} parts"
        sys.stderr.write(f"resfit: {number}/{len(meshes)} {mesh.name}: {told}\n")
    return FAILED if failed else 0


def write_page(entry: Entry, path: Path, mesh: Path | None) -> None:
    """The page of a fit that has none, with the input where that is known."""
    from resfit.assembly.assembly import Assembly
    from resfit.cli.export import page_options
    from resfit.exports.by_suffix import export_assembly

    assembly = Assembly.load(entry.folder / "assembly.json")
    export_assembly(assembly, path, **page_options(assembly, entry.folder, mesh, None))


def fit_command(report: dict[str, Any]) -> str:
    """The command line that makes a fit again, from the options in its report.

    It is to be copied into a shell, and the report may be anybody's: empty unless the name is printable and each option
    is of its type.
    """
    from resfit.assembly.plain_json import text_at
    from resfit.fitter.config import PUBLIC, preset_config

    options, name, seed = report.get("options"), text_at(report, "input", "name"), report.get("seed") or 0
    if not isinstance(options, dict) or not name.isprintable() or not name or type(seed) is not int:
        return ""
    try:
        usual = asdict(preset_config(options.get("preset", "balanced")))
    except (InputError, TypeError):
        return ""
    changed = {key: value for key, value in options.items() if key in usual and value != usual[key]}
    objective = options.get("objective") or ""
    if not _is_word(objective) or not all(_is_like(value, usual[key]) for key, value in changed.items()):
        return ""
    words = ["resfit", "fit", f"./{name}" if name.startswith("-") else name]
    words += PUBLIC["preset"].words(options["preset"]) if "preset" in options else []
    for key, entry in PUBLIC.items():
        if key in changed and key != "preset":
            words += entry.words(changed.pop(key))
    words += PUBLIC["seed"].words(seed) if seed else []
    words += ["--init", "ASSEMBLY"] if options.get("init_sha256") else []
    words += ["--objective", objective] if objective else []
    # What only Python can set; not every shell skips comments, so nothing but plain words may stand there.
    rest = ", ".join(
        f"{key}={'...' if isinstance(value, dict | list) else value}"
        for key, value in changed.items()
        if key != "preset"
    )
    return shlex.join(word for word in words if word) + (f"  # and in Python: {rest}" if rest else "")


def _is_like(value: Any, usual: Any) -> bool:
    """Type check: True if an option's value is of the type of the usual one; a text must be a word."""
    if isinstance(usual, str):
        return _is_word(value)
    if isinstance(usual, bool):
        return isinstance(value, bool)
    if isinstance(usual, int | float):
        return isinstance(value, int if isinstance(usual, int) else int | float) and not isinstance(
            value, bool
        )
    return isinstance(value, dict | list)


def _is_word(value: Any) -> bool:
    return isinstance(value, str) and re.fullmatch(r"\w*", value, re.ASCII) is not None
