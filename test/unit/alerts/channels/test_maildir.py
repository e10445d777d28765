import dataclasses
import mailbox
from email.policy import default

import pytest

from rosbot_patrol.alerts.channels.channel import DeliveryError
from rosbot_patrol.alerts.channels.transports.maildir import MaildirTransport
from rosbot_patrol.alerts.outbox.incident_notices import incident_notice


@pytest.fixture
def told(make_incident):
    return incident_notice(make_incident(), b"\xff\xd8 a picture")


def test_a_maildir_reads_back(tmp_path, told, envelope):
    place = MaildirTransport(tmp_path / "mail", envelope).send(told)
    factory = mailbox.Maildir(tmp_path / "mail", create=False)
    ((key, _),) = factory.items()
    read = mailbox.email.message_from_bytes(factory.get_bytes(key), policy=default)
    assert read["Subject"].startswith("Person in ")
    assert [part.get_content() for part in read.iter_attachments()] == [b"\xff\xd8 a picture"]
    assert place.startswith(str(tmp_path / "mail" / "new"))
    assert list((tmp_path / "mail" / "tmp").iterdir()) == []


def test_a_maildir_takes_an_incident_once(tmp_path, told, envelope):
    transport = MaildirTransport(tmp_path, envelope)
    first = transport.send(told)
    assert transport.send(told) == first
    assert len(mailbox.Maildir(tmp_path, create=False)) == 1
    transport.send(dataclasses.replace(told, id=told.id + "0"))
    assert len(mailbox.Maildir(tmp_path, create=False)) == 2


def test_a_maildir_knows_a_mail_that_was_read(tmp_path, told, envelope):
    transport = MaildirTransport(tmp_path, envelope)
    transport.send(told)
    box = mailbox.Maildir(tmp_path, create=False)
    (key,) = box.keys()
    message = box[key]
    message.set_subdir("cur")
    message.add_flag("S")
    box[key] = message
    (read,) = (tmp_path / "cur").iterdir()
    assert transport.send(told) == str(read)
    assert len(mailbox.Maildir(tmp_path, create=False)) == 1


def test_a_maildir_that_cannot_be_written_is_named(tmp_path, told, envelope):
    (tmp_path / "file").write_text("")
    with pytest.raises(DeliveryError, match=f"the Maildir {tmp_path}/file does not take the mail"):
        MaildirTransport(tmp_path / "file", envelope).send(told)
