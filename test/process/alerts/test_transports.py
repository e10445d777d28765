import mailbox
import socket
import time
from email.policy import default

import pytest
from smtp_server import SmtpServer

from rosbot_patrol.alerts.channels.channel import DeliveryError, FailureCause
from rosbot_patrol.alerts.channels.transports.sendmail import SendmailTransport
from rosbot_patrol.alerts.channels.transports.smtp import SmtpServer as Server
from rosbot_patrol.alerts.channels.transports.smtp import SmtpTransport
from rosbot_patrol.alerts.outbox.incident_notices import incident_notice


@pytest.fixture
def told(make_incident):
    return incident_notice(make_incident(), b"\xff\xd8 a picture")


def smtp(server, envelope, **given):
    return SmtpTransport(Server(host="localhost", port=server.port, timeout=1.0, **given), envelope)


def test_smtp_delivers_the_whole_mail(told, envelope):
    with SmtpServer() as server:
        assert smtp(server, envelope).send(told) == "owner@example.org"
        ((commands, data),) = server.mails
    assert commands[0].startswith("mail FROM:<robot@example.org>")
    assert commands[1:] == ["rcpt TO:<owner@example.org>"]
    read = mailbox.email.message_from_bytes(data, policy=default)
    assert read["Message-ID"] == "<20261121T010203Z-1@example.org>"
    assert [part.get_content() for part in read.iter_attachments()] == [b"\xff\xd8 a picture"]


@pytest.mark.parametrize(
    ("replies", "permanent"),
    [
        ({"": "421 busy"}, False),
        ({"": None}, False),
        ({"MAIL": "451 later"}, False),
        ({"MAIL": "550 not you"}, True),
        ({"RCPT": "450 later"}, False),
        ({"RCPT": "550 unknown"}, True),
        ({"DATA": "451 later"}, False),
        ({".": "452 disk full"}, False),
        ({".": "554 spam"}, True),
        ({".": None}, False),
        ({"": "garbage"}, False),
    ],
)
def test_what_a_server_refuses_is_said_with_its_name(told, envelope, replies, permanent):
    with SmtpServer(replies) as server:
        with pytest.raises(DeliveryError, match=f"localhost:{server.port}") as caught:
            smtp(server, envelope).send(told)
        assert caught.value.permanent is permanent
        assert server.mails == []


@pytest.mark.parametrize("bye", ["421 closing", None])
def test_a_mail_that_was_taken_counts_whatever_comes_after(told, envelope, bye):
    with SmtpServer({"QUIT": bye}) as server:
        smtp(server, envelope).send(told)
        assert len(server.mails) == 1


def test_a_silent_server_costs_no_more_than_the_time_out(told, envelope):
    began = time.monotonic()
    with (
        SmtpServer(silent=True) as server,
        pytest.raises(DeliveryError, match="cannot be used: no answer within") as caught,
    ):
        smtp(server, envelope).send(told)
    assert caught.value.cause is FailureCause.NO_ANSWER
    assert time.monotonic() - began < 3.0


def test_no_server(told, envelope):
    with socket.create_server(("localhost", 0)) as free:
        port = free.getsockname()[1]
    transport = SmtpTransport(Server(host="localhost", port=port), envelope)
    with pytest.raises(DeliveryError, match=f"the mail server localhost:{port} cannot be used: .*refused") as caught:
        transport.send(told)
    assert not caught.value.permanent


def test_starttls_that_is_not_offered_is_no_clear_text(told, envelope):
    with SmtpServer() as server:
        with pytest.raises(DeliveryError) as caught:
            smtp(server, envelope, security="starttls").send(told)
        assert caught.value.cause is FailureCause.NO_STARTTLS
        assert "MAIL" not in server.verbs


@pytest.fixture
def program(tmp_path):
    def make(text):
        path = tmp_path / "sendmail"
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
        return str(path)

    return make


def test_sendmail_gets_the_mail_and_the_recipients(tmp_path, program, told, envelope):
    path = program(f'echo "$@" > {tmp_path}/args; cat > {tmp_path}/mail')
    assert SendmailTransport(path, envelope, 5.0).send(told) == "owner@example.org"
    assert (tmp_path / "args").read_text().split() == ["-i", "-f", "robot@example.org", "--", "owner@example.org"]
    text = (tmp_path / "mail").read_bytes()
    assert b"\r\n" not in text
    assert b"Subject: Person in " in text


@pytest.mark.parametrize(
    ("script", "said", "permanent"),
    [
        ("cat >/dev/null; echo no such user >&2; exit 67", "ended with 67: no such user", True),
        ("cat >/dev/null; exit 75", "ended with 75: without a word", False),
        ("exit 1", "ended with 1", False),
        ("exec sleep 20", "did not end within 0.3 s", False),
    ],
)
def test_a_sendmail_that_fails_is_said(program, told, envelope, script, said, permanent):
    with pytest.raises(DeliveryError, match=said) as caught:
        SendmailTransport(program(script), envelope, 0.3).send(told)
    assert caught.value.permanent is permanent
