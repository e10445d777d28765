import mailbox
import socket
import time
from email.policy import default

import pytest
from smtp_server import SmtpServer

from rosbot_patrol.alerts import transports
from rosbot_patrol.alerts.mail import build_mail, make_envelope
from rosbot_patrol.alerts.transports import (
    DeliveryError,
    MaildirTransport,
    MailParams,
    SendmailTransport,
    SmtpTransport,
    make_transport,
    read_password,
)
from rosbot_patrol.alerts.wording import incident_notice
from rosbot_patrol.errors import ParamError


@pytest.fixture
def mail(make_incident, envelope):
    return build_mail(incident_notice(make_incident(), b"\xff\xd8 a picture"), envelope)


def smtp(server, envelope, **given):
    return SmtpTransport(MailParams(smtp_host="localhost", smtp_port=server.port, mail_timeout=1.0, **given), envelope)


def test_a_maildir_reads_back(tmp_path, mail):
    place = MaildirTransport(tmp_path / "mail").send("20261121T010203Z-1", mail)
    factory = mailbox.Maildir(tmp_path / "mail", create=False)
    ((key, _),) = factory.items()
    read = mailbox.email.message_from_bytes(factory.get_bytes(key), policy=default)
    assert read["Subject"] == "rosbot patrol node"
    assert [part.get_content() for part in read.iter_attachments()] == [b"\xff\xd8 a picture"]
    assert place.startswith(str(tmp_path / "mail" / "new"))
    assert list((tmp_path / "mail" / "tmp").iterdir()) == []


@pytest.mark.parametrize("seen", [False, True])
def test_a_maildir_takes_an_incident_once(tmp_path, mail, seen):
    transport = MaildirTransport(tmp_path)
    first = transport.send("i-1", mail)
    if seen:
        box = mailbox.Maildir(tmp_path, create=False)
        key = box.keys()[0]
        message = box[key]
        message.set_subdir("cur")
        message.add_flag("S")
        box[key] = message
    again = transport.send("i-1", mail)
    assert len(mailbox.Maildir(tmp_path, create=False)) == 1
    assert seen or again == first
    transport.send("i-10", mail)
    assert len(mailbox.Maildir(tmp_path, create=False)) == 2


def test_a_maildir_that_cannot_be_written_is_named(tmp_path, mail):
    (tmp_path / "file").write_text("")
    with pytest.raises(DeliveryError, match=f"the Maildir {tmp_path}/file does not take the mail"):
        MaildirTransport(tmp_path / "file").send("i", mail)


def test_smtp_delivers_the_whole_mail(mail, envelope):
    with SmtpServer() as server:
        assert smtp(server, envelope).send("i", mail) == "owner@example.org"
        ((commands, data),) = server.mails
    assert commands[0].startswith("mail FROM:<robot@example.org>")
    assert commands[1:] == ["rcpt TO:<owner@example.org>"]
    read = mailbox.email.message_from_bytes(data, policy=default)
    assert read["Message-ID"] == mail["Message-ID"]
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
def test_what_a_server_refuses_is_said_with_its_name(mail, envelope, replies, permanent):
    with SmtpServer(replies) as server:
        with pytest.raises(DeliveryError, match=f"localhost:{server.port}") as caught:
            smtp(server, envelope).send("i", mail)
        assert caught.value.permanent is permanent
        assert server.mails == []


@pytest.mark.parametrize("bye", ["421 closing", None])
def test_a_mail_that_was_taken_counts_whatever_comes_after(mail, envelope, bye):
    with SmtpServer({"QUIT": bye}) as server:
        smtp(server, envelope).send("i", mail)
        assert len(server.mails) == 1


def test_a_silent_server_costs_no_more_than_the_time_out(mail, envelope):
    began = time.monotonic()
    with SmtpServer(silent=True) as server, pytest.raises(DeliveryError, match="cannot be used: no answer within"):
        smtp(server, envelope).send("i", mail)
    assert time.monotonic() - began < 3.0


def test_no_server(mail, envelope):
    with socket.create_server(("localhost", 0)) as free:
        port = free.getsockname()[1]
    transport = SmtpTransport(MailParams(smtp_host="localhost", smtp_port=port), envelope)
    with pytest.raises(DeliveryError, match=f"the mail server localhost:{port} cannot be used: .*refused") as caught:
        transport.send("i", mail)
    assert not caught.value.permanent


