"""Mail through a real SMTP server (aiosmtpd) with STARTTLS, a certificate of openssl's, and a login."""

import dataclasses
import ssl
import time
from email import message_from_bytes
from email.policy import default

import pytest
from certificate import make_certificate
from post import Time, channel, deliver_all, dispatcher, notice

from rosbot_patrol.alerts.channels.channel import DeliveryError, FailureCause
from rosbot_patrol.alerts.channels.mail import make_envelope
from rosbot_patrol.alerts.channels.transports.smtp import SmtpServer, SmtpTransport
from rosbot_patrol.alerts.outbox.notice import Notice

smtpd = pytest.importorskip("aiosmtpd.smtp", reason="needs python3-aiosmtpd")
from real_smtp import RealSmtp  # noqa: E402

ENVELOPE = make_envelope("Owner <owner@example.org>, second@example.org", "robot@example.org").copies()[0]
LONG = "Wohn- und Esszimmer mit Küchenzeile, Wintergarten und Treppe zum Keller " * 4


def check_login(server, session, envelope, mechanism, data):
    good = isinstance(data, smtpd.LoginPassword) and (data.login, data.password) == (b"robot", "gehe\u00e4m".encode())
    return smtpd.AuthResult(success=good, handled=False)


@pytest.fixture(scope="module")
def certificate(tmp_path_factory):
    return make_certificate(tmp_path_factory.mktemp("tls"))


def tls(certificate):
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(*certificate)
    return context


@pytest.fixture
def start(certificate):
    running = []

    def start(**options):
        options = {"authenticator": check_login, "auth_required": True, **options}
        running.append(RealSmtp(tls_context=tls(certificate), require_starttls=True, **options))
        return running[-1]

    yield start
    for server in running:
        server.stop()


def transport(port, certificate, **given):
    values = {"host": "localhost", "port": port, "security": "starttls", "user": "robot", "password": "geheäm"}
    values |= {"ca_file": str(certificate[0]), "timeout": 5.0}
    return SmtpTransport(SmtpServer(**{**values, **given}), ENVELOPE)


@pytest.fixture
def told():
    return Notice(
        id="20261121T010203Z-1",
        wall=1_790_000_000.0,
        kind="incident",
        subject="rosbot patrol node",
        text="I have found something strange it could be invader.",
        facts=(("Room", "3 (Küche – 台所 🚪)"), ("Why", LONG)),
        room_id=3,
        room_name="Küche – 台所 🚪",
        verdict="confirmed",
        incident="20261121T010203Z-1",
        picture=bytes(range(256)) * 300,
        picture_name="room3.jpg",
    )


def test_starttls_and_login_and_the_mail_reads_back(start, certificate, told):
    server = start()
    where = transport(server.port, certificate).send(told)
    assert where == "owner@example.org"
    ((sender, recipients, data, authenticated),) = server.mails
    assert (sender, recipients, authenticated) == ("robot@example.org", [where], True)
    assert max(map(len, data.split(b"\r\n"))) <= 998
    data.decode("ascii")  # any server may take it
    mail = message_from_bytes(data, policy=default)
    assert (mail["Subject"], mail["Message-ID"]) == ("rosbot patrol node", "<20261121T010203Z-1@example.org>")
    assert mail["To"] == "Owner <owner@example.org>, second@example.org"
    assert mail["Auto-Submitted"] == "auto-generated"
    text = mail.get_body(("plain",)).get_content()
    assert text.startswith("I have found something strange it could be invader.\r\n")
    assert "3 (Küche – 台所 🚪)" in text
    assert LONG.strip() in text
    html = mail.get_body(("html",)).get_content()
    assert "Küche – 台所 🚪" in html
    (picture,) = mail.iter_attachments()
    assert picture.get_content() == told.picture
    assert (picture.get_filename(), picture.get_content_disposition()) == ("room3.jpg", "inline")
    assert f'src="cid:{picture["Content-ID"].strip("<>")}"' in html


@pytest.mark.parametrize(
    ("given", "cause", "said"),
    [
        ({"password": "wrong"}, FailureCause.LOGIN, "refused the login: 535"),
        ({"user": "", "password": ""}, FailureCause.OTHER, "refused the mail: 530"),
        ({"ca_file": ""}, FailureCause.CERTIFICATE, "its TLS certificate is not to be trusted: self-signed"),
        ({"host": "127.0.0.1"}, FailureCause.CERTIFICATE, "its TLS certificate is not to be trusted: IP address mis"),
        ({"security": "tls"}, FailureCause.NO_TLS, "it does not speak TLS as it should"),
    ],
)
def test_what_goes_wrong_is_said_in_words(start, certificate, told, given, cause, said):
    server = start()
    with pytest.raises(DeliveryError, match=said) as caught:
        transport(server.port, certificate, **given).send(told)
    assert not caught.value.permanent or "530" in said
    assert caught.value.cause is cause
    assert server.mails == []
    assert "geheäm" not in str(caught.value)


