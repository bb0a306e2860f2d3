"""Part commands of keys: choosing one, hiding, adding, copying and taking away, and drags of its handles."""

from __future__ import annotations

import numpy as np

from resfit.errors import InputError

from ...assembly.primitive import Primitive, shown
from ...kernels.primitives import DEFAULT_FAMILY
from ..model.edit_session import EditSession
from ..model.edit_state import PartRef
from ..model.poses import to_vector
from .scene import Scene


class PartActions:
    """Commands on the parts of a session. Those that have something to say return it, one sentence."""

    def __init__(self, session: EditSession, scene: Scene) -> None:
        """Act on a session, and place new parts where the scene's camera looks."""
        self._session, self._scene = session, scene

    @property
    def item(self) -> int:
        """The assembly that is edited: that of the selected part, else the first."""
        return self._session.selected.item if self._session.selected else 0

    def chosen(self) -> PartRef:
        """The selected part.

        Raises:
            InputError: if none is selected.
        """
        if self._session.selected is None:
            raise InputError("no part is selected; click one first.")
        return self._session.selected

    def next(self) -> None:
        self._go(1)

    def previous(self) -> None:
        self._go(-1)

    def hide(self) -> None:
        self._session.hide(self.chosen())

    def isolate(self) -> None:
        self._session.isolate(self.chosen())

    def show_all(self) -> None:
        self._session.show_all()

    def undo(self) -> str:
        return "undone" if self._session.undo() else "nothing to undo"

    def redo(self) -> str:
        return "redone" if self._session.redo() else "nothing to redo"

    def duplicate(self) -> str:
        return f"{shown(self._session.duplicate(self.chosen()).name)} is the copy"

    def delete(self) -> None:
        self._session.delete(self.chosen())

    def add(self) -> str:
        """Add a primitive like the selected one."""
        selected = self._session.selected
        return self.add_family(self._session.part(selected).family if selected else DEFAULT_FAMILY)

    def add_family(self, family: str) -> str:
        """Add a primitive where the camera looks, and select it."""
        matrix = self._scene.arrangement.placed[self.item].matrix
        place = (self._scene.camera.target - matrix[:3, 3]) / matrix[0, 0]
        self._session.add(self.item, family, to_vector(np.clip(place, -1.0, 1.0)))
        return f"added a {family}"

    def place(self, matrix: np.ndarray, held: Primitive | None) -> None:
        """Place the selected part by its handles.

        Args:
            matrix: (4, 4), takes the local frame of `held` to the scene's.
            held: the part as it was when a handle was taken hold of; as it is now if None.
        """
        ref = self.chosen()
        placed = self._scene.arrangement.placed[ref.item].matrix
        self._session.editor.place(ref, np.linalg.solve(placed, matrix), held)

    def _go(self, step: int) -> None:
        refs = self._session.refs()
        if refs:
            at = refs.index(self._session.selected) if self._session.selected else (-1 if step > 0 else 0)
            self._session.select(refs[(at + step) % len(refs)])
