"""The sign-in page: plain HTML, which needs neither scripts nor a session."""

from __future__ import annotations

import asyncio
from html import escape
from urllib.parse import parse_qs

from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response

from rosbot_patrol.console.access.door import COOKIE, MAX_AGE, Door, TooManyTries
from rosbot_patrol.console.access.gate import peer_of
from rosbot_patrol.console.words import Words, language_of, words_of
from rosbot_patrol.errors import AccessError

_LARGEST = 4096  # [bytes] of the form
_WITHIN = 10.0  # [s] it has to come


class SignIn:
    """Shows the page, takes the form, and signs out.

    Args:
        door: checks the password.
        is_secure: the console speaks TLS, so that the cookie goes over nothing else.
    """

    def __init__(self, door: Door, *, is_secure: bool) -> None:
        self._door, self._is_secure = door, is_secure

    async def page(self, request: Request) -> Response:
        """The empty form."""
        _ = words_of(language_of(request.headers.get("accept-language", "")))
        return HTMLResponse(_html(_, _target(request.query_params.get("next"))))

    async def take(self, request: Request) -> Response:
        """Sign somebody in, or say why not."""
        _ = words_of(language_of(request.headers.get("accept-language", "")))
        body = b""
        try:
            async with asyncio.timeout(_WITHIN):
                async for part in request.stream():
                    body += part
                    if len(body) > _LARGEST:
                        return HTMLResponse(_html(_, "/", _("That is too much for a name and a password.")), 413)
        except TimeoutError:
            return PlainTextResponse("The form did not come.", 408, {"Connection": "close"})
        form = {key: values[0] for key, values in parse_qs(body.decode("utf-8", "replace")).items()}
        name, target = form.get("name", ""), _target(form.get("next"))
        try:
            account = await asyncio.to_thread(
                self._door.sign_in, name, form.get("password", ""), peer_of(request.scope)
            )
        except TooManyTries as err:
            problem = _("Too many wrong tries: wait {n} s.").format(n=round(err.seconds))
            return HTMLResponse(_html(_, target, problem, name), 429, {"Retry-After": str(round(err.seconds))})
        except AccessError:
            return HTMLResponse(_html(_, target, _("Name and password do not fit."), name), 401)
        response = RedirectResponse(target, 303)
        cookie = self._door.cookie_of(account)
        response.set_cookie(COOKIE, cookie, MAX_AGE, httponly=True, samesite="lax", secure=self._is_secure)
        return response

    async def leave(self, _request: Request) -> Response:
        """Sign somebody out."""
        response = RedirectResponse("/sign-in", 303)
        response.delete_cookie(COOKIE)
        return response


def _target(path: str | None) -> str:
    """The page to go on to: one of this console, whatever was asked for."""
    is_own = path is not None and path.startswith("/") and not path.startswith(("//", "/\\")) and path.isprintable()
    return path if path is not None and is_own else "/"


def _html(_: Words, target: str, problem: str = "", name: str = "") -> str:
    alert = f'<p role="alert">{escape(problem)}</p>' if problem else ""
    return f"""<!DOCTYPE html>
<html lang="{escape(_("en"))}"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(_("Sign in"))} · rosbot_patrol</title>
<link rel="stylesheet" href="/style.css"><link rel="icon" href="/icon-192.png">
<link rel="manifest" href="/manifest.webmanifest"></head>
<body class="sign-in"><main><img src="/icon-192.png" alt="" width="72" height="72">
<h1>{escape(_("Sign in"))}</h1>{alert}
<form method="post" action="/sign-in">
<input type="hidden" name="next" value="{escape(target)}">
<label for="name">{escape(_("Name"))}</label>
<input id="name" name="name" autocomplete="username" required maxlength="40" value="{escape(name)}" autofocus>
<label for="password">{escape(_("Password"))}</label>
<input id="password" name="password" type="password" autocomplete="current-password" required maxlength="200">
<button type="submit">{escape(_("Sign in"))}</button>
</form></main></body></html>"""
