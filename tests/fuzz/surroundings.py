"""Surroundings: full disks, rights, limits, odd outputs and names, closed streams, locales, settings and options.

Each is a line of bash in which {fit} is a quick fit of {mesh}, and @ the current folder. Wrong: another exit code than
those given, a defect told on stderr, a result that the code does not go with, temporary files.
"""

from __future__ import annotations

import os
import random
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from fuzz.campaigns import shuffled
from fuzz.commands import FILES, RESFIT, check_code, check_whole, leftovers, mesh_in, run
from fuzz.harness import Campaign, Case, Skip, Wrong

SMALL = "--preset fast --max-primitives 2 --progress none"
WEAK = "setpriv --bounding-set=-dac_override,-dac_read_search --inh-caps=-dac_override,-dac_read_search"
"""Root without the right to pass over permissions."""

EMOJI = "\U0001f984"
UNICODE = "Stühlé日本"


@dataclass(frozen=True)
class Setting:
    """A line of bash and how it must end."""

    line: str
    codes: tuple[int, ...] = (0,)
    wrote: bool | None = None
    """Whether a result must be there; None: if the code is 0 or 4."""
    out: str = "out"
    environment: Mapping[str, str | None] = field(default_factory=dict)
    disk: str = ""
    """Size of a small file system at @/small."""


def limits() -> Iterator[tuple[str, Setting]]:
    """Disks, limits and rights."""
    for size in ("8k", "60k", "200k"):
        yield f"disk of {size}", Setting("{fit} -o @/small/out", (0, 2), out="small/out", disk=size)
    yield "disk full, in the mount", Setting("{fit} -o @/small", (2,), out="small", disk="60k")
    for kilobytes in (8, 50):
        yield f"file size limit {kilobytes} kB", Setting(f"ulimit -f {kilobytes}; {{fit}} -o @/out", (2,))
    for number in (12, 30):
        yield f"{number} descriptors", Setting(f"ulimit -n {number}; {{fit}} -o @/out", (0, 2))
    for megabytes in (600, 1500, 3000):
        yield f"{megabytes} MB of memory", Setting(f"ulimit -v {megabytes * 1000}; {{fit}} -o @/out", (0, 2))
    yield "one process", Setting("ulimit -u 1; {fit} -o @/out", (0, 2))
    read_only = "mkdir @/ro; chmod 555 @/ro; "
    weak = {
        "home and cache read-only": Setting(read_only + "HOME=@/ro {weak} {fit} -o @/out", (0, 2)),
        "cache read-only": Setting(read_only + "WARP_CACHE_PATH=@/ro/warp {weak} {fit} -o @/out", (0, 2)),
        "folder read-only": Setting("chmod 555 @; {weak} {fit} -o @/out", (2,)),
        "earlier result read-only": Setting(
            "{fit} -o @/out; chmod 555 @/out; {weak} {fit} -o @/out", (2,), True
        ),
        "folder not searchable": Setting("mkdir @/d; chmod 600 @/d; {weak} {fit} -o @/d/out", (2,)),
        "mesh unreadable": Setting("chmod 000 {mesh}; {weak} {fit} -o @/out", (2,)),
        "temporary folder read-only": Setting(read_only + "TMPDIR=@/ro {weak} {fit} -o @/out"),
    }
    yield from ((f"weak, {name}", setting) for name, setting in weak.items())


