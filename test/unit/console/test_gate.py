"""Nothing without a session, no order from a stranger's page, nobody from elsewhere before there is a password."""

from __future__ import annotations

from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.testclient import TestClient
from starlette.websockets import WebSocket, WebSocketDisconnect

from rosbot_patrol.console.access.accounts import Accounts, Role
from rosbot_patrol.console.access.door import COOKIE, Door
from rosbot_patrol.console.access.gate import Gate
from rosbot_patrol.console.access.sign_in import SignIn

PASSWORD = "correct horse"
PATHS = (
    "/",
    "/incidents",
    "/camera.mjpg",
    "/map.png",
    "/incidents/x/files/y.jpg",
    "/incidents/x/files/clip.mp4",
    "/report.zip",
    "/house",
    "/guide",
    "/_nicegui/any",
    "/sign-in/..",
)


async def echo(request: Request) -> Response:
    return PlainTextResponse(request.state.account.name if request.state.account else "nobody")


async def talk(socket: WebSocket) -> None:
    await socket.accept()
    await socket.send_text("hello")
    await socket.close()


def client_of(accounts: Accounts, base: str = "http://localhost:8420", peer: str = "127.0.0.1") -> TestClient:
    door = Door(accounts, b"s" * 32, lambda: 0.0)
    sign_in = SignIn(door, is_secure=False)
    routes = [
        Route("/sign-in", sign_in.page, methods=["GET"]),
        Route("/sign-in", sign_in.take, methods=["POST"]),
        WebSocketRoute("/socket", talk),
        Route("/{path:path}", echo, methods=["GET", "POST"]),
    ]
    app = Gate(Starlette(routes=routes), door)
    return TestClient(app, base_url=base, client=(peer, 5000), follow_redirects=False)


@pytest.fixture
def accounts(tmp_path: Path) -> Accounts:
    accounts = Accounts(tmp_path / "accounts.json")
    accounts.add("Ada", Role.OWNER, PASSWORD)
    return accounts


def signed_in(accounts: Accounts) -> TestClient:
    client = client_of(accounts)
    form = {"name": "Ada", "password": PASSWORD, "next": "/incidents"}
    answer = client.post("/sign-in", data=form, headers={"Origin": "http://localhost:8420"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/incidents")
    assert "HttpOnly" in answer.headers["set-cookie"]
    return client


@pytest.mark.parametrize("path", PATHS)
def test_without_a_session_there_is_nothing(accounts: Accounts, path: str) -> None:
    client = client_of(accounts)
    assert client.get(path).status_code == 401
    page = client.get(path, headers={"Accept": "text/html"})
    assert page.status_code == 303
    assert page.headers["location"].startswith("/sign-in?next=%2F")
    client.cookies.set(COOKIE, "forged")
    assert client.get(path).status_code == 401


def test_with_a_session_there_is_everything(accounts: Accounts) -> None:
    client = signed_in(accounts)
    assert client.get("/").text == "Ada"
    with client.websocket_connect("ws://localhost:8420/socket", headers={"Origin": "http://localhost:8420"}) as socket:
        assert socket.receive_text() == "hello"
    accounts.change_password("Ada", "battery staple")
    assert client.get("/").status_code == 401


@pytest.mark.parametrize("origin", ["", "http://evil.example", "http://localhost:8421", "null"])
def test_a_strangers_page_orders_nothing(accounts: Accounts, origin: str) -> None:
    client = signed_in(accounts)
    headers = {"Origin": origin} if origin else {}
    assert client.post("/anything", headers=headers).status_code == 403
    with pytest.raises(WebSocketDisconnect), client.websocket_connect("ws://localhost:8420/socket", headers=headers):
        pass


def test_a_websocket_needs_a_session(accounts: Accounts) -> None:
    headers = {"Origin": "http://localhost:8420"}
    with (
        pytest.raises(WebSocketDisconnect),
        client_of(accounts).websocket_connect("ws://localhost:8420/socket", headers=headers),
    ):
        pass


@pytest.mark.parametrize(
    ("base", "peer", "status"),
    [
        ("http://localhost:8420", "127.0.0.1", 200),
        ("http://127.0.0.1:8420", "127.0.0.1", 200),
        ("http://evil.example:8420", "127.0.0.1", 403),  # DNS rebinding
        ("http://localhost:8420", "192.168.1.7", 403),
        ("http://robot.local", "192.168.1.7", 403),
    ],
)
def test_before_the_first_password_only_this_machine_may(tmp_path: Path, base: str, peer: str, status: int) -> None:
    client = client_of(Accounts(tmp_path / "accounts.json"), base, peer)
    assert client.get("/").status_code == status


@pytest.mark.parametrize("target", ["//evil.example", "http://evil.example", "/\\evil.example", "javascript:x", ""])
def test_signing_in_leads_to_no_other_site(accounts: Accounts, target: str) -> None:
    form = {"name": "Ada", "password": PASSWORD, "next": target}
    answer = client_of(accounts).post("/sign-in", data=form, headers={"Origin": "http://localhost:8420"})
    assert answer.headers["location"] == "/"


def test_the_form_is_bounded_and_wrong_ones_are_told(accounts: Accounts) -> None:
    client, headers = client_of(accounts), {"Origin": "http://localhost:8420", "Accept-Language": "de"}
    assert client.post("/sign-in", content=b"x" * 5000, headers=headers).status_code == 413
    for _ in range(6):
        answer = client.post("/sign-in", data={"name": '"><script>', "password": "x"}, headers=headers)
        assert answer.status_code == 401
        assert "Name und Passwort passen nicht." in answer.text
        assert "<script>" not in answer.text
    answer = client.post("/sign-in", data={"name": "Ada", "password": PASSWORD}, headers=headers)
    assert answer.status_code == 429
    assert answer.headers["retry-after"] == "1"


def test_no_page_may_stand_in_a_frame(accounts: Accounts) -> None:
    answer = client_of(accounts).get("/sign-in")
    assert answer.headers["x-frame-options"] == "DENY"
    assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]


def test_a_notices_address_needs_no_session_and_no_page(accounts: Accounts) -> None:
    client = client_of(accounts, "http://robot.local:8420", "192.168.1.9")
    assert client.post("/seen/1/abc").text == "nobody"
    assert client.post("/seen").status_code == 403
    assert client.post("/seen/../incidents").status_code == 403
