"""The history of a fit on the page: one step at a time in place of what is edited, which stays as it is meanwhile."""

from __future__ import annotations

from typing import Any

from ..model.edit_session import EditSession
from ..playback.playback import Frame, load_playback
from ..scene.controller import Controller


class Steps:
    """Goes through the steps of the fit that a controller's assembly came from.

    Attributes:
        at: the step that is shown, or None.
    """

    def __init__(self, controller: Controller) -> None:
        """Show steps in a controller's scene; nothing is read yet."""
        self.controller = controller
        self.at: int | None = None
        self._frames: tuple[Frame, ...] = ()

    @property
    def there(self) -> bool:
        """True if there is a history, and only one."""
        documents = self.controller.documents
        return len(documents) == 1 and (documents[0].path.parent / "history.npz").is_file()

    def go(self, at: int) -> None:
        """Show a step; those before the first and after the last are these.

        Raises:
            InputError: if the history cannot be read.
        """
        if not self._frames:
            document = self.controller.documents[0]
            self._frames = load_playback(document.path.parent, document.assembly)
        self.at = max(0, min(at, len(self._frames) - 1))
        frame = self._frames[self.at]
        self.controller.scene.session = EditSession([frame.assembly])
        self.controller.scene.sync()
        self.controller.message = f"{frame.title} · {frame.detail}"

    def leave(self) -> None:
        """Show what is edited again."""
        if self.at is not None:
            self.at = None
            self.controller.scene.session = self.controller.session
            self.controller.message = ""
            self.controller.changed()

    def state(self) -> dict[str, Any]:
        """For the page."""
        return {"step": self.at, "last_step": len(self._frames) - 1, "has_steps": self.there}
