"""Access control of the page's server: only those who have its token, only for what the page consists of.

The token comes with the address that is printed. The page's first request trades it for a cookie, which its files, its
web socket and later visits bring along; a server forgets nothing and keeps no list.
"""

from __future__ import annotations

import hmac
import logging
import secrets
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote, urlsplit

LAUNCHER = "/paraview/"
"""Where trame's page asks for the address of its web socket before it tries the usual one."""

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; object-src 'none'; form-action 'none'"
    ),
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
"""Nothing is fetched from elsewhere, and the token is told to nobody. Vue compiles the page, hence `unsafe-eval`."""


@dataclass(frozen=True)
class Gate:
    """Decides about requests."""

    token: str = field(default_factory=lambda: secrets.token_urlsafe(18))

    def cookie(self, port: int) -> str:
        """Name of the cookie: browsers do not tell the ports of a machine apart."""
        return f"resfit_{port}"

    def knows(self, query: str | None, cookie: str | None) -> bool:
        """Token check of a request; one that is wrong in the address is not made up for by a cookie."""
        given = cookie if query is None else query
        return hmac.compare_digest((given or "").encode(), self.token.encode())

    def refusal(
        self, method: str, raw_path: str, query: str | None, cookie: str | None, origin: str | None, host: str
    ) -> str | None:
        """Reason to refuse a request, or None.

        Args:
            method: of HTTP.
            raw_path: as it was sent, without the query.
            query, cookie: the token in either, if any.
            origin: of the page that asks, if the browser says.
            host: as which this server was asked.
        """
        if not self.knows(query, cookie):
            return "The token is missing or wrong: open the address that resfit printed."
        if not is_plain(raw_path):
            return "There is no such place."
        if origin is not None and urlsplit(origin).netloc != host:
            # Other servers of the same machine see the cookie's site as their own.
            return "Pages from elsewhere may not ask here."
        if method not in ("GET", "HEAD") and raw_path != LAUNCHER:
            return "This can only be read."
        return None


def is_plain(raw_path: str) -> bool:
    """Path-traversal check: True if a path goes straight down, however often it was encoded."""
    path = raw_path
    for _ in range(4):
        decoded = unquote(path)
        if decoded == path:
            break
        path = decoded
    parts = path.replace("\\", "/").split("/")
    return path.isprintable() and "%" not in path and not any(part in (".", "..") for part in parts)


def is_ours(record: logging.LogRecord) -> bool:
    """Log filter: True if a record is about the server, not about a request that it could make nothing of.

    Such a request is answered, by 400 or an error; how it came about is no news for the terminal.
    """
    from aiohttp.http import HttpProcessingError

    told = record.exc_info[1] if record.exc_info else None
    return not isinstance(told, HttpProcessingError) and not record.getMessage().startswith("Traceback")


def guard(web_app: Any, gate: Gate) -> None:
    """Put a gate before everything that a wslink server answers, and say where its web socket is.

    Args:
        web_app: wslink's server, before it starts.
        gate: decides.
    """
    from aiohttp import web

    @web.middleware
    async def check(request: web.Request, handler: Callable[..., Awaitable[Any]]) -> Any:
        cookie, query = gate.cookie(web_app.get_port()), request.query.get("token")
        raw_path, origin = request.raw_path.partition("?")[0], request.headers.get("Origin")
        reason = gate.refusal(
            request.method, raw_path, query, request.cookies.get(cookie), origin, request.host
        )
        if reason is not None:
            return web.Response(status=403, text=reason, headers=HEADERS)

        def finish(response: web.StreamResponse) -> None:
            if not response.prepared:
                response.headers.update(HEADERS)
                if query is not None:
                    response.set_cookie(cookie, gate.token, httponly=True, samesite="Strict")

        try:
            response = await handler(request)
        except web.HTTPException as answer:
            # Redirects and refusals are raised.
            finish(answer)
            raise
        finish(response)
        return response

    async def launch(request: web.Request) -> web.Response:
        scheme = "wss" if request.scheme == "https" else "ws"
        return web.json_response({"sessionURL": f"{scheme}://{request.host}/ws"})

    for name in ("aiohttp.server", "wslink.protocol"):
        logging.getLogger(name).addFilter(is_ours)
    web_app.app.middlewares.append(check)
    web_app.app.router.add_post(LAUNCHER, launch)
