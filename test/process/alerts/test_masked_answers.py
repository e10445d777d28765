"""The address of a webhook is a secret: it stands in no log, status, receipt or sentence, whoever wrote it there."""

import html
import http.server
import json
import logging
import socket
import threading
from urllib.parse import quote, unquote

import pytest
from post import channel, deliver_all, dispatcher, notice
from smtp_server import SmtpServer

from rosbot_patrol.alerts.channels.channel import DeliveryError
from rosbot_patrol.alerts.channels.mail import make_envelope
from rosbot_patrol.alerts.channels.transports.smtp import SmtpServer as Server
from rosbot_patrol.alerts.channels.transports.smtp import SmtpTransport
from rosbot_patrol.alerts.channels.transports.webhook import WebAddress, WebhookTransport

SECRET, KEY = "Xk29-topSecret_hook", "q7%2BKEYvalue"
PATH = f"/api/webhooks/{SECRET}?key={KEY}&x=1"
TOKEN = "tok-3n0fMine"


class Echo(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        said = self.server.words(self.path, self.headers, body)
        self.send_response(self.server.status, self.server.reason or None)
        self.end_headers()
        self.wfile.write(said.encode())

    def log_message(self, *args):
        pass


@pytest.fixture
def web():
    server = http.server.ThreadingHTTPServer(("localhost", 0), Echo)
    server.words, server.status, server.reason = (lambda *_: ""), 404, ""
    server.url = f"http://localhost:{server.server_port}{PATH}"
    threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


def leaks(text):
    return [part for part in (SECRET, SECRET.lower(), KEY, unquote(KEY), "KEYvalue", TOKEN) if part in text]


ECHOES = {
    "as it came": lambda path, *_: f"Cannot POST {path}",
    "the path alone": lambda path, *_: path.partition("?")[0],
    "decoded": lambda path, *_: unquote(path),
    "coded": lambda path, *_: quote(path, safe=""),
    "for HTML": lambda path, *_: f"<pre>{html.escape(path)}</pre>",
    "as JSON": lambda path, *_: json.dumps({"path": path}).replace("/", "\\/"),
    "in small letters": lambda path, *_: path.lower(),
    "a part of it": lambda *_: f"no hook {SECRET}",
    "far behind": lambda path, *_: "." * 290 + path,
    "headers": lambda _, headers, __: str(headers),
}


@pytest.mark.parametrize("status", [404, 500, 302, 400])
@pytest.mark.parametrize("echo", ECHOES)
def test_what_a_server_repeats_of_the_address_is_masked(web, echo, status):
    web.words, web.status = ECHOES[echo], status
    transport = WebhookTransport(WebAddress(url=web.url, token=TOKEN, secret="signing-Key", timeout=2.0))
    with pytest.raises(DeliveryError, match=rf"the webhook at http://localhost:\d+/\.\.\. answered {status}") as caught:
        transport.send(notice("n1"))
    assert leaks(str(caught.value)) == []
    assert caught.value.__cause__ is None


def test_a_reason_phrase_too(web):
    web.reason, web.status = f"Hook {SECRET} gone", 410
    with pytest.raises(DeliveryError, match=r"410 Hook \.\.\. gone"):
        WebhookTransport(WebAddress(url=web.url, timeout=2.0)).send(notice("n1"))


@pytest.mark.parametrize("filler", [0, 290])
def test_a_peer_that_is_no_web_server_and_repeats_what_it_hears(filler):
    with socket.create_server(("localhost", 0)) as server:

        def serve():
            connection, _ = server.accept()
            with connection:
                connection.sendall(b"?" * filler + connection.recv(65536).partition(b"\r\n")[0] + b"\r\n")

        threading.Thread(target=serve, daemon=True).start()
        url = f"http://localhost:{server.getsockname()[1]}{PATH}"
        with pytest.raises(DeliveryError, match="cannot be used") as caught:
            WebhookTransport(WebAddress(url=url, timeout=2.0)).send(notice("n1"))
    assert leaks(str(caught.value)) == []


def test_nothing_that_is_written_or_logged_holds_the_address(web, tmp_path, caplog):
    caplog.set_level(logging.DEBUG)
    web.words = ECHOES["as it came"]
    hook = WebhookTransport(WebAddress(url=web.url, name="phone", timeout=2.0))
    post = dispatcher(tmp_path, channel("phone", hook), channel("other", hook))
    post.outbox.put(notice("n1"))
    post.take_over()
    done = deliver_all(post)
    post.tell_faults()
    post.write_status()
    web.status = 200
    post.nudge(all_=True)
    done += deliver_all(post)
    assert any(d.delivered for d in done)
    said = caplog.text + "".join(d.text + d.where for d in done) + str(post.statuses())
    said += "".join(path.read_text() for path in tmp_path.rglob("*") if path.is_file() and path.name != "reserve")
    assert leaks(said) == []
    assert f"the webhook 'phone' at http://localhost:{web.server_port}/..." in said


@pytest.mark.parametrize("echo", ["{password}", "unknown command AUTH PLAIN {plain}"])
def test_a_mail_server_that_repeats_the_login(echo):
    import base64

    password = "geh\u00e4im-7"
    plain = base64.b64encode(f"\0robot\0{password}".encode()).decode()
    with SmtpServer(
        {"EHLO": "250-me\r\n250 AUTH PLAIN", "AUTH": "535 " + echo.format(password="geheim-8", plain=plain)}
    ) as s:
        password = "geheim-8" if "{password}" in echo else password
        server = Server(host="localhost", port=s.port, user="robot", password=password, timeout=2.0)
        with pytest.raises(DeliveryError, match=r"refused the login: 535 .*\.\.\.") as caught:
            SmtpTransport(server, make_envelope("a@x.org", "")).send(notice("n1"))
    assert "geheim-8" not in str(caught.value)
    assert plain not in str(caught.value)
