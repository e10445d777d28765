"""A network camera that sends JPEGs over HTTP: a stream (multipart/x-mixed-replace), or one picture a request."""

from __future__ import annotations

import http.client
import time
import urllib.error
import urllib.request
from collections import deque
from collections.abc import Callable
from http import HTTPStatus
from urllib.parse import unquote, urlsplit, urlunsplit

from rosbot_patrol.drivers.cameras.capture import Capture, jpeg_capture
from rosbot_patrol.drivers.cameras.multipart import MOST_PART, PartReader, boundary_of
from rosbot_patrol.errors import DeviceError, ProtocolError

_CHUNK = 1 << 16


def split_url(url: str) -> tuple[str, str, str]:
    """An address without user and password, the user and the password ("" if there are none)."""
    parts = urlsplit(url)
    host = parts.netloc.rpartition("@")[2]
    bare = urlunsplit(parts._replace(netloc=host))
    return bare, unquote(parts.username or ""), unquote(parts.password or "")


class HttpCamera:
    """One camera behind an address.

    Args:
        url: http:// or https://, with user and password if it wants them.
        timeout: longest silence [s].
        rate: requests a second to a camera that sends one picture each.
        clock: steady time [s]; sleep: waits [s].

    Raises:
        DeviceError: it cannot be reached, refuses, or sends something else.
    """

    def __init__(
        self,
        url: str,
        *,
        timeout: float = 3.0,
        rate: float = 30.0,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._url, user, password = split_url(url)
        self._timeout, self._period = timeout, 1.0 / rate
        self._clock, self._sleep = clock, sleep
        self._opener = _opener(self._url, user, password)
        self._waiting: deque[bytes] = deque()
        self._due = 0.0
        self._answer = self._open()
        self._parts: PartReader | None = None
        kind = self._answer.headers.get_content_type()
        if kind == "multipart/x-mixed-replace":
            try:
                self._parts = PartReader(boundary_of(self._answer.headers["Content-Type"]))
            except ProtocolError as err:
                raise DeviceError(self._url, str(err)) from err
        elif not kind.startswith("image/"):
            self._answer.close()
            raise DeviceError(
                self._url, f"sends {kind}, neither a stream of JPEGs nor a JPEG: give the address of its video stream"
            )

    def read(self) -> Capture:
        """The next picture; see `Camera`."""
        while not self._waiting:
            self._receive()
        return jpeg_capture(self._waiting.popleft(), self._clock())

    def close(self) -> None:
        """End the connection."""
        self._answer.close()

    def _receive(self) -> None:
        try:
            if self._parts is None:
                self._receive_still()
                return
            data = self._answer.read1(_CHUNK)
            if not data:
                raise DeviceError(self._url, "the camera has ended its stream")
            self._waiting += self._parts.feed(data)
        except TimeoutError as err:
            raise DeviceError(self._url, f"silent for {self._timeout:g} s") from err
        except (OSError, http.client.HTTPException, ProtocolError) as err:
            raise DeviceError(self._url, str(err) or type(err).__name__) from err

    def _receive_still(self) -> None:
        if self._answer.closed:
            self._sleep(max(self._due - self._clock(), 0.0))
            self._answer = self._open()
        self._due = self._clock() + self._period
        data = self._answer.read(MOST_PART)
        self._answer.close()
        self._waiting.append(data)

    def _open(self) -> http.client.HTTPResponse:
        try:
            answer: http.client.HTTPResponse = self._opener.open(self._url, timeout=self._timeout)
        except urllib.error.HTTPError as err:
            err.close()
            raise DeviceError(self._url, _why_refused(err)) from err
        except urllib.error.URLError as err:
            silent = isinstance(err.reason, TimeoutError)
            raise DeviceError(self._url, self._silence if silent else f"cannot be reached: {err.reason}") from err
        except TimeoutError as err:
            raise DeviceError(self._url, self._silence) from err
        except (OSError, http.client.HTTPException) as err:
            raise DeviceError(self._url, f"does not speak HTTP: {err or type(err).__name__}") from err
        return answer

    @property
    def _silence(self) -> str:
        return f"no answer within {self._timeout:g} s"


def _why_refused(err: urllib.error.HTTPError) -> str:
    if err.code in (HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN):
        return f"refuses user and password ({err.code}): write them into the address, http://USER:PASSWORD@..."
    if err.code in (HTTPStatus.SERVICE_UNAVAILABLE, HTTPStatus.TOO_MANY_REQUESTS):
        return f"is busy ({err.code}): some cameras serve one viewer at a time"
    if err.code == HTTPStatus.NOT_FOUND:
        return "has no such page (404): an ESP32-CAM streams at http://ADDRESS:81/stream"
    return f"answers {err.code} {err.reason}"


def _opener(url: str, user: str, password: str) -> urllib.request.OpenerDirector:
    handlers: list[urllib.request.BaseHandler] = [urllib.request.ProxyHandler({})]
    if user or password:
        known = urllib.request.HTTPPasswordMgrWithDefaultRealm()
        known.add_password(None, url, user, password)
        handlers += [urllib.request.HTTPDigestAuthHandler(known), urllib.request.HTTPBasicAuthHandler(known)]
    return urllib.request.build_opener(*handlers)
