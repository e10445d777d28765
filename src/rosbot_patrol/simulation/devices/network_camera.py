"""An emulated network camera: JPEGs over HTTP, framed as the ESP32-CAM's CameraWebServer frames them."""

from __future__ import annotations

import base64
import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

BOUNDARY = "123456789000000000000987654321"
_WAIT = 0.2  # [s] between two looks whether the camera ends


class NetworkCamera:
    """One camera that serves its newest picture: `/stream` for all of them, `/capture` for one.

    Args:
        port: TCP port; 0 for any.
        user, password: that it asks for, "" for none.
        names_lengths: whether its parts name their length.

    Attributes:
        port: its port.
        is_silent: it accepts connections, and sends nothing.
    """

    def __init__(self, port: int = 0, *, user: str = "", password: str = "", names_lengths: bool = True) -> None:
        self._fresh = threading.Condition()
        self._jpeg, self._count = b"", 0
        self._viewers = 0
        self._is_running = True
        self._names_lengths = names_lengths
        self._wanted = f"Basic {base64.b64encode(f'{user}:{password}'.encode()).decode()}" if user else ""
        self.is_silent = False
        camera = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                camera._serve(self)

            def log_message(self, *_: object) -> None:
                """Say nothing."""

        self._server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self._server.daemon_threads = True
        self.port = int(self._server.server_address[1])
        threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True).start()

    def show(self, jpeg: bytes) -> None:
        """Take a new picture."""
        with self._fresh:
            self._jpeg, self._count = jpeg, self._count + 1
            self._fresh.notify_all()

    @property
    def is_watched(self) -> bool:
        """Whether somebody watches the stream."""
        return self._viewers > 0

    def close(self) -> None:
        """Go off the network; streams end."""
        self._is_running = False
        self._server.shutdown()
        self._server.server_close()

    def _serve(self, request: BaseHTTPRequestHandler) -> None:
        if self._wanted and request.headers.get("Authorization") != self._wanted:
            request.send_response(HTTPStatus.UNAUTHORIZED)
            request.send_header("WWW-Authenticate", 'Basic realm="camera"')
            request.send_header("Content-Length", "0")
            request.end_headers()
        elif request.path == "/stream":
            self._stream(request)
        elif request.path == "/capture":
            jpeg = self._jpeg  # once: the next picture may come before the end of this answer
            request.send_response(HTTPStatus.OK)
            request.send_header("Content-Type", "image/jpeg")
            request.send_header("Content-Length", str(len(jpeg)))
            request.end_headers()
            request.wfile.write(jpeg)
        else:
            request.send_error(HTTPStatus.NOT_FOUND)

    def _stream(self, request: BaseHTTPRequestHandler) -> None:
        request.send_response(HTTPStatus.OK)
        request.send_header("Content-Type", f"multipart/x-mixed-replace;boundary={BOUNDARY}")
        request.end_headers()
        sent = 0
        with self._fresh:
            self._viewers += 1
        try:
            while self._is_running:
                with self._fresh:
                    self._fresh.wait_for(lambda: self._count > sent, timeout=_WAIT)  # noqa: B023 - called at once
                    jpeg, count = self._jpeg, self._count
                if count > sent and not self.is_silent:
                    sent = count
                    length = f"Content-Length: {len(jpeg)}\r\n" if self._names_lengths else ""
                    head = f"\r\n--{BOUNDARY}\r\nContent-Type: image/jpeg\r\n{length}\r\n"
                    request.wfile.write(head.encode() + jpeg)
        except (BrokenPipeError, ConnectionResetError):
            return
        finally:
            with self._fresh:
                self._viewers -= 1
