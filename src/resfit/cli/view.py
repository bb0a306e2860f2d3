"""`resfit view`: see and edit assemblies in a window or a browser, or take a picture of them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from resfit.cli.inputs import assembly_file
from resfit.errors import InputError

LOCALHOST = "127.0.0.1"


def view(
    *assemblies: Path,
    target: Path | None = None,
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    export: Annotated[tuple[Path, ...], Parameter(negative="")] = (),
    screenshot: Path | None = None,
    size: str | None = None,
    show: str = "",
    explode: float = 0.0,
    up: Literal["y", "z"] = "y",
    azimuth: float = 35.0,
    elevation: float = 22.0,
    device: str = "auto",
    web: Annotated[bool, Parameter(negative="")] = False,
    host: str = LOCALHOST,
    port: int = 0,
    play: Annotated[bool, Parameter(negative="")] = False,
    video: Path | None = None,
    motion: Literal["optimisation", "explode", "turntable"] | None = None,
    seconds: float | None = None,
    fps: float = 20.0,
) -> int:
    """See and edit assemblies in a window: click a part, drag its sliders or handles; ? lists all keys.

    Args:
        assemblies: assembly.json files, or folders of fits; several make one scene.
        target: the mesh to compare with; unless given, the one of the fit's report, if it lies near.
        output: where the edited assembly is saved; beside the one that was opened, with _edited in its name, unless
            given.
        export: file that Shift E writes, in the format of its suffix; may be given several times.
        screenshot: write this picture and exit; needs no screen.
        size: of the window, the picture or the film, such as 1280x800.
        show: what to show at first, separated by commas: parts (without smooth joins), plain (without lines),
            wireframe, labels, slice, error, residual, samples; the input mesh as ghost, outline or beside; x, y or z
            to cut across.
        explode: how far parts are moved apart, 0 to 4.
        up: which axis points up.
        azimuth: degrees around the model, 0 from the front.
        elevation: degrees above the horizon.
        device: auto (the CPU), cpu or cuda:0.
        web: serve the viewer as a page, over SSH too, and print its address; Ctrl-C ends it.
        host: where the page can be reached; only from this machine unless told otherwise.
        port: of the page; a free one unless given.
        play: step through the history of a fit: Left and Right, Home and End, Space plays.
        video: write this film, .mp4 or .gif, and exit; needs no screen.
        motion: of the film: how the fit came about (unless given, where its history is known), parts apart and back,
            or once around (turntable).
        seconds: that the film takes; 10, 5 or 6 by its motion unless given.
        fps: pictures of the film a second.
    """
    ways = {
        "--web": web,
        "--play": play,
        "--screenshot": screenshot is not None,
        "--video": video is not None,
    }
    asked = [name for name, given in ways.items() if given]
    if len(asked) > 1:
        raise InputError(f"{' and '.join(asked)} do not go together; give one of them.")
    if not web and (host, port) != (LOCALHOST, 0):
        raise InputError("--host and --port are of the page; they need --web.")
    paths = [assembly_file(path) for path in assemblies]
    from resfit.viewer.open_view import open_page, open_window, save_screenshot
    from resfit.viewer.scene.request import Request

    request = Request(
        paths=paths,
        target=target,
        save_path=output,
        exports=export,
        show=[name.strip() for name in show.split(",") if name.strip()],
        explode=explode,
        up=up,
        azimuth=azimuth,
        elevation=elevation,
        size=None if size is None else read_size(size),
        device=device,
    )
    if video is not None:
        from resfit.cli.filming import make_film

        make_film(request, video, motion, seconds, fps)
    elif screenshot is not None:
        save_screenshot(request, screenshot)
    elif play:
        from resfit.viewer.playback.player import open_player

        open_player(request)
    elif web:
        open_page(request, host, port)
    else:
        open_window(request)
    return 0


def read_size(text: str) -> tuple[int, int]:
    """Width and height of text such as 1280x800.

    Raises:
        InputError: if it is not that.
    """
    found = re.fullmatch(r"(\d{1,5})[x×*,](\d{1,5})", text.strip().lower())
    if found is None:
        raise InputError(f"--size {text} is no size; give width and height such as 1280x800.")
    return int(found[1]), int(found[2])
