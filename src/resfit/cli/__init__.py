"""The command line: one file a command.

Exit codes: 0 the result is there; 1 a defect of ours (one sentence, and where the log is); 2 usage or unreadable input
(one sentence, nothing written); 3 some of several inputs failed; 4 stopped early, the best so far written if there
was one. Modules of commands import nothing heavy, so that `--help` is quick.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, NoReturn

from resfit.cli.failures import STOPPED, UNUSABLE, answered, complain
from resfit.cli.terminal import flush, guard_streams, loss
from resfit.errors import InputError
from resfit.loading import own_process, without_collector

if TYPE_CHECKING:
    from cyclopts import App

HELP_ALL = "--help-all"
"""Like --help, with the options that few people need."""


def build_app(everything: bool = False) -> App:
    """The application with all its commands.

    Args:
        everything: whether help shows the options that few people need.
    """
    from cyclopts import App

    import resfit
    from resfit.cli.bench import bench
    from resfit.cli.compare import compare
    from resfit.cli.completion import completion
    from resfit.cli.demo import demo
    from resfit.cli.doctor import doctor
    from resfit.cli.eval import evaluate
    from resfit.cli.export import export
    from resfit.cli.fit import fit
    from resfit.cli.fit_options import MORE
    from resfit.cli.gallery import gallery
    from resfit.cli.help import show_help
    from resfit.cli.view import view

    app = App(
        name="resfit",
        help="Turn any 3D mesh into a compact, editable assembly of analytic primitives.",
        version=lambda: resfit.__version__,
        version_flags=("--version", "-V"),
        suppress_keyboard_interrupt=False,
    )
    # Groups are frozen, and whether one is shown cannot be told to the application.
    object.__setattr__(MORE, "_show", everything)
    app.command(fit)
    app.command(evaluate, name="eval")
    app.command(compare)
    app.command(view)
    app.command(export)
    app.command(bench)
    app.command(doctor)
    app.command(demo)
    app.command(gallery)
    app.command(completion)
    app.command(show_help, name="help")
    return app


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Args:
        arguments: without the program's name; None takes those of the process.
    """
    try:
        return answered(lambda: _checked(sys.argv[1:] if arguments is None else list(arguments)))
    except KeyboardInterrupt:
        return complain("stopped.", STOPPED)


def command() -> NoReturn:
    """The program: `main`, and out."""
    own_process()
    guard_streams()
    leave(main())


def leave(code: int) -> NoReturn:
    """End the process without taking it down piece by piece.

    Warp would unload its kernels one module after the other, for which people would wait: memory goes with the process
    anyway.
    """
    flush()
    os._exit(code)


def _checked(arguments: list[str]) -> int:
    """The exit code; a result that was to be printed and was lost is an error."""
    code = _run(arguments)
    lost = loss() if code == 0 else ""
    return complain(lost, UNUSABLE) if lost else code


def _run(arguments: list[str]) -> int:
    with without_collector():
        from cyclopts import CycloptsError

    everything = HELP_ALL in arguments
    arguments = ["--help" if argument == HELP_ALL else argument for argument in arguments]
    try:
        with without_collector():
            app = build_app(everything)
        code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        command = " ".join(["resfit", *(error.command_chain or ())])
        raise InputError(f"{error} See {command} --help.") from error
    return code if isinstance(code, int) else 0
