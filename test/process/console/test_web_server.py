"""The web server on real sockets: where it listens, and what many or slow connections do to others."""

from __future__ import annotations

import contextlib
import http.client
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from rosbot_patrol.console.access.accounts import Accounts, Role
from rosbot_patrol.console.access.door import Door
from rosbot_patrol.console.access.gate import Gate
from rosbot_patrol.console.access.sign_in import SignIn
from rosbot_patrol.console.web import connections
from rosbot_patrol.console.web.server import ServerParams, WebServer
from rosbot_patrol.errors import AccessError

PASSWORD = "correct horse"
STRANGER, OTHER = "127.0.0.7", "127.0.0.8"  # other machines, as far as the server knows
HOST = "127.0.0.3"


async def hello(_: Request) -> Response:
    return PlainTextResponse("hello")


class Running:
    """The server with a small application, on a thread."""

    def __init__(self, folder: Path) -> None:
        self.accounts = Accounts(folder / "accounts.json")
        door = Door(self.accounts, b"s" * 32, time.monotonic)
        sign_in = SignIn(door, is_secure=False)
        routes = [
            Route("/sign-in", sign_in.page, methods=["GET"]),
            Route("/sign-in", sign_in.take, methods=["POST"]),
            Route("/{path:path}", hello),
        ]
        self.server = WebServer(ServerParams(address=HOST, port=18500), lambda: self.accounts.is_open)
        self.port = int(self.server.url.rpartition(":")[2])
        app = Gate(Starlette(routes=routes), door)
        self.thread = threading.Thread(target=self.server.run, args=(app,), daemon=True)
        self.thread.start()
        self.wait(lambda: self.get("127.0.0.1", "/sign-in") == 200)

    def connect(self, host: str = HOST, source: str = STRANGER) -> socket.socket:
        return socket.create_connection((host, self.port), 5.0, (source, 0))

    def get(self, host: str, path: str, source: str = "127.0.0.1") -> int:
        """Status of an answer; 0 where there is no connection."""
        connection = http.client.HTTPConnection(host, self.port, timeout=5.0, source_address=(source, 0))
        try:
            connection.request(
                "GET", path, headers={"Host": f"{'localhost' if host == '127.0.0.1' else host}:{self.port}"}
            )
            return connection.getresponse().status
        except (OSError, http.client.HTTPException):
            return 0
        finally:
            connection.close()

    def wait(self, condition: object, seconds: float = 10.0) -> None:
        deadline = time.monotonic() + seconds
        while not condition():  # type: ignore[operator]
            assert time.monotonic() < deadline, "it did not come"
            time.sleep(0.05)


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Running]:
    running = Running(tmp_path)
    yield running
    running.server.end()
    running.thread.join(10.0)
    assert not running.thread.is_alive()


def test_it_listens_elsewhere_once_an_owner_has_a_password(running: Running) -> None:
    assert running.get("127.0.0.1", "/") == 200
    assert running.get(HOST, "/") == 0
    running.accounts.add("Ada", Role.OWNER, PASSWORD)
    running.wait(lambda: running.get(HOST, "/") == 401)
    assert running.get(HOST, "/sign-in") == 200
    assert running.get("127.0.0.1", "/") == 401


def test_a_stranger_with_many_silent_connections_keeps_nobody_out(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    running.accounts.add("Ada", Role.OWNER, PASSWORD)
    running.wait(lambda: running.get(HOST, "/sign-in") == 200)
    with contextlib.ExitStack() as held:
        for _ in range(400):
            with contextlib.suppress(OSError):
                held.enter_context(running.connect())
        assert running.get(HOST, "/sign-in", OTHER) == 200
        assert running.get("127.0.0.1", "/sign-in") == 200
        assert running.get(HOST, "/sign-in", STRANGER) == 0


def test_a_request_that_does_not_end_is_cut(running: Running, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "_REQUEST_WITHIN", 0.5)
    for start in (b"", b"GET / HTTP/1.1\r\nHost: localh", b"GET /sign-in HTTP/1.1\r\nX: " + b"x" * 40_000):
        with running.connect("127.0.0.1", "127.0.0.1") as slow:
            slow.sendall(start)
            began = time.monotonic()
            with contextlib.suppress(ConnectionError):
                assert slow.recv(1) == b""
            assert 0.2 < time.monotonic() - began < 3.0


def test_a_head_without_an_end_is_refused(running: Running) -> None:
    with running.connect("127.0.0.1", "127.0.0.1") as endless, contextlib.suppress(ConnectionError):
        endless.sendall(b"GET / HTTP/1.1\r\n")
        for _ in range(40):
            endless.sendall(b"X: " + b"x" * 9_000 + b"\r\n")
        assert b" 400 " in endless.recv(100)


@pytest.mark.parametrize(
    "path", ["/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd", "/sign-in/../secret"]
)
def test_paths_lead_nowhere_without_a_session(running: Running, path: str) -> None:
    running.accounts.add("Ada", Role.OWNER, PASSWORD)
    assert running.get("127.0.0.1", path) == 401


def test_wrong_passwords_by_the_hundred_stop_at_the_sixth(running: Running) -> None:
    running.accounts.add("Ada", Role.OWNER, PASSWORD)
    found: list[int] = []
    for _ in range(200):
        connection = http.client.HTTPConnection("127.0.0.1", running.port, timeout=5.0)
        head = {"Origin": f"http://localhost:{running.port}", "Host": f"localhost:{running.port}"}
        connection.request("POST", "/sign-in", "name=Ada&password=wrong-horse", head)
        found.append(connection.getresponse().status)
        connection.close()
    assert found[:6] == [401] * 6
    assert found.count(401) < 12
    assert set(found) == {401, 429}


def test_a_port_that_is_taken(tmp_path: Path) -> None:
    with contextlib.ExitStack() as taken:
        for port in range(18600, 18610):
            each = taken.enter_context(socket.socket())
            each.bind(("127.0.0.1", port))
            each.listen()
        with pytest.raises(AccessError, match="the TCP ports 18600 to 18609 are all taken"):
            WebServer(ServerParams(port=18600), lambda: True)
    with pytest.raises(AccessError, match=r"the certificate is to be in /nowhere/cert\.pem, and there is no such file"):
        WebServer(ServerParams(certificate="/nowhere/cert.pem", key=str(tmp_path)), lambda: True)