def test_tls_from_the_first_byte(certificate, told):
    server = RealSmtp(ssl=tls(certificate))
    try:
        transport(server.port, certificate, security="tls", user="").send(told)
    finally:
        server.stop()
    assert len(server.mails) == 1


def test_a_server_that_stops_and_starts_gets_all_in_order_once(start, certificate, tmp_path):
    """The hour of test_dispatcher.py against a real server; the clock is the test's."""
    clock, first = Time(), start()
    post = dispatcher(tmp_path, channel("mail", transport(first.port, certificate)), time=clock)
    post.take_over()
    names = [f"n{i}" for i in range(6)]
    post.outbox.put(notice(names[0]))
    deliver_all(post)
    first.stop()
    for name in names[1:]:
        post.outbox.put(notice(name))
        clock.now += 600.0
        assert not any(d.delivered for d in deliver_all(post))
    assert "Connection refused" in post.statuses()[0].error
    second = start(port=first.port)
    clock.now += 900.0
    deliver_all(post)
    ids = [message_from_bytes(data, policy=default)["Message-ID"] for _, _, data, _ in first.mails + second.mails]
    assert ids == [f"<{name}@example.org>" for name in names]
    assert post.outbox.waiting() == []


def test_a_server_that_drips_is_cut_off(told):
    import socket
    import threading

    with socket.create_server(("localhost", 0)) as server:

        def drip():
            connection, _ = server.accept()
            with connection:
                try:
                    while True:
                        connection.sendall(b"2")
                        time.sleep(0.1)
                except OSError:
                    return

        threading.Thread(target=drip, daemon=True).start()
        made = SmtpTransport(SmtpServer(host="localhost", port=server.getsockname()[1], timeout=0.3), ENVELOPE)
        began = time.monotonic()
        with pytest.raises(DeliveryError, match="cannot be used"):
            made.send(told)
        assert time.monotonic() - began < 10.0


EVIL = [
    "a\nBcc: evil@x.org",
    "a\r\nBcc: evil@x.org\r\n\r\nnew body",
    "a\rBcc: evil@x.org",
    "a\x00b",
    "a\u2028Bcc: evil@x.org",
    "a\x85Bcc: evil@x.org",
    "\n.\nMAIL FROM:<evil@x.org>",
    "=?utf-8?q?a=0ABcc:_evil@x.org?=",
    "a" * 5000,
    "\udcff",
    '"><script>',
]
FIELDS = ["subject", "text", "kind", "room_name", "verdict", "incident", "picture_name", "facts"]


@pytest.fixture(scope="module")
def plain_server():
    server = RealSmtp()
    yield server
    server.stop()


@pytest.mark.parametrize("field", FIELDS)
def test_nothing_in_a_notice_injects(plain_server, told, field):
    """Every field with every evil text, through the real server: the same headers, parts and recipients as without."""
    server = plain_server
    server.mails.clear()
    sender = SmtpTransport(SmtpServer(host="localhost", port=server.port), ENVELOPE)
    sender.send(told)
    for evil in EVIL:
        value = (("Why", evil), (evil, "x")) if field == "facts" else evil
        sender.send(dataclasses.replace(told, **{field: value}))
    (_, _, plain, _), *others = server.mails
    model = message_from_bytes(plain, policy=default)
    assert len(others) == len(EVIL)
    for _, recipients, data, _ in others:
        mail = message_from_bytes(data, policy=default)
        expected = {"X-Rosbot-Patrol-Incident", *model.keys()}
        assert set(mail.keys()) <= expected
        assert mail["Bcc"] is None
        assert recipients == ["owner@example.org"]
        assert [p.get_content_type() for p in mail.walk()] == [p.get_content_type() for p in model.walk()]
        assert "<script>" not in mail.get_body(("html",)).get_content()
        (picture,) = mail.iter_attachments()
        assert picture.get_content() == told.picture
        if field != "text":
            text = mail.get_body(("plain",)).get_content()
            assert not any(
                line.startswith(("Bcc", "new body", "MAIL FROM")) or line == "." for line in text.splitlines()
            )
