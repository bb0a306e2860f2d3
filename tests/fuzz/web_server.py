"""A running web viewer, asked over a socket: requests may be as wrong as they like."""

from __future__ import annotations

import re
import socket
import subprocess
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from urllib.parse import urlsplit

from fuzz.assembly_cases import BOX, changed, document, text_of
from fuzz.commands import RESFIT
from fuzz.harness import Wrong

PAGE = "/index.html"
SECRET = b"SECRET"
"""What a file beside the assembly holds."""

WAIT = 10.0
"""Seconds for an answer."""


class Server:
    """A running viewer."""

    def __init__(self) -> None:
        """Start it on an assembly beside a file that is nobody's business."""
        self.folder = Path(mkdtemp()) / "inner"
        self.folder.mkdir()
        names = ("a", "</script><script>x</script>", "{{7*7}}")
        parts = (changed(BOX, name=name, translation=[0.0, 0.4 * i, 0.0]) for i, name in enumerate(names))
        (self.folder / "assembly.json").write_bytes(text_of(document(*parts)))
        (self.folder / "secret.txt").write_bytes(SECRET)
        self.log = self.folder.parent / "log"
        # Appended to: it is emptied after each request.
        with self.log.open("ab") as log:
            command = [RESFIT, "view", str(self.folder / "assembly.json"), "--web"]
            self.process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=log, stdin=subprocess.DEVNULL
            )
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().decode().strip()
        place = urlsplit(self.address)
        self.host, self.port, self.token = place.hostname, place.port or 0, place.query.partition("=")[2]
        head = self.ask(f"{PAGE}?token={self.token}")[1]
        found = re.search(r"Set-Cookie: ([^;]+)", head, re.IGNORECASE)
        self.jar = {"Cookie": found[1] if found else ""}

    def ask(
        self, path: str, method: str = "GET", headers: Mapping[str, str] | None = None, raw: bytes = b""
    ) -> tuple[int, str, bytes]:
        """(status or 0, head, body) of the answer to a request."""
        given = {
            "Host": f"127.0.0.1:{self.port}",
            "Connection": "close",
            "Content-Length": "0",
            **(headers or {}),
        }
        lines = [f"{method} {path} HTTP/1.1", *(f"{name}: {value}" for name, value in given.items())]
        data = raw or ("\r\n".join(lines) + "\r\n\r\n").encode("utf-8", "surrogateescape")
        got = b""
        with socket.create_connection(("127.0.0.1", self.port), timeout=WAIT) as stream:
            stream.sendall(data)
            try:
                while (chunk := stream.recv(65536)) and b"HTTP/1.1 101" not in got and len(got) < 3_000_000:
                    got += chunk
            except (TimeoutError, ConnectionResetError):
                pass
        head, _, body = got.partition(b"\r\n\r\n")
        status = re.match(rb"HTTP/1\.[01] (\d+)", head)
        return int(status[1]) if status else 0, head.decode("latin-1"), body

    def check(self) -> None:
        """It runs, its log tells of no defect and not of the token, and its folder is as it was."""
        if self.process.poll() is not None:
            raise Wrong(f"the server ended with {self.process.returncode}: {self.log.read_text()[-300:]}")
        text = self.log.read_text(errors="replace")
        self.log.write_text("")
        if "Traceback" in text or self.token in text:
            raise Wrong(f"the log says: {text[:300]}")
        if (self.folder / "secret.txt").read_bytes() != SECRET:
            raise Wrong("a file that is no assembly was written over")
        outside = {path.name for path in self.folder.parent.iterdir()} - {"inner", "log"}
        if outside or list(Path("/tmp").glob("resfit-evil*")):
            raise Wrong(f"a file was written outside its folder: {sorted(outside)}")


server = cache(Server)