def outputs() -> Iterator[tuple[str, Setting]]:
    """What the output may be called and be."""
    no = {
        "a file": "touch @/out; {fit} -o @/out",
        "below a file": "touch @/f; {fit} -o @/f/out",
        "/dev/null": "{fit} -o /dev/null",
        "below /proc": "{fit} -o /proc/self/out",
        "a link to nothing": "ln -s nowhere @/out; {fit} -o @/out",
        "a folder of others": "mkdir @/out; echo x > @/out/mine.txt; {fit} -o @/out",
        "beside the mesh": "mkdir @/out; cp {mesh} @/out/assembly.stl; {resfit} fit @/out/assembly.stl -o @/out",
        "of 300 letters": "{fit} -o @/" + "x" * 300,
    }
    yield from ((f"output {name}", Setting(line, (2,), False)) for name, line in no.items())
    foreign = (
        "mkdir @/out; echo '{{}}' > @/out/report.json; {fit} -o @/out; c=$?; rm @/out/report.json; exit $c"
    )
    yield "output of a foreign report", Setting(foreign, (2,), False)
    yield "output a link to a folder", Setting("mkdir @/d; ln -s d @/out; {fit} -o @/out")
    for name in ("a/b/c/out", "x" * 255, EMOJI * 62, "a\nb", os.fsdecode(b"\xff\xfe"), " ", "D:\\out", "-o"):
        yield f"output {name[:12]!a}", Setting("{fit} -o @/'" + name + "'", out=name)
    gone = "mkdir @/gone; cd @/gone; rmdir @/gone; "
    yield "current folder gone", Setting(gone + "{fit} -o @/out", (0, 2))
    yield "current folder gone, no output", Setting(gone + "{fit}", (2,), False)
    for number in ("$BASHPID", "999999"):
        left = (
            f"mkdir @/.out.resfit-{number}.tmp; touch -d '2 days ago' @/.out.resfit-*; exec {{fit}} -o @/out"
        )
        yield f"leftovers of {number}", Setting(left)


def meshes() -> Iterator[tuple[str, Setting]]:
    """What the mesh may be called."""
    markup = "<img src=x onerror=alert(1)>"
    for name in (os.fsdecode(b"\xff\xfe"), markup, "--help", "C:\\temp\\x", "a\nb", " ", EMOJI, "%s{0}"):
        copied = f"cp {{mesh}} @/'{name.replace('{', '{{').replace('}', '}}')}.stl'; cd @; "
        command = f"{{resfit}} fit ./'{name.replace('{', '{{').replace('}', '}}')}.stl' {SMALL}"
        yield f"mesh {name[:12]!a}", Setting(copied + command + " -o @/out")
        yield f"mesh {name[:12]!a}, no output", Setting(copied + command, out=f"{name}.resfit")
    page = f"cp {{mesh}} @/'{markup}.stl'; {{resfit}} fit @/'{markup}.stl' {SMALL} -o @/out"
    yield (
        "markup in no page",
        Setting(page + "; c=$?; ! grep -q '<img src=x' @/out/viewer.html && exit $c; exit 77"),
    )


def streams() -> Iterator[tuple[str, Setting]]:
    """Streams that are closed, full, read by nobody, or cannot hold the letters; environments."""
    for name in (
        "<&-",
        ">&-",
        "2>&-",
        "<&- >&- 2>&-",
        ">/dev/full",
        "--progress json 2>/dev/full",
        ">/dev/full 2>&1",
    ):
        yield f"streams {name}", Setting("{fit} -o @/out " + name)
    yield "stdout read by nobody", Setting("{fit} -o @/out | head -c0; exit ${{PIPESTATUS[0]}}")
    nobody = "{{ {fit} -o @/out --progress json; echo $? > @/code; }} 2> >(head -c0); sleep 0.3; exit $(cat @/code)"
    yield "progress read by nobody", Setting(nobody)
    for where in ("2> >(head -c0)", "2>/dev/full", "2>&-"):
        yield f"complaint {where}", Setting("{resfit} fit @/no.stl " + where, (2,), False)
    environments: dict[str, dict[str, str | None]] = {
        "no home": {"HOME": None},
        "home /dev/null": {"HOME": "/dev/null"},
        "cache below a file": {"WARP_CACHE_PATH": "/dev/null/x"},
        "no temporary folder": {"TMPDIR": "/nonexistent"},
        "locale C": {"LC_ALL": "C"},
        "ASCII streams": {"LC_ALL": "C", "PYTHONIOENCODING": "ascii"},
        "no UTF-8 mode": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        "Latin-1 streams": {"PYTHONIOENCODING": "latin-1"},
        "locale tr_TR": {"LC_ALL": "tr_TR.UTF-8"},
        "dumb terminal": {"TERM": "dumb"},
        "optimised": {"PYTHONOPTIMIZE": "2"},
        "warnings are errors": {"PYTHONWARNINGS": "error"},
        **{
            f"RESFIT_THREADS={n}": {"RESFIT_THREADS": n}
            for n in ("0", "-1", "abc", "²", "999999999999", "1000")
        },
    }
    line = f"cp {{mesh}} @/{UNICODE}.stl; {{resfit}} fit @/{UNICODE}.stl {SMALL} -o @/{UNICODE}"
    for name, environment in environments.items():
        refusable = (0, 2) if name.startswith(("home", "cache", "RESFIT")) else (0,)
        yield f"environment {name}", Setting(line, refusable, out=UNICODE, environment=environment)


