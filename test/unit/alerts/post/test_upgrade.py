"""Outboxes of the version before: whole mails, one folder for each program."""

from email.message import EmailMessage
from email.policy import SMTP

import pytest
from post import Box, channel, deliver_all, notice, postman

from rosbot_patrol.alerts.channels.mail import build_mail, make_envelope
from rosbot_patrol.alerts.post import upgrade


def old_mail(path, name, *, picture=None, incident=True):
    mail = EmailMessage(policy=SMTP)
    mail["Subject"] = "rosbot patrol node" if incident else "rosbot patrol: Küche"
    mail["From"], mail["To"] = "robot@example.org", "owner@example.org"
    mail["Date"], mail["Message-ID"] = "Mon, 21 Sep 2026 14:13:20 +0000", f"<{name}@example.org>"
    mail["X-Rosbot-Patrol-Incident" if incident else "X-Rosbot-Patrol-Notice"] = name
    mail.set_content("I have found something.\n\nRoom:     3 (Küche – 台所)\n", charset="utf-8")
    if picture:
        mail.add_attachment(picture, maintype="image", subtype="jpeg", filename="room3.jpg")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(mail.as_bytes(policy=SMTP))


@pytest.fixture
def folders(tmp_path):
    old_mail(tmp_path / "outbox" / "000000000007-i1.eml", "i1", picture=b"\xff\xd8 picture")
    old_mail(tmp_path / "outbox" / "000000000008-i2.eml", "i2")
    old_mail(tmp_path / "outbox" / "sent" / "000000000006-i0.eml", "i0")
    old_mail(tmp_path / "sensor_outbox" / "000000000001-s1.eml", "s1", incident=False)
    (tmp_path / "outbox" / "000000000009-x.eml").write_bytes(b"\0 no mail")
    (tmp_path / "outbox" / "notes.eml").write_text("mine")
    return tmp_path / "outbox", tmp_path / "sensor_outbox"


def test_mails_that_wait_become_notices_and_leave(folders):
    box = Box()
    post = postman(folders[0], channel("mail", box), legacy=folders)
    assert post.outbox.has("i0")  # delivered by the version before: not again
    assert post.outbox.has("i1")
    post.take_over()
    deliver_all(post)
    assert box.ids == ["i1", "i2", "s1"]
    first, _, sensor = box.taken
    assert (first.kind, first.incident, first.picture, first.picture_name) == (
        "incident",
        "i1",
        b"\xff\xd8 picture",
        "room3.jpg",
    )
    assert (first.wall, first.subject) == (1_790_000_000.0, "rosbot patrol node")
    assert "Room:     3 (Küche – 台所)" in first.text
    assert (sensor.kind, sensor.subject) == ("sensor", "rosbot patrol: Küche")
    mail = build_mail(first, make_envelope("owner@example.org", "robot@example.org"))
    assert mail["Message-ID"] == "<i1@example.org>"  # a mail program knows it if it was sent before the crash
    assert [p.name for p in folders[0].glob("*.eml")] == ["notes.eml"]
    assert (folders[0] / "000000000009-x.broken").exists()
    assert not post.outbox.put(notice("i0"))


@pytest.mark.parametrize("point", range(3))
def test_a_crash_in_between_loses_none_and_doubles_none(folders, monkeypatch, point):
    class Crash(Exception):
        pass

    post = postman(folders[0], channel("mail", Box()), legacy=folders)
    real, left = post.outbox.put, [point]

    def put(what):
        if left[0] == 0 and point % 2 == 0:
            raise Crash
        done = real(what)
        if left[0] == 0:
            raise Crash
        left[0] -= 1
        return done

    monkeypatch.setattr(post.outbox, "put", put)
    with pytest.raises(Crash):
        upgrade.adopt_mails(post.outbox, folders)
    box = Box()
    again = postman(folders[0], channel("mail", box), legacy=folders)
    again.take_over()
    deliver_all(again)
    assert sorted(box.ids) == ["i1", "i2", "s1"]
