"""Starts and ends the server of a page."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import itertools
import os
import socket
import sys
from typing import Any

from resfit.errors import InputError

from ..scene.controller import Controller
from .app import App
from .guard import Gate, guard
from .layout import build_page

EVERYWHERE = ("0.0.0.0", "::", "")
"""Names for all addresses of a machine, none of which a browser can open."""

OPEN_WARNING = (
    "resfit: anyone who can reach this machine and has the address can see and change the assembly, and what is sent "
    "is not encrypted; without --host, only this machine can."
)

_numbers = itertools.count(1)


class PageServer:
    """One page and its server.

    Attributes:
        app: the page's other half.
        gate: decides who may come in.
        host: where it listens.
    """

    def __init__(self, controller: Controller, host: str = "127.0.0.1") -> None:
        """Make ready to show a controller's scene; call inside the loop that is to run it."""
        from trame.app import get_server

        # trame's own messages about where it runs, and its reading of our command line, are not wanted.
        server: Any = get_server(f"resfit_{next(_numbers)}", client_type="vue3")
        parse = server.cli.parse_known_args
        server.cli.parse_known_args = lambda *_: parse([])
        self.host = host
        self.gate = Gate()
        self.app = App(controller, server)
        self._server = server
        self._tasks: list[asyncio.Task[Any]] = []
        server.controller.on_server_bind.add(lambda web_app: guard(web_app, self.gate))
        build_page(server, self.app)

    @property
    def port(self) -> int:
        """Port of the server, once it listens."""
        return self._server.port

    @property
    def address(self) -> str:
        """URL to open in a browser, token included."""
        return f"http://{shown_host(self.host)}:{self.port}/?token={self.gate.token}"

    async def start(self, port: int = 0) -> None:
        """Begin to listen.

        Raises:
            InputError: if nothing can listen there.
        """
        serving = self._server.start(
            port=port, host=self.host, timeout=0, thread=True, exec_mode="coroutine", open_browser=False,
            show_connection_info=False, backend="aiohttp", follow_symlinks=False,
        )  # fmt: skip
        self._tasks = [asyncio.ensure_future(serving)]
        ready = asyncio.ensure_future(asyncio.wait_for(self._server.ready, 60))
        await asyncio.wait([self._tasks[0], ready], return_when=asyncio.FIRST_COMPLETED)
        if self._tasks[0].done():
            ready.cancel()
            reason = getattr(self._tasks[0].exception(), "strerror", None) or "the server did not start"
            raise InputError(f"cannot listen at {self.host} port {port}: {reason}.")
        self._tasks.append(asyncio.ensure_future(self.app.run()))

    async def wait(self) -> None:
        """Return when the server has ended, or one of its tasks failed."""
        done, _ = await asyncio.wait(self._tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()

    async def stop(self) -> None:
        """End the server."""
        for task in self._tasks[1:]:
            task.cancel()
        with contextlib.suppress(Exception):
            await asyncio.wait_for(self._server.stop(), 5)
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)


def serve(controller: Controller, host: str, port: int) -> None:
    """Serve a page until interrupted; prints its address as the only line on stdout.

    Raises:
        InputError: if nothing can listen there.
    """
    if not 0 <= port <= 65535:
        raise InputError(f"--port {port} is out of range; it must lie in [0, 65535], 0 for a free one.")
    # What trame reads from the environment may neither print to stdout nor open more than was asked for.
    for name in [name for name in os.environ if name.startswith(("TRAME_", "WSLINK_"))]:
        del os.environ[name]
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(_serve(controller, host, port))


async def _serve(controller: Controller, host: str, port: int) -> None:
    server = PageServer(controller, host)
    try:
        await server.start(port)
        if not is_local(host):
            sys.stderr.write(f"{OPEN_WARNING}\n")
        sys.stdout.write(f"{server.address}\n")
        sys.stdout.flush()
        await server.wait()
    finally:
        await server.stop()


def is_local(host: str) -> bool:
    """Loopback test: True if only this machine can reach a server that listens there."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def shown_host(host: str) -> str:
    """A host as it stands in an address."""
    if host in EVERYWHERE:
        return socket.gethostname()
    return f"[{host}]" if ":" in host else host
