from dataclasses import replace
from email import message_from_bytes
from email.policy import SMTP, default

import pytest

from rosbot_patrol.alerts.channels.mail import build_mail, make_envelope
from rosbot_patrol.alerts.outbox.incident_notices import incident_notice, verdict_notice
from rosbot_patrol.errors import ParamError

JPEG = b"\xff\xd8\xff\xe0 picture \x00\x01\n.\nFrom \r\n\xff\xd9"


def read_back(mail):
    return message_from_bytes(mail.as_bytes(policy=SMTP), policy=default)


def test_a_mail_in_the_tutorials_style(make_incident, envelope):
    notice = incident_notice(make_incident(), JPEG)
    mail = read_back(build_mail(notice, replace(envelope, is_tutorial=True)))
    assert mail["Subject"] == "rosbot patrol node"
    lines = mail.get_body(("plain",)).get_content().splitlines()
    assert lines[0] == "I have found something strange it could be invader."
    assert lines[2].startswith("Person seen in ")


def test_the_mail_says_what_and_where_and_is_a_proper_one(make_incident, envelope):
    mail = read_back(build_mail(incident_notice(make_incident(), JPEG), envelope))
    assert mail["Subject"].startswith("Person in Küche – 台所, ")
    assert mail["To"] == "owner@example.org"
    assert mail["From"] == "robot@example.org"
    assert mail["Message-ID"] == "<20261121T010203Z-1@example.org>"
    assert mail["Date"].datetime.timestamp() == 1_790_000_000
    assert mail["MIME-Version"] == "1.0"
    body = mail.get_body(("plain",))
    assert body.get_content_charset() == "utf-8"
    text = body.get_content()
    assert text.startswith("Person seen in room 3 (Küche – 台所).")
    assert "3 (Küche – 台所)" in text
    assert "confirmed" in text
    assert "person, probability 0.87" in text
    (picture,) = mail.iter_attachments()
    assert picture.get_content_type() == "image/jpeg"
    assert picture.get_content() == JPEG
    assert picture.get_filename() == "room3-20261121T010203Z-1.jpg"


def test_where_the_person_stood_is_said_where_it_is_known(make_incident, envelope):
    notice = incident_notice(make_incident(person=(1.25, -3.0), person_room="hall\nBcc: x@y.org"), None)
    text = read_back(build_mail(notice, envelope)).get_body(("plain",)).get_content()
    assert "Person:   x 1.2 m, y -3.0 m in the map, in hall Bcc: x@y.org" in text.splitlines()


def test_without_a_picture_the_mail_says_why(make_incident, envelope):
    mail = read_back(
        build_mail(incident_notice(make_incident(), None, picture_note="none came from the camera"), envelope)
    )
    assert list(mail.iter_attachments()) == []
    assert "none came from the camera" in mail.get_body(("plain",)).get_content()


@pytest.mark.parametrize("evil", ["a\nBcc: evil@x.org", "a\r\n\r\nnew body", "a\x00b", "a\u2028b", "\n.\n"])
@pytest.mark.parametrize("field", ["room_name", "object_class", "reason", "id", "verdict", "phase"])
def test_no_field_can_inject_a_header_or_a_line(make_incident, envelope, field, evil):
    mail = read_back(build_mail(incident_notice(make_incident(**{field: evil}), JPEG), envelope))
    assert mail["Bcc"] is None
    assert mail["Subject"].isprintable()
    assert sorted(mail.keys()) == sorted(read_back(build_mail(incident_notice(make_incident(), JPEG), envelope)).keys())
    lines = mail.get_body(("plain",)).get_content().splitlines()
    assert not any(line.startswith(("Bcc", "new body", ".")) for line in lines)
    assert len(list(mail.iter_attachments())) == 1


@pytest.mark.parametrize(
    "evil",
    [
        "a@b.org\nBcc: x@y.org",
        "a@b.org\r\nSubject: z",
        "a@b.org\0",
        "a b c",
        "-oQ/tmp@b.org",
        "é@b.org",
        "@b.org",
        "a@",
    ],
)
def test_bad_addresses_are_refused_by_name(evil):
    with pytest.raises(ParamError, match=r"~email_to: (has a line break|expected a mail address)"):
        make_envelope(evil, "")
    with pytest.raises(ParamError, match=r"~email_from: "):
        make_envelope("", evil)


def test_two_senders_are_one_too_many():
    with pytest.raises(ParamError, match="email_from: expected one address"):
        make_envelope("", "a@b.org, c@d.org")


@pytest.mark.parametrize(
    ("to", "real"),
    [
        ("owner@example.org", True),
        ("Owner <owner@example.org>, second@example.org", True),
        ("root@localhost", True),
        ("root", True),
        ("", False),
        ("*****@****.***", False),
        ("a@b_c.org", False),
    ],
)
def test_what_is_a_real_address(to, real):
    assert make_envelope(to, "").is_real is real


def test_the_tutorials_placeholder_as_sender_becomes_an_address_that_servers_take(make_incident):
    envelope = make_envelope("", "*****@****.***", host="not a host")
    assert envelope.sender.addr_spec == "rosbot_patrol@localhost"
    assert (
        read_back(build_mail(incident_notice(make_incident(), None), envelope))["From"]
        == "rosbot patrol <rosbot_patrol@localhost>"
    )


def test_a_verdict_without_anybody_is_told_in_its_own_words(make_incident, envelope):
    notice = verdict_notice(make_incident(verdict="unverified", share_seen=0.42, object_class=""))
    mail = read_back(build_mail(notice, envelope))
    assert mail["Subject"] == "rosbot patrol: room 3 (Küche – 台所): unverified"
    text = mail.get_body(("plain",)).get_content()
    assert text.startswith("The robot was there but could not be sure")
    assert "42 % of the floor" in text


def test_a_notice_about_an_incident_links_to_its_page(make_incident, envelope):
    link = "http://robot.local:8420/incidents/1?<b>"
    notice = replace(incident_notice(make_incident(), None), link=link, seen_link="http://robot.local:8420/seen/1/abc")
    mail = read_back(build_mail(notice, envelope))
    assert link in mail.get_body(("plain",)).get_content().splitlines()
    page = mail.get_body(("html",)).get_content()
    assert 'href="http://robot.local:8420/incidents/1?&lt;b&gt;"' in page
    assert "/seen/" not in mail.as_string()
