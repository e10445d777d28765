"""Mail through a real Postfix of this machine, by its sendmail program and by SMTP, into a user's mailbox."""

import socket
import time
from email import message_from_bytes
from email.policy import default

import pytest
from postfix_instance import Postfix, why_not

from rosbot_patrol.alerts.channels.channel import DeliveryError
from rosbot_patrol.alerts.channels.config import Surroundings, make_channels
from rosbot_patrol.alerts.channels.mail import make_envelope
from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.channels.transports.sendmail import SendmailTransport
from rosbot_patrol.alerts.channels.transports.smtp import SmtpServer, SmtpTransport
from rosbot_patrol.alerts.dispatch.dispatcher import Dispatcher
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox

pytestmark = pytest.mark.skipif(bool(why_not()), reason=why_not() or "-")
USER = "nobody"  # is there on every Debian, and may receive mail


@pytest.fixture(scope="module")
def postfix():
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    made = Postfix(port)
    yield made
    made.stop()


def mails(postfix, count):
    """The mails of the user, once there are so many."""
    deadline = time.monotonic() + 20.0
    while time.monotonic() < deadline:
        folder = postfix.mailbox(USER)
        files = list((folder / "new").glob("*"))
        if len(files) >= count:
            return [message_from_bytes(file.read_bytes(), policy=default) for file in files]
        time.sleep(0.05)
    raise AssertionError(postfix.log())


def told(name, **given):
    values = {
        "id": name,
        "wall": 1_790_000_000.0,
        "kind": "incident",
        "subject": "rosbot patrol node",
        "text": "I have found something strange it could be invader.\n.\nFrom here on",
        "facts": (("Room", "3 (Küche – 台所 🚪)"), ("Why", "sehr lang " * 300)),
        "incident": name,
        "picture": bytes(range(256)) * 200,
        "picture_name": "room3.jpg",
    }
    return Notice(**{**values, **given})


def test_sendmail_and_smtp_deliver_to_a_mailbox_and_it_reads_back(postfix):
    envelope = make_envelope(f"{USER}@house.test", "robot@house.test")
    SendmailTransport(str(postfix.sendmail), envelope, 20.0).send(told("by-sendmail"))
    SmtpTransport(SmtpServer(host="127.0.0.1", port=postfix.port), envelope).send(told("by-smtp"))
    found = {mail["Message-ID"]: mail for mail in mails(postfix, 2)}
    assert set(found) == {"<by-sendmail@house.test>", "<by-smtp@house.test>"}
    for mail in found.values():
        assert mail["Subject"] == "rosbot patrol node"
        assert mail["Delivered-To"] == f"{USER}@house.test"
        assert mail["Return-Path"] == "<robot@house.test>"
        text = mail.get_body(("plain",)).get_content()
        assert "3 (Küche – 台所 🚪)" in text
        assert "\n.\n" in text
        assert "From here on" in text
        assert ("sehr lang " * 300).strip() in text
        assert "台所 🚪" in mail.get_body(("html",)).get_content()
        (picture,) = mail.iter_attachments()
        assert picture.get_content() == bytes(range(256)) * 200
    assert len(mails(postfix, 2)) == 2


def test_nothing_in_a_notice_or_parameter_injects(postfix):
    before = len(mails(postfix, 0))
    envelope = make_envelope(USER, "robot@house.test")
    evil = "a\r\nBcc: root@house.test\r\n\r\n.\r\nMAIL FROM:<x@y.org>"
    send = SendmailTransport(str(postfix.sendmail), envelope, 20.0).send
    send(told("evil-1", subject=evil, text=evil, picture_name=evil, incident=evil, kind=evil))
    send(told("evil-2", facts=((evil, evil),), room_name=evil, verdict=evil))
    found = [mail for mail in mails(postfix, before + 2) if "evil" in mail["Message-ID"]]
    assert len(found) == 2
    for mail in found:
        assert mail["Bcc"] is None
        assert len(list(mail.iter_attachments())) == 1
    assert not postfix.mailbox("root").exists()


def test_a_user_that_is_not_there_is_refused_for_good(postfix):
    envelope = make_envelope("no.such.user@house.test", "robot@house.test")
    with pytest.raises(DeliveryError, match=r"refused the recipient no.such.user@.*: 550 .*User unknown") as caught:
        SmtpTransport(SmtpServer(host="127.0.0.1", port=postfix.port), envelope).send(told("x"))
    assert caught.value.permanent


def test_one_of_two_users_that_is_not_there_costs_the_other_nothing(postfix, tmp_path):
    before = len(mails(postfix, 0))
    params = MailParams(
        transport="smtp",
        email_to=f"no.such.user@house.test, {USER}@house.test",
        smtp_host="127.0.0.1",
        smtp_port=postfix.port,
        mail_interval=0.0,
    )
    post = Dispatcher(Outbox(tmp_path), make_channels(params, Surroundings(home=tmp_path, environ={})))
    post.outbox.put(told("two-users"))
    assert post.take_over()
    for name in post.channels:
        post.deliver(name)
    post.refresh()
    found = [mail["Message-ID"] for mail in mails(postfix, before + 1)]
    assert found.count("<two-users@localhost>") == 1
    assert "User unknown" in post.statuses()[0].refusal
    assert [entry.id for entry in post.outbox.waiting() if entry.kind == "incident"] == []
    post.hand_over()
