"""The page inside a notebook: Jupyter, JupyterLab, VS Code, whatever shows HTML below a cell."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from ...assembly.assembly import Assembly

if TYPE_CHECKING:
    from ..scene.controller import Controller
    from .serve import PageServer


class Shown:
    """A page below a cell; notebooks draw it by themselves.

    Attributes:
        controller: of the scene, to select or change things from the notebook.
    """

    def __init__(self, server: PageServer, height: int) -> None:
        """Show a server's page, `height` pixels high."""
        self.controller: Controller = server.app.controller
        self._server = server
        self._height = height

    @property
    def assembly(self) -> Assembly:
        """As it was edited up to now."""
        return self.controller.session.state.assemblies[0]

    @property
    def address(self) -> str:
        """The page's own, to open it in a tab; the token is in it."""
        return self._server.address

    async def close(self) -> None:
        """End the page: `await shown.close()`."""
        await self._server.stop()
        self.controller.scene.plotter.close()

    def _repr_html_(self) -> str:
        # By the name that the notebook itself has, or browsers would keep the page's cookie from it.
        place = json.dumps(f":{self._server.port}/?token={self._server.gate.token}")
        return (
            f'<iframe style="width: 100%; height: {self._height}px; border: 0; border-radius: 8px" '
            f"onload=\"if (!this.src) this.src = 'http://' + location.hostname + {place.replace(chr(34), chr(39))}\">"
            "</iframe>"
        )


async def show(
    assembly: Assembly | str | Path, target: str | Path | None = None, height: int = 640, device: str = "auto"
) -> Shown:
    """Show and edit an assembly in a notebook: `shown = await resfit.viewer.web.show(assembly)`.

    The page is served by the notebook's own process, to this machine only, and lives until `close`; it answers while no
    cell runs. What was edited is `shown.assembly`.

    Args:
        assembly: what to show: an assembly, its file, or the folder of a fit.
        target: the mesh to compare with.
        height: of the page, pixels.
        device: `auto`, `cpu`, `cuda:0`.

    Raises:
        InputError: if something cannot be read, or the extra `web` is missing.
        DisplayError: if nothing can be drawn here.
    """
    from .extra import require_web

    require_web()
    from ..model.comparison import Comparison
    from ..model.documents import Document, open_documents
    from ..model.edit_session import EditSession
    from ..scene.controller import Controller
    from ..scene.opengl_check import probe_rendering, require
    from ..scene.plotter import make_plotter
    from ..scene.scene import Scene
    from .serve import PageServer

    mesh = None if target is None else Path(target)
    if isinstance(assembly, Assembly):
        document = Document(assembly, Path("assembly.json"), "assembly", mesh)
    else:
        document = open_documents([Path(assembly)], mesh)[0]
    require(probe_rendering())
    comparison = None if document.mesh is None else Comparison(document.mesh, device)
    session = EditSession([document.assembly])
    scene = Scene(make_plotter((960, height), off_screen=True), session, [comparison], device=device)
    server = PageServer(Controller(scene, [document]))
    await server.start()
    return Shown(server, height)
