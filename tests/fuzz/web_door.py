"""The web viewer's door: `resfit view --web` asked from the outside, with and without its token.

Wrong: who has no token gets in, or another page; a file is read or written that is none of the page's; a traceback in
the log, the token in a log or in the list of processes; the server ends.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import random
import socket
from collections.abc import Callable, Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fuzz.campaigns import shuffled
from fuzz.harness import Campaign, Case, Wrong
from fuzz.web_server import PAGE, SECRET, WAIT, server

REFUSED = (400, 403, 404, 405, 414, 431)

WRONG_TOKENS = ("", "x", "%00", "%ff", "%ed%a0%80", "é")
ORIGINS = (
    "http://evil.example",
    "null",
    "http://localhost:{port}",
    "http://127.0.0.1:1",
    "http://127.0.0.1:{port}.evil.example",
)
METHODS = ("POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT", "FOO")
PATHS = (
    "/../secret.txt", "/../../../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/%252e%252e/etc/passwd",
    "/..%2f..%2fetc/passwd", "/..\\..\\etc\\passwd", "//etc/passwd", "/assets/../../../../etc/passwd",
    "/assets/..%5c..%5cetc", "/%00", "/\udcff", "/etc/passwd", "/proc/self/environ", "/file:///etc/passwd",
    "/secret.txt", "/assembly.json", "/__trame_vuetify3/../../etc/passwd", "/" + "a/" * 2000, "/" + "x" * 9000,
    "/;/../etc", "/.%2e/etc", "/%c0%ae%c0%ae/etc/passwd",
)  # fmt: skip
RAW = {
    "header of 100 kB": b"GET / HTTP/1.1\r\nHost: x\r\nA: " + b"x" * 100000 + b"\r\n\r\n",
    "TLS": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(200),
    "HTTP/1.0": b"GET / HTTP/1.0\r\n\r\n",
    "no HTTP": b"hello\r\n\r\n",
    "bad length": b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: -5\r\n\r\n",
    "two lengths": b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\nab",
}
NAMES = (
    "../evil.json", "/tmp/resfit-evil.json", "..\\evil", "secret.txt", "a/b", ".hidden", "x\0.json", "con", "a" * 300,
    "\u202e", 5, None, ["x"],
)  # fmt: skip
CALLS: dict[str, tuple[str, list[Any]]] = {
    **{f"save {str(name)[:20]!a}": ("trame.trigger", ["save", [name], {}]) for name in NAMES},
    **{f"run {name}": ("trame.trigger", ["run", [name], {}])
       for name in ("quit", "rename", "__class__", "undo", "export")},
    "slide nowhere": ("trame.trigger", ["slide", [[0, "a"], "__class__", 1e300, True], {}]),
    "slide nan": ("trame.trigger", ["slide", [[0, "a"], "size.0", "nan", True], {}]),
    "slide nothing": ("trame.trigger", ["slide", [{"a": [1]}, "size.0", 1, True], {}]),
    "type no number": ("trame.trigger", ["type", [[0, "a"], "size.0", {"a": 1}], {}]),
    "rename": ("trame.trigger", ["rename", [[0, "a"], "</script>" * 50], {}]),
    "add": ("trame.trigger", ["add", ["__import__"], {}]),
    "step": ("trame.trigger", ["step", [2**40], {}]),
    "select": ("trame.trigger", ["select", ["x", {"a": 1}], {}]),
    "no trigger": ("trame.trigger", ["__init__", [], {}]),
    "state": ("trame.state.update", [[{"key": "save_name", "value": "../evil.json"}, {"key": "parts", "value": 1}]]),
    "no method": ("os.system", ["touch /tmp/resfit-evil.json"]),
    "huge size": ("trame.rca.size", ["resfit_picture", "", {"w": 1e9, "h": 1e9, "p": 1e9}]),
    "size nan": ("trame.rca.size", ["resfit_picture", "", {"w": float("nan"), "h": 5, "p": 1}]),
    "odd event": ("trame.rca.event", ["resfit_picture", "", {"type": "MouseMove", "x": 1e308, "y": "a"}]),
}  # fmt: skip
"""What a page that has the token may send: method and arguments."""


def expect(answer: tuple[int, str, bytes], *codes: int) -> None:
    """The status is one of these, and nothing is told that is nobody's business."""
    code, _, body = answer
    if code not in codes:
        raise Wrong(f"status {code} instead of {codes}")
    here = server()
    for word in (b"root:", SECRET, b"Traceback", bytes(here.folder)):
        if word in body:
            raise Wrong(f"status {code}, and it tells {word!r}")


def web_socket(headers: Mapping[str, str]) -> tuple[int, str, bytes]:
    """Knock at the web socket."""
    key = base64.b64encode(bytes(16)).decode()
    upgrade = {
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": key,
    }
    return server().ask("/ws", headers={**upgrade, **headers})


