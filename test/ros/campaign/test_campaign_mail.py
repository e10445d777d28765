"""The campaign's mail server against a real client."""

from __future__ import annotations

import smtplib
from email.message import EmailMessage
from pathlib import Path

import pytest

pytest.importorskip("rosbot_patrol.msg", reason="the workspace is not on the path: `. scripts/env`")
from rosbot_patrol.campaign.crash_ledger import KeptMail
from rosbot_patrol.ros.campaign.mail_sink import INCIDENT, MailSink, kept_mails


def test_every_mail_is_kept_as_often_as_it_came(tmp_path: Path) -> None:
    mail = EmailMessage()
    mail["From"], mail["To"], mail["Message-ID"], mail[INCIDENT] = "a@x", "b@x", "<1@x>", "20260101-1"
    mail.set_content("first\n.\n..last\n")
    sink = MailSink(tmp_path / "smtp")
    with smtplib.SMTP("localhost", sink.port) as client:
        client.send_message(mail)
        client.send_message(mail)
    sink.stop()
    again = MailSink(tmp_path / "smtp")
    with smtplib.SMTP("localhost", again.port) as client:
        del mail[INCIDENT]
        client.send_message(mail)
    again.stop()
    kept = kept_mails([tmp_path / "smtp", tmp_path / "nothing"])
    assert kept == [KeptMail(message_id="<1@x>", incident="20260101-1")] * 2
    assert len(list((tmp_path / "smtp").iterdir())) == 3
    assert b"first\r\n.\r\n..last" in (tmp_path / "smtp" / "000001.eml").read_bytes()