def options() -> Iterator[tuple[str, Setting]]:
    """Values out of range."""
    for option in (
        "--seed 99999999999999999999999999", "--seed 4294967296", "--seed -1", "--timeout nan", "--timeout inf",
        "--tolerance nan", "--tolerance 1e300", "--tolerance 1e-300", "--target-iou nan", "--target-iou 1e-300",
        "--max-primitives 99999999999999999999", "--rounds 0", "--parsimony nan", "--parsimony 0", "--device cuda:99",
        "--device ''", "--preset x", "--primitive x", "--init /dev/null", "--init @", "--init {mesh}",
    ):  # fmt: skip
        yield f"option {option}", Setting("{fit} -o @/out " + option, (0, 2))
    yield "option --timeout 1e-9", Setting("{fit} -o @/out --timeout 1e-9", (0, 4))


SETTINGS = {
    name: setting for source in (limits, outputs, meshes, streams, options) for name, setting in source()
}


def cases(rng: random.Random) -> Iterator[Case]:
    """All of them once."""
    return shuffled(rng, [Case(name) for name in SETTINGS])


def attempt(case: Case, folder: Path) -> str:
    """Run the line, and look at what is there."""
    setting = SETTINGS[case.name]
    if case.name.startswith("weak") and not can_be_weak():
        raise Skip("no setpriv, by which root gives up its rights")
    mesh = mesh_in(folder)
    fit = f"{RESFIT} fit {mesh} {SMALL}"
    line = setting.line.format(fit=fit, mesh=mesh, resfit=RESFIT, weak="" if os.geteuid() else WEAK).replace(
        "@", str(folder)
    )
    with small_disk(folder / "small", setting.disk):
        done = run(line, folder, setting.environment)
        out = folder / setting.out
        folder.chmod(0o777)
        check_code(done, setting.codes)
        expected = done.code in (0, 4) if setting.wrote is None else setting.wrote
        if expected:
            check_whole(out)
        elif out.is_dir() and FILES & set(os.listdir(out)) - {"report.json"}:
            raise Wrong(f"exit code {done.code}, but it wrote {sorted(os.listdir(out))}")
        if leftovers(folder):
            raise Wrong(f"it left {leftovers(folder)}")
    return f"exit code {done.code}: {done.tail}"


@contextmanager
def small_disk(place: Path, size: str) -> Iterator[None]:
    """A file system of so many bytes, if any are given."""
    if not size:
        yield
        return
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(place)]
    if os.geteuid() or subprocess.run(mount, capture_output=True).returncode:
        raise Skip("no root or no tmpfs for small disks")
    try:
        yield
    finally:
        subprocess.run(["umount", str(place)], capture_output=True)


@cache
def can_be_weak() -> bool:
    """Whether root can give up its rights here."""
    return (
        not os.geteuid()
        and not subprocess.run(["bash", "-c", f"{WEAK} true"], capture_output=True).returncode
    )


# A thread takes 8 MB of address space: where a setting starts them without end, it fails soon.
CAMPAIGN = Campaign("surroundings", cases, attempt, hang_s=150.0, address_space=8 << 30)
