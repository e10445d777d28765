"""Lets a request in, or not: by the host that it asks, the page that it comes from, and the session that it carries.

- Without an owner's password only this machine may ask, by one of its own names. A page of a stranger that has its name
  point to 127.0.0.1 (DNS rebinding) asks by that name, and is refused.
- What changes something, and every websocket, has to come from a page of this console (`Origin`): a stranger's page
  cannot give orders with the session of its visitor.
- All but the sign-in page and the parts that draw it needs a session. An address in a notice marks its incident as seen
  without one, by a token of its own.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Mapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import quote, urlsplit

from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from rosbot_patrol.console.access.accounts import Account
from rosbot_patrol.console.access.door import COOKIE, Door

SEEN_PATH = "/seen/"

_LOCAL_NAMES = {"localhost", "127.0.0.1", "[::1]"}
_PUBLIC = ("/sign-in", "/manifest.webmanifest", "/icon-192.png", "/icon-512.png", "/favicon.ico", "/style.css")
_HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"same-origin"),
    (b"content-security-policy", b"frame-ancestors 'none'; base-uri 'self'; form-action 'self'"),
)


class Gate:
    """ASGI middleware. The account is in `scope["state"]["account"]` where there is one.

    Args:
        app: behind it.
        door: knows the sessions.
    """

    def __init__(self, app: ASGIApp, door: Door) -> None:
        self._app, self._door = app, door

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or pass it on."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        self._door.accounts.follow()
        refusal = self._refusal(scope, headers)
        if refusal:
            await _refuse(scope, receive, send, PlainTextResponse(refusal, 403))
            return
        account = self._account(headers)
        if account is None and not _is_public(scope):
            await _refuse(scope, receive, send, _sign_in(scope, headers))
            return
        scope.setdefault("state", {})["account"] = account

        async def send_with_headers(message: Any) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *_HEADERS]
            await send(message)

        await self._app(scope, receive, send_with_headers)

    def _account(self, headers: Mapping[str, str]) -> Account | None:
        if self._door.accounts.is_open:
            return self._door.accounts.local
        try:
            cookies = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            return None
        return self._door.account_of(cookies[COOKIE].value if COOKIE in cookies else None)

    def _refusal(self, scope: Scope, headers: Mapping[str, str]) -> str:
        """Reason why nobody at all is let in this way, "" if somebody may be."""
        host = headers.get("host", "")
        if self._door.accounts.is_open:
            name = host.rpartition(":")[0] if not host.endswith("]") and ":" in host else host
            if name not in _LOCAL_NAMES or not _is_local(scope):
                return "Until an owner has a password, this page is for the robot's own machine: http://localhost"
        if scope["type"] == "http" and (scope["method"] in ("GET", "HEAD") or scope["path"].startswith(SEEN_PATH)):
            return ""
        origin = headers.get("origin", "")
        if urlsplit(origin).netloc != host or not host:
            return "This order did not come from a page of this console."
        return ""


def peer_of(scope: Scope) -> str:
    """Address of the machine that asks."""
    client = scope.get("client")
    return str(client[0]) if client else "unknown"


def _is_local(scope: Scope) -> bool:
    try:
        return ipaddress.ip_address(peer_of(scope)).is_loopback
    except ValueError:
        return False


def _is_public(scope: Scope) -> bool:
    return scope["type"] == "http" and (scope["path"] in _PUBLIC or scope["path"].startswith(SEEN_PATH))


def _sign_in(scope: Scope, headers: Mapping[str, str]) -> PlainTextResponse | RedirectResponse:
    wants_page = scope["type"] == "http" and scope["method"] == "GET" and "text/html" in headers.get("accept", "")
    if not wants_page:
        return PlainTextResponse("Sign in first.", 401)
    target = scope["path"] + (f"?{scope['query_string'].decode('latin-1')}" if scope["query_string"] else "")
    return RedirectResponse(f"/sign-in?next={quote(target, safe='')}", 303)


async def _refuse(scope: Scope, receive: Receive, send: Send, response: Any) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 4401})
        return
    await response(scope, receive, send)
