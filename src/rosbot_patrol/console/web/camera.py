"""The camera as one endless answer (multipart JPEG): encoded elsewhere, once for all viewers."""

from __future__ import annotations

import asyncio
import io
from collections.abc import AsyncIterator, Callable
from functools import lru_cache

from PIL import Image
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response, StreamingResponse

from rosbot_patrol.console.access.accounts import Account
from rosbot_patrol.console.live.hub import CAMERA, Hub

_EDGE = "picture"
_BEGIN = f"--{_EDGE}\r\nContent-Type: image/jpeg\r\n\r\n".encode()
_PERIOD = 0.1  # [s] between two pictures
_MOST = 20  # viewers


class CameraStream:
    """Answers with the camera's pictures, for as long as somebody looks.

    Args:
        hub: has the pictures.
        present: the account as it is now, None where its sessions have ended.
    """

    def __init__(self, hub: Hub, present: Callable[[Account], Account | None]) -> None:
        self._hub, self._present = hub, present
        self._count = 0

    async def answer(self, request: Request) -> Response:
        """The stream."""
        account: Account = request.state.account
        if not account.role.may_watch:
            return PlainTextResponse("Guests see nothing live.", 403)
        if self._count >= _MOST:
            return PlainTextResponse("Too many viewers.", 503)
        return StreamingResponse(
            self._pictures(request, account),
            media_type=f"multipart/x-mixed-replace; boundary={_EDGE}",
            headers={"Cache-Control": "no-store"},
        )

    async def _pictures(self, request: Request, account: Account) -> AsyncIterator[bytes]:
        self._count += 1
        number = self._hub.picture_number
        try:
            # A browser shows a part when the next one begins, and its page counts as loaded with the first.
            yield _BEGIN + _nothing() + b"\r\n" + _BEGIN
            with self._hub.viewer(CAMERA):
                while not await request.is_disconnected():
                    now = self._present(account)
                    if now is None or not now.role.may_watch:
                        return
                    try:
                        jpeg, number = await asyncio.wait_for(self._hub.picture_after(number), 1.0)
                    except TimeoutError:
                        continue
                    yield jpeg + b"\r\n" + _BEGIN
                    await asyncio.sleep(_PERIOD)
        finally:
            self._count -= 1


@lru_cache
def _nothing() -> bytes:
    """A dark picture, for as long as the camera has sent none."""
    written = io.BytesIO()
    Image.new("RGB", (16, 12), (17, 17, 17)).save(written, "JPEG")
    return written.getvalue()