def listens() -> None:
    """Only on 127.0.0.1, with a token that is long and not in the list of processes; headers of the page."""
    here = server()
    tables = [Path(f"/proc/net/{name}").read_text().splitlines()[1:] for name in ("tcp", "tcp6")]
    rows = [line.split() for table in tables for line in table]
    places = [row[1] for row in rows if row[3] == "0A" and int(row[1].rpartition(":")[2], 16) == here.port]
    if places != [f"0100007F:{here.port:04X}"] or here.host != "127.0.0.1":
        raise Wrong(f"it listens at {places}")
    if len(here.token) < 20 or here.token.encode() in Path(f"/proc/{here.process.pid}/cmdline").read_bytes():
        raise Wrong("the token is short or in the list of processes")
    for path in (PAGE, "/"):
        code, head, _ = here.ask(f"{path}?token={here.token}")
        low = head.lower()
        missing = [word for word in ("content-security-policy", "no-referrer", "nosniff") if word not in low]
        if code not in (200, 302) or missing:
            raise Wrong(f"{path} with the token: status {code}, without {missing}")


def idle() -> None:
    """It answers beside 300 connections that say nothing."""
    here = server()
    waiting = [socket.create_connection(("127.0.0.1", here.port)) for _ in range(300)]
    expect(here.ask(PAGE, headers=here.jar), 200)
    for stream in waiting:
        stream.close()


def call(name: str) -> None:
    """Send one message as the page does; whatever the answer, the server goes on and answers the next."""
    import aiohttp
    import msgpack
    from wslink.chunking import generate_chunks

    here = server()
    method, arguments = CALLS[name]

    async def send(stream: aiohttp.ClientWebSocketResponse, key: str, called: str, given: list[Any]) -> bool:
        message = {"wslink": "1.0", "id": key, "method": called, "args": given, "kwargs": {}}
        for chunk in generate_chunks(msgpack.packb(message), 1 << 20):
            await stream.send_bytes(chunk)
        async with asyncio.timeout(WAIT):
            async for got in stream:
                if isinstance(got.data, bytes) and key.encode() in got.data:
                    return True
        return False

    async def speak() -> bool:
        address = f"http://127.0.0.1:{here.port}"
        headers = {**here.jar, "Origin": address}
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"{address}/ws", headers=headers, max_msg_size=0) as stream,
        ):
            await send(stream, "system:c0:0", "wslink.hello", [{"secret": "wslink-secret"}])
            with contextlib.suppress(TimeoutError):
                await send(stream, "rpc:c0:1", method, arguments)
            return await send(stream, "rpc:c0:2", "trame.trigger", ["text", [], {}])

    try:
        answered = asyncio.run(speak())
    except TimeoutError:
        answered = False
    if not answered and name != "run quit":
        raise Wrong("the next message is not answered")


def checks() -> dict[str, Callable[[], object]]:
    """What is tried, by name."""
    made: dict[str, Callable[[], object]] = {"listens": listens, "idle connections": idle}
    for path in ("/", PAGE, "/assets/x.js"):
        made[f"no token {path}"] = lambda path=path: expect(server().ask(path), 403)
    for token in WRONG_TOKENS:
        made[f"token {token!a}"] = lambda token=token: expect(server().ask(f"{PAGE}?token={token}"), 400, 403)
    made["token cut"] = lambda: expect(server().ask(f"{PAGE}?token={server().token[:-1]}"), 403)
    made["token and more"] = lambda: expect(server().ask(f"{PAGE}?token={server().token}x"), 403)
    made["wrong token, right cookie"] = lambda: expect(
        server().ask("/?token=wrong", headers=server().jar), 403
    )
    made["wrong cookie"] = lambda: expect(
        server().ask(PAGE, headers={"Cookie": f"resfit_{server().port}=x"}), 403
    )
    made["right cookie"] = lambda: expect(server().ask(PAGE, headers=server().jar), 200)
    for origin in ORIGINS:

        def elsewhere(origin: str = origin) -> None:
            headers = {**server().jar, "Origin": origin.format(port=server().port)}
            expect(server().ask(PAGE, headers=headers), 403)
            expect(web_socket(headers), 403)
            expect(server().ask("/paraview/", "POST", headers), 403)

        made[f"origin {origin}"] = elsewhere
    made["web socket, no cookie"] = lambda: expect(web_socket({}), 403)
    made["web socket"] = lambda: expect(
        web_socket({**server().jar, "Origin": f"http://127.0.0.1:{server().port}"}), 101
    )
    made["launcher, no cookie"] = lambda: expect(server().ask("/paraview/", "POST"), 403)
    for method in METHODS:
        made[f"method {method}"] = lambda method=method: expect(
            server().ask(PAGE, method, server().jar), *REFUSED
        )
    for path in PATHS:
        made[f"path {path[:40]!a}"] = lambda path=path: expect(
            server().ask(path, headers=server().jar), 0, 200, *REFUSED
        )
    for name, raw in RAW.items():
        made[f"raw {name}"] = lambda raw=raw: expect(server().ask("", raw=raw), 0, *REFUSED)
    for name in CALLS:
        made[f"call {name}"] = lambda name=name: call(name)
    return made


def cases(rng: random.Random) -> Iterator[Case]:
    """All of them once."""
    return shuffled(rng, [Case(name) for name in checks()])


def attempt(case: Case, folder: Path) -> None:
    """One of them, at a server that is there for all."""
    try:
        checks()[case.name]()
        server().check()
    except Wrong:
        if server().process.poll() is not None:
            server.cache_clear()
        raise


def unavailable() -> str:
    """What is missing here."""
    missing = [name for name in ("trame", "aiohttp", "msgpack", "wslink") if not find_spec(name)]
    return f"{missing[0]} is not installed (extra web)" if missing else ""


CAMPAIGN = Campaign("web-door", cases, attempt, hang_s=60.0, unavailable=unavailable)