def test_starttls_that_is_not_offered_is_no_clear_text(mail, envelope):
    with SmtpServer() as server:
        with pytest.raises(DeliveryError):
            smtp(server, envelope, smtp_security="starttls").send("i", mail)
        assert "MAIL" not in server.verbs


@pytest.fixture
def program(tmp_path):
    def make(text):
        path = tmp_path / "sendmail"
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
        return str(path)

    return make


def test_sendmail_gets_the_mail_and_the_recipients(tmp_path, program, mail, envelope):
    path = program(f'echo "$@" > {tmp_path}/args; cat > {tmp_path}/mail')
    assert SendmailTransport(path, envelope, 5.0).send("i", mail) == "owner@example.org"
    assert (tmp_path / "args").read_text().split() == ["-i", "-f", "robot@example.org", "--", "owner@example.org"]
    text = (tmp_path / "mail").read_bytes()
    assert b"\r\n" not in text
    assert b"Subject: rosbot patrol node\n" in text


@pytest.mark.parametrize(
    ("script", "said", "permanent"),
    [
        ("cat >/dev/null; echo no such user >&2; exit 67", "ended with 67: no such user", True),
        ("cat >/dev/null; exit 75", "ended with 75: without a word", False),
        ("exit 1", "ended with 1", False),
        ("exec sleep 20", "did not end within 0.3 s", False),
    ],
)
def test_a_sendmail_that_fails_is_said(program, mail, envelope, script, said, permanent):
    with pytest.raises(DeliveryError, match=said) as caught:
        SendmailTransport(program(script), envelope, 0.3).send("i", mail)
    assert caught.value.permanent is permanent


def choose(tmp_path, envelope=None, environ=None, **given):
    params = MailParams(**given)
    envelope = envelope or make_envelope(params.email_to, params.email_from)
    return make_transport(params, envelope, home=tmp_path, environ=environ or {})


def test_auto_takes_sendmail_for_a_real_address(tmp_path, program):
    path = program("exit 0")
    assert choose(tmp_path, email_to="a@b.org", sendmail=path).name == "sendmail"
    assert choose(tmp_path, email_to="*****@****.***", sendmail=path).name == "maildir"
    assert choose(tmp_path, email_to="", sendmail=path).name == "maildir"


def test_auto_without_a_sendmail_takes_the_maildir(tmp_path, monkeypatch):
    monkeypatch.setattr(transports, "SENDMAILS", ())
    transport = choose(tmp_path, email_to="a@b.org")
    assert transport.describe() == f"the Maildir {tmp_path}/rosbot_patrol/mail"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"transport": "sendmail", "sendmail": "/nowhere/sendmail", "email_to": "a@b.org"}, "no program at /nowhere"),
        ({"transport": "smtp"}, "~email_to: expected a real address for smtp"),
        ({"transport": "smtp", "email_to": "a@b.org", "smtp_user": "me"}, "~smtp_security: expected starttls or tls"),
        (
            {"transport": "smtp", "email_to": "a@b.org", "smtp_user": "me", "smtp_security": "tls"},
            "needs a password, from this file or the variable ROSBOT_PATROL_SMTP_PASSWORD",
        ),
    ],
)
def test_what_a_transport_lacks_is_a_sentence(tmp_path, given, said):
    with pytest.raises(ParamError, match=said):
        choose(tmp_path, **given)


def test_the_password_comes_from_a_private_file_or_the_environment(tmp_path):
    path = tmp_path / "password"
    path.write_text("secret\n")
    params = MailParams(smtp_password_file=str(path))
    path.chmod(0o644)
    with pytest.raises(ParamError, match="can be read by others"):
        read_password(params, {})
    path.chmod(0o600)
    assert read_password(params, {}) == "secret"
    assert read_password(MailParams(), {"ROSBOT_PATROL_SMTP_PASSWORD": "other"}) == "other"
    path.write_text("")
    with pytest.raises(ParamError, match="is empty"):
        read_password(params, {})
    with pytest.raises(ParamError, match="cannot be read"):
        read_password(MailParams(smtp_password_file=str(tmp_path / "none")), {})
