"""`resfit completion`: what makes a shell complete commands and options."""

from __future__ import annotations

import sys
from typing import Literal


def completion(shell: Literal["bash", "zsh", "fish"], /) -> int:
    """Print a script that makes a shell complete commands and options.

    For bash, put the line "source <(resfit completion bash)" into ~/.bashrc. For zsh, write it to the file _resfit in a
    folder of $fpath; for fish, to ~/.config/fish/completions/resfit.fish.

    Args:
        shell: that is to read it.
    """
    from resfit.cli import build_app

    sys.stdout.write(build_app(everything=True).generate_completion(shell=shell) + "\n")
    return 0
