"""A bug report tells what is needed, and no secrets."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import pytest

from rosbot_patrol.console.live.bug_report import mask, read_secrets, report_zip


@pytest.mark.parametrize(
    ("text", "masked"),
    [
        ("smtp_password_file: ~/.config/secret", "smtp_password_file: ~/.config/secret"),
        ("password: swordfish", "password: ***"),
        ("{user: ada, port: 25}", "{user: ***, port: 25}"),
        ("email_to: ada@example.org, bob@example.org", "email_to: ***, ***"),
        ("sent to ada@example.org by smtp", "sent to *** by smtp"),
        ("url: https://hass.example.org/api/webhook/x", "url: ***"),
        ('"token": "abc def"', '"token": ***'),
        ("rtsp://ada:swordfish@cam/1", "rtsp://***@cam/1"),
        ("ntfys://ntfy.sh/topic-x", "ntfys://ntfy.sh/***"),
        ("email_to: ''", "email_to: ''"),
        ("console/url: http://localhost:8420", "console/url: http://localhost:8420"),
        ("the robot drives to room 5", "the robot drives to room 5"),
        ("tokens 5", "tokens 5"),
    ],
)
def test_secrets_are_taken_out_and_nothing_else(text: str, masked: str) -> None:
    assert mask(text, ["topic-x", "abc"]) == masked


def test_a_report_lists_what_it_holds(tmp_path: Path) -> None:
    folder = tmp_path / "secrets"
    folder.mkdir()
    (folder / "phone").write_text("ntfys://ntfy.sh/topic-x\n")
    data = report_zip({"logs/a.log": "sent by ntfys://ntfy.sh/topic-x", "b.txt": "Ada was here"}, [
        *read_secrets(folder), "Ada!",
    ])  # fmt: skip
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert sorted(archive.namelist()) == ["README.txt", "b.txt", "logs/a.log"]
        assert archive.read("logs/a.log") == b"sent by ***"
        assert b"logs/a.log" in archive.read("README.txt")


def test_no_folder_holds_no_secrets(tmp_path: Path) -> None:
    assert read_secrets(tmp_path / "none") == []
