"""Joins a controller and a page: what the page sends is done in turn, and what changed is sent back.

Everything happens in one thread, in rounds: all that has arrived is done, of many values of one slider only the last;
then numbers and one picture go out, and the next round waits until they have left.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable
from typing import Any

from resfit.errors import InputError, ResfitError

from ..model.edit_state import PartRef
from ..scene.controller import Controller
from .picture import Picture
from .pointer import LOOK, Pointer
from .state import is_offered, page_state, save_folder, save_name, save_path
from .steps import Steps

AREA = "resfit_picture"
"""Name of the picture on the page."""

GATHER = 0.008
"""Seconds in which more events may arrive before a round begins."""

STILL = 0.4
"""Seconds of rest after which the picture is drawn finely."""

STEP, SIZE = "step", "size"
"""Slots of what goes through the history of the fit, and of the picture's size."""

Action = Callable[[], Any]


class App:
    """A page's other half.

    Attributes:
        controller: does what the page asks for.
        picture, pointer: the scene as pictures, and what happens on them.
        area_name: the picture's name on the page, for trame.
    """

    area_name = AREA

    def __init__(self, controller: Controller, server: Any) -> None:
        """Join a controller and a trame server that does not run yet."""
        self.controller = controller
        self.server = server
        self.picture = Picture(controller.scene)
        self.pointer = Pointer(controller, self.picture, self.post)
        self.steps = Steps(controller)
        self._streamer: Any = None
        self._waiting: list[tuple[str, Action]] = []
        self._wake = asyncio.Event()
        self._dragged = ""
        self._renamed: list[tuple[PartRef, PartRef]] = []
        self._still = False
        self._changed = True
        self._revision = 0
        self._answered = 0
        controller.on_change = self._note_change
        server.state.update(
            {
                "save_name": save_name(controller),
                "save_dialog": False,
                "resting": False,
                "typing": {},
                "asked": 0,
            }
        )
        # These stay on the page: the field that is being filled in and its editor, and which selection it waits for.
        server.state.client_only("typing", "asked")
        self._tell()
        for name in ("run", "select", "hide", "only", "slide", "type", "rename", "add", "save", "step"):
            server.controller.trigger(name)(getattr(self, f"on_{name}"))
        server.controller.trigger("text")(self.text)

    # Rounds

    def post(self, action: Action, slot: str = "") -> None:
        """Do something in the next round; of many with the same `slot` one after the other, only the last.

        Whatever has another slot than LOOK, STEP or SIZE ends a look at the fit's history; and the drag of a slider, if
        it is not that slider's.
        """
        if slot and self._waiting and self._waiting[-1][0] == slot:
            self._waiting.pop()
        self._waiting.append((slot, action))
        self.server.state.resting = False
        self._wake.set()

    async def run(self) -> None:
        """Do rounds until cancelled."""
        while True:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._wake.wait(), None if self._still else STILL)
            if self._wake.is_set():
                await asyncio.sleep(GATHER)
                self.round()
            else:
                self.send(still=True)
            await self.server.network_completion

    def round(self) -> None:
        """Do what waits, and send what came of it."""
        self._act()
        if not self._waiting:
            self._wake.clear()
        if self._changed:
            self._tell()
        self.send(still=False)

    def _act(self) -> None:
        waiting, self._waiting = self._waiting, []
        for slot, action in waiting:
            self._changed |= slot not in (LOOK, SIZE)
            try:
                if slot not in (LOOK, STEP, SIZE):
                    self.steps.leave()
                if slot not in (LOOK, SIZE, self._dragged):
                    self._settle()
                action()
            except ResfitError as error:
                self.controller.message = str(error)
            except Exception as error:
                # Edits that are not saved yet outlive a defect of ours.
                logging.getLogger(__name__).exception("a defect of resfit")
                self.controller.message = (
                    f"this is a defect of resfit ({type(error).__name__}); save your edits."
                )

    def send(self, still: bool) -> None:
        """Draw and send a picture; the page is told whether it is the finished one."""
        self._still = still
        if self._streamer is None:
            return
        frame = self.picture.draw(still)
        about = {
            "type": "image/jpeg", "codec": "", "w": frame.width, "h": frame.height, "key": "key",
            "st": int(1000 * time.time()), "quality": frame.quality,
        }  # fmt: skip
        self._streamer.push_content(AREA, about, frame.content)
        if still:
            with self.server.state as state:
                state.resting = True

    def _tell(self) -> None:
        """Send what is shown beside the picture, as far as it changed."""
        self._changed = False
        with self.server.state as state:
            self._revision += 1
            state.update(page_state(self.controller, self._revision, bool(self._dragged)))
            state.update(self.steps.state())
            state.update({"answered": self._answered})

    def _note_change(self) -> None:
        """The next round has something to tell, whoever changed it."""
        self._changed = True
        self._wake.set()

    # What trame's picture asks for

    def set_streamer(self, streamer: Any) -> None:
        """Take on, or give up, what sends pictures."""
        self._streamer = streamer

    def update_size(self, _: str, size: dict[str, Any]) -> None:
        """The picture on the page has a new size; it also says so when a page is opened."""
        try:
            width, height, ratio = (float(size.get(key, 1)) for key in "whp")
        except (TypeError, ValueError):
            return
        if width > 1 and height > 1:
            self.post(lambda: self._resize(width, height, ratio), SIZE)

    def on_interaction(self, _: str, event: dict[str, Any]) -> None:
        """Something happened on the picture."""
        self.pointer.handle(event)

    def reset(self) -> None:
        """The picture is wanted again."""
        self.post(lambda: None, LOOK)

    def _resize(self, width: float, height: float, ratio: float) -> None:
        if self.picture.resize(width, height, ratio):
            self.controller.scene.frame()

    # What the page asks for

    def on_run(self, name: str) -> None:
        """A command's button was pressed."""
        if is_offered(name):
            self.post(lambda: self.controller.run(name))

    def on_select(self, item: int, name: str) -> None:
        """A part was chosen from the list; the chosen one again is let go."""

        def select() -> None:
            self._answered += 1
            ref = self._ref([item, name])
            self.controller.select(None if ref == self.controller.session.selected else ref)

        self.post(select)

    def on_hide(self, item: int, name: str) -> None:
        """A part is to be hidden, or shown again."""
        self._edit(lambda: self.controller.session.hide(self._ref([item, name])))

    def on_only(self, item: int, name: str) -> None:
        """A part is to be shown alone, or with all others again."""
        self._edit(lambda: self.controller.session.isolate(self._ref([item, name])))

    def on_slide(self, part: Any, slider_id: str, value: float, done: bool) -> None:
        """A slider is being dragged, or was let go: of a part, `[item, name]`, or of the view."""
        slot = f"slide {part} {slider_id}"

        def slide() -> None:
            self._dragged = slot
            self._put(part, slider_id, value)

        self.post(slide, slot)
        if done:
            self.post(self._settle)

    def on_type(self, part: Any, slider_id: str, text: str) -> None:
        """A number was typed, as for `on_slide`."""

        def put() -> None:
            self._put(part, slider_id, str(text).replace(",", "."))
            self.controller.settle()

        self.post(put)

    def on_rename(self, part: Any, text: str) -> None:
        """A part was given another name."""

        def rename() -> None:
            ref = self._ref(part)
            self._renamed.append((ref, self.controller.session.rename(ref, str(text))))

        self._edit(rename)

    def on_step(self, at: int | None) -> None:
        """A step of the fit's history is to be shown, or what is edited again."""
        self.post(self.steps.leave if at is None else lambda: self.steps.go(int(at)), STEP)

    def on_add(self, family: str) -> None:
        """A primitive is to be added."""
        self.post(lambda: self.controller.add(str(family)))

    def on_save(self, name: str) -> None:
        """The assemblies are to be saved; the first under this name."""

        def save() -> None:
            self.controller.save_path = save_path(save_folder(self.controller), str(name))
            self.controller.run("save")
            self.server.state.save_name = self.controller.save_path.name

        self.post(save)

    def text(self) -> str:
        """The edited assembly as the text of an assembly.json, for the page to download."""
        self.reset()
        self._act()
        return self.controller.session.state.assemblies[self.controller.item].to_json().decode()

    def _ref(self, part: Any) -> PartRef:
        """The part of a message, `[item, name]`, whatever was sent; it may have got another name since then.

        Raises:
            InputError: if there is no such part.
        """
        refs, found = self.controller.session.refs(), tuple(part) if isinstance(part, list) else ()
        for old, new in self._renamed:
            if found == old and found not in refs:
                found = new
        for ref in refs:
            if ref == found:
                return ref
        raise InputError("there is no such part any more.")

    def _put(self, part: Any, slider_id: str, value: Any) -> None:
        """Set a number of the part of a message, or of the view.

        Raises:
            InputError: if there is no such part, or the value is no number.
        """
        ref = None if str(slider_id).startswith("view.") else self._ref(part)
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise InputError("that is no number.") from None
        self.controller.slide(str(slider_id), number, ref)

    def _settle(self) -> None:
        """End the drag of a slider, if there is one."""
        if self._dragged:
            self._dragged = ""
            self.controller.settle()

    def _edit(self, action: Action) -> None:
        def edit() -> None:
            action()
            self.controller.changed()

        self.post(edit)
