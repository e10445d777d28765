import base64
import http.server
import json
import socket
import ssl
import threading
import time

import pytest
from certificate import make_certificate
from post import notice

from rosbot_patrol.alerts.channels.channel import DeliveryError, FailureCause
from rosbot_patrol.alerts.channels.transports.webhook import WebAddress, WebhookTransport, check_url, sign

WALL = 1_790_000_000.5


class Handler(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.server.got.append((self.path, dict(self.headers), body))
        status, headers, said = self.server.reply
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(said)

    def log_message(self, *args):
        pass


@pytest.fixture
def web():
    server = http.server.ThreadingHTTPServer(("localhost", 0), Handler)
    server.got, server.reply = [], (200, {}, b"")
    server.url = f"http://localhost:{server.server_port}/api/webhook/patrol?key=1"
    threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


def hook(url, **given):
    return WebhookTransport(WebAddress(url=url, timeout=1.0, **given), wall=lambda: WALL)


def test_a_notice_is_a_json_document(web):
    told = notice(
        "i-1", facts=(("Room", "3"),), room_id=3, room_name="Küche 台所 🚪", verdict="confirmed", picture=b"\xff\xd8"
    )
    where = hook(web.url).send(told)
    assert where == f"the webhook at http://localhost:{web.server_port}/... (200 OK)"
    ((path, headers, body),) = web.got
    assert path == "/api/webhook/patrol?key=1"
    assert (headers["Content-Type"], headers["Idempotency-Key"]) == ("application/json", "i-1")
    tree = json.loads(body)
    assert (tree["id"], tree["kind"], tree["time"], tree["verdict"]) == ("i-1", "incident", told.wall, "confirmed")
    assert tree["room"] == {"id": 3, "name": "Küche 台所 🚪"}
    assert tree["facts"] == {"Room": "3"}
    assert base64.b64decode(tree["picture"]["base64"]) == b"\xff\xd8"
    assert "Authorization" not in headers
    assert "X-Rosbot-Patrol-Signature" not in headers


def test_the_signature_is_that_of_time_and_body(web):
    hook(web.url, secret="geheim", token="t0ken", with_picture=False).send(notice("i-1", picture=b"\xff"))
    ((_, headers, body),) = web.got
    assert headers["X-Rosbot-Patrol-Timestamp"] == "1790000000"
    assert headers["X-Rosbot-Patrol-Signature"] == sign("geheim", "1790000000", body)
    assert headers["X-Rosbot-Patrol-Signature"] != sign("other", "1790000000", body)
    assert headers["Authorization"] == "Bearer t0ken"
    assert "picture" not in json.loads(body)


def test_a_known_signature():
    """As `printf '5.{}' | openssl dgst -sha256 -hmac key` gives it."""
    assert sign("key", "5", b"{}") == "sha256=9be615aec64f0d044b5ad6854ab1d893ec88617fb728d2149dcd3a3428e8c45d"


@pytest.mark.parametrize(
    ("reply", "permanent", "delay", "said"),
    [
        ((301, {"Location": "http://localhost/"}, b""), False, None, "redirects are not followed"),
        ((307, {"Location": "http://localhost/"}, b""), False, None, "redirects are not followed"),
        ((400, {}, b"no\r\nsuch key"), True, None, "answered 400 Bad Request no such key"),
        ((401, {}, b""), False, None, "answered 401"),
        ((404, {}, b""), False, None, "answered 404"),
        ((413, {}, b""), True, None, "answered 413"),
        ((429, {"Retry-After": "120"}, b""), False, 120.0, "answered 429"),
        ((500, {}, b""), False, None, "answered 500"),
        ((503, {"Retry-After": "soon"}, b""), False, None, "answered 503"),
        ((429, {"Retry-After": "64.57"}, b""), False, 64.57, "answered 429"),
        ((429, {"Retry-After": "Mon, 21 Sep 2026 14:14:21 GMT"}, b""), False, 60.5, "answered 429"),
        ((503, {"Retry-After": "Monday, 21-Sep-26 14:14:21 GMT"}, b""), False, 60.5, "answered 503"),
        ((503, {"Retry-After": "Mon Sep 21 14:14:21 2026"}, b""), False, 60.5, "answered 503"),
        ((503, {"Retry-After": "Mon, 21 Sep 2026 13:00:00 GMT"}, b""), False, 0.0, "answered 503"),
        ((503, {"Retry-After": "-3"}, b""), False, 0.0, "answered 503"),
        ((503, {"Retry-After": ""}, b""), False, None, "answered 503"),
        ((301, {"Retry-After": "7"}, b""), False, 7.0, "redirects are not followed"),
        ((404, {"Retry-After": "8"}, b""), False, 8.0, "answered 404"),
        ((413, {"Retry-After": "9"}, b""), False, 9.0, "answered 413"),  # for now
        ((413, {"Retry-After": "soon"}, b""), True, None, "answered 413"),
        ((400, {"Retry-After": "9"}, b""), True, 9.0, "answered 400"),
        ((429, {"Retry-After": "86400"}, b""), False, 86400.0, "a pause of 86400 s, the longest one here is 900 s"),
        ((503, {"Retry-After": "9" * 400}, b""), False, float("inf"), "a pause of inf s, the longest one here"),
    ],
)
def test_what_is_not_taken_is_said(web, reply, permanent, delay, said):
    web.reply = reply
    with pytest.raises(DeliveryError, match=said) as caught:
        hook(web.url, secret="geheim").send(notice("i-1"))
    assert (caught.value.permanent, caught.value.delay) == (permanent, delay)
    assert len(web.got) == 1
    assert "key=1" not in str(caught.value)


def test_a_pause_that_cannot_be_read_is_said_once_and_shows_no_secret(web, caplog):
    web.reply = (503, {"Retry-After": "\u00b2 for /api/webhook/patrol?key=1"}, b"")
    made = hook(web.url, name="phone")
    for _ in range(3):
        with pytest.raises(DeliveryError, match="answered 503"):
            made.send(notice("i-1"))
    (said,) = [record.getMessage() for record in caplog.records]
    assert "the webhook 'phone' at" in said
    assert "neither seconds nor a date, using our own: '\u00b2 for ...'" in said


def test_the_first_of_several_pauses_counts():
    """Where a proxy adds its own."""
    with socket.create_server(("localhost", 0)) as server:

        def serve():
            connection, _ = server.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(b"HTTP/1.1 503 no\r\nRetry-After: 7\r\nRetry-After: 9\r\nContent-Length: 0\r\n\r\n")

        threading.Thread(target=serve, daemon=True).start()
        with pytest.raises(DeliveryError) as caught:
            hook(f"http://localhost:{server.getsockname()[1]}/").send(notice("i-1"))
    assert caught.value.delay == 7.0


def test_https_trusts_the_certificate_that_is_named_and_no_other(web, tmp_path):
    cert, key = make_certificate(tmp_path)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(cert, key)
    web.socket = context.wrap_socket(web.socket, server_side=True)
    url = web.url.replace("http:", "https:")
    hook(url, ca_file=str(cert)).send(notice("i-1"))
    with pytest.raises(DeliveryError, match="its TLS certificate is not to be trusted"):
        hook(url).send(notice("i-1"))
    assert len(web.got) == 1


def test_nobody_there_and_no_such_name():
    with socket.create_server(("localhost", 0)) as free:
        url = f"http://localhost:{free.getsockname()[1]}/"
    with pytest.raises(DeliveryError, match="nothing listens there") as caught:
        hook(url).send(notice("a"))
    assert caught.value.cause is FailureCause.CONNECTION_REFUSED
    with pytest.raises(DeliveryError, match=r"the name 'no.such.host.invalid' cannot be found") as caught:
        hook("http://no.such.host.invalid/").send(notice("a"))
    assert caught.value.cause is FailureCause.UNKNOWN_HOST


@pytest.mark.parametrize(
    ("status", "cause"),
    [
        (308, FailureCause.REDIRECT),
        (401, FailureCause.UNAUTHORIZED),
        (403, FailureCause.FORBIDDEN),
        (404, FailureCause.NOT_FOUND),
        (418, FailureCause.OTHER),
    ],
)
def test_the_status_tells_the_cause(web, status, cause):
    web.reply = (status, {}, b"")
    with pytest.raises(DeliveryError) as caught:
        hook(web.url).send(notice("i-1"))
    assert caught.value.cause is cause


@pytest.mark.parametrize("drip", [b"", b"H"])
def test_a_server_that_says_nothing_or_drips_is_given_up(drip):
    with socket.create_server(("localhost", 0)) as server:

        def serve():
            connection, _ = server.accept()
            with connection:
                try:
                    while True:
                        connection.sendall(drip)
                        time.sleep(0.05)
                except OSError:
                    return

        threading.Thread(target=serve, daemon=True).start()
        made = WebhookTransport(WebAddress(url=f"http://localhost:{server.getsockname()[1]}/", timeout=0.3))
        began = time.monotonic()
        with pytest.raises(DeliveryError, match=r"no answer within 0.3 s"):
            made.send(notice("a"))
        assert time.monotonic() - began < 10.0


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("ftp://x.org/", "expected http"),
        ("https://", "expected http"),
        ("x.org/hook", "expected http"),
        ("https://me:pass@x.org/", "has a user or password in it"),
        ("http://x.org/a b", "has a blank"),
        ("http://x.org/\r\nX: y", "has a blank, a line break"),
        ("http://x.org:99999/", "is no web address"),
        ("http://küche.org/", "letter that a web address cannot have"),
        ("http://[::1/", "is no web address"),
    ],
)
def test_bad_addresses(url, said):
    assert said in check_url(url)


def test_good_addresses():
    assert check_url("https://hass.local:8123/api/webhook/patrol?x=1") is None
    assert check_url("http://[::1]:8080/") is None
