"""File commands of keys: saving, exporting, pictures, and whether a window may close."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...exports.by_suffix import check_path, export_assembly
from ..model.documents import Document
from ..model.edit_session import EditSession
from ..model.edit_state import State
from .scene import Scene


class FileActions:
    """Commands that write files; each returns what it wrote, one sentence."""

    def __init__(
        self, session: EditSession, scene: Scene, documents: Sequence[Document], exports: Sequence[Path]
    ) -> None:
        """Write what a session holds; the arguments are those of `Controller`."""
        self._session, self._scene = session, scene
        self._documents, self._exports = documents, exports
        self._warned: State | None = None

    def save(self, path: Path | None) -> str:
        """Save every assembly: the first at `path`, if given, the others beside the files that were opened."""
        self._session.commit()
        written = []
        for item, assembly in enumerate(self._session.state.assemblies):
            own = self._edited(item) if path is None or item else path
            assembly.save(own)
            written.append(str(own))
        self._session.mark_saved()
        return f"saved {', '.join(written)}"

    def export(self, item: int) -> str:
        """Export one assembly."""
        paths = self._exports or (Path(f"{self._documents[item].title}_edited.glb"),)
        for path in paths:
            check_path(path)
        for path in paths:
            export_assembly(self._session.state.assemblies[item], path)
        return f"exported {', '.join(map(str, paths))}"

    def screenshot(self, item: int) -> str:
        """Write a picture of the scene, called after one assembly."""
        from .screenshot import render_picture, write_picture

        scene, title = self._scene, self._documents[item].title
        width, height = scene.plotter.renderer.GetSize()
        image = render_picture(
            self._session, scene.comparisons, scene.view, scene.camera, (2 * width, 2 * height), framed=False
        )
        path = next(path for k in range(1, 10_000) if not (path := Path(f"{title}_{k:02d}.png")).exists())
        write_picture(image, path)
        return f"wrote {path}"

    def may_close(self) -> bool:
        """True if nothing is lost when the window closes, or this was asked before without a change since."""
        if self._session.changed and self._warned is not self._session.state:
            self._warned = self._session.state
            return False
        return True

    def _edited(self, item: int) -> Path:
        path = self._documents[item].path
        return path.with_name(f"{path.stem.removesuffix('_edited')}_edited.json")
