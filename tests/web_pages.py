"""What tests of the served page share: a server in a process of its own, and requests without a browser."""

from __future__ import annotations

import http.client
import io
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import numpy as np
from PIL import Image
from viewer_scenes import primitive

from resfit.assembly.assembly import Assembly
from resfit.viewer.model.parameters import with_value

if TYPE_CHECKING:
    from playwright.sync_api import Page

COLORS = {"left": "#d0302a", "middle": "#2f9e44", "right": "#2b50c8"}

PICTURE = ".picture img"


def three() -> Assembly:
    """Three parts beside each other, in colours that cannot be mistaken."""
    parts = []
    for name, x in (("left", -0.6), ("middle", 0.0), ("right", 0.6)):
        part = with_value(primitive("cuboid", name, (x, 0.0, 0.0)), "size.0", 0.32)
        parts.append(part.__class__(part.family, name, part.pose, part.parameters, 0.0, COLORS[name]))
    return Assembly(tuple(parts))


@dataclass(frozen=True)
class Served:
    """A server and the folder of what it shows."""

    address: str
    process: subprocess.Popen[str]

    @property
    def port(self) -> int:
        """Where it listens."""
        return urlsplit(self.address).port or 0

    @property
    def token(self) -> str:
        """The one in the address."""
        return urlsplit(self.address).query.removeprefix("token=")

    def ask(
        self, target: str, headers: dict[str, str] | None = None, method: str = "GET"
    ) -> tuple[int, bytes, dict]:
        """Status, content and headers of the answer to a request, sent exactly as it is."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        try:
            connection.putrequest(method, target, skip_accept_encoding=True)
            for name, value in (headers or {}).items():
                connection.putheader(name, value)
            connection.endheaders()
            answer = connection.getresponse()
            return answer.status, answer.read(), dict(answer.getheaders())
        finally:
            connection.close()

    def upgrade(self, headers: dict[str, str], target: str = "/ws") -> int:
        """Status of the answer to who wants a web socket: 101 if it is opened."""
        wanted = {
            "Host": f"127.0.0.1:{self.port}", "Upgrade": "websocket", "Connection": "Upgrade",
            "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", **headers,
        }  # fmt: skip
        lines = [f"GET {target} HTTP/1.1", *(f"{name}: {value}" for name, value in wanted.items()), "", ""]
        with socket.create_connection(("127.0.0.1", self.port), timeout=30) as connection:
            connection.sendall("\r\n".join(lines).encode())
            return int(connection.recv(4096).split(b" ")[1])


@contextmanager
def served(path: Path, *options: str) -> Iterator[Served]:
    """Serve an assembly; at the end an interrupt must end it quietly."""
    command = [sys.executable, "-m", "resfit", "view", str(path), "--web", "--size", "640x480", *options]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=path.parent
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        if not line:
            raise AssertionError(process.communicate(timeout=60)[1])
        assert re.fullmatch(r"http://[\w.\-]+:\d+/\?token=[\w\-]{20,}\n", line), line
        yield Served(line.strip(), process)
    finally:
        process.send_signal(signal.SIGINT)
        try:
            output, complaints = process.communicate(timeout=60)
        finally:
            process.kill()
    assert (process.returncode, output) == (0, "")
    assert "Traceback" not in complaints and "defect" not in complaints, complaints


@contextmanager
def paused(server: Served) -> Iterator[None]:
    """A server that answers nothing meanwhile: what is sent to it waits."""
    server.process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        server.process.send_signal(signal.SIGCONT)


@contextmanager
def slowed(server: Served) -> Iterator[None]:
    """A server that works for less than a third of the time."""
    ended = threading.Event()

    def pauses() -> None:
        while not ended.wait(0.08):
            with paused(server):
                ended.wait(0.2)

    pausing = threading.Thread(target=pauses)
    pausing.start()
    try:
        yield
    finally:
        ended.set()
        pausing.join()


def rest(page: Page) -> None:
    """Wait until everything that was done so far is done, and drawn finely."""
    page.wait_for_timeout(150)
    # Messages keep their order: once this one is answered, all before it were acted upon.
    page.evaluate("window.trame.trigger('text')")
    page.wait_for_selector('.stage[data-resting="true"]', timeout=60_000)
    page.wait_for_timeout(100)


def picture(page: Page) -> np.ndarray:
    """The picture that the page shows, (height, width, 3), once it rests."""
    rest(page)
    return np.asarray(Image.open(io.BytesIO(page.locator(PICTURE).screenshot())).convert("RGB")).astype(int)


def middle_of(image: np.ndarray, name: str) -> tuple[float, float]:
    """Where a part of `three` is in a picture: x and y from its upper left corner."""
    wanted = np.array([int(COLORS[name][k : k + 2], 16) for k in (1, 3, 5)], float)
    cosine = image @ wanted / np.maximum(np.linalg.norm(image, axis=2) * np.linalg.norm(wanted), 1e-9)
    rows, columns = np.nonzero(cosine > 0.985)
    assert len(rows) > 200, f"{name} is not to be seen"
    return float(np.median(columns)), float(np.median(rows))


def click_part(page: Page, name: str) -> None:
    """Click a part of `three` in the picture."""
    x, y = middle_of(picture(page), name)
    page.locator(PICTURE).click(position={"x": x, "y": y})


def selected(page: Page) -> list[str]:
    """Names of the parts that the list shows as selected."""
    return page.locator(".parts li.selected .text").all_inner_texts()


def move_slider(page: Page, slider_id: str, values: list[float], let_go: bool = True) -> None:
    """Drag a slider over some values."""
    page.locator(f'[data-slider="{slider_id}"]').evaluate(
        """(slider, [values, letGo]) => {
             for (const value of values) { slider.value = value; slider.dispatchEvent(new Event('input')); }
             if (letGo) slider.dispatchEvent(new Event('change'));
           }""",
        [values, let_go],
    )


def downloaded(page: Page) -> bytes:
    """What the button for downloads gives."""
    with page.expect_download() as found:
        page.get_by_role("button", name="Download").click()
    return Path(found.value.path()).read_bytes()
