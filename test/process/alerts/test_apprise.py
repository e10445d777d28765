"""Notices by Apprise before real local servers: ntfy's protocol, a JSON service, and some that do not want them."""

from __future__ import annotations

import json
import socket
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote_plus

import pytest

pytest.importorskip("apprise", reason="needs Apprise: scripts/bootstrap")

from push_server import serving

from rosbot_patrol.alerts.channels.channel import DeliveryError
from rosbot_patrol.alerts.channels.config import Surroundings, load_channels
from rosbot_patrol.alerts.channels.short_text import body_of, title_of
from rosbot_patrol.alerts.channels.transports.apprise import AppriseTransport
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.errors import ParamError

TOPIC = "a-topic-nobody-guesses"
NOTICE = Notice(
    id="20261129T050000Z-1",
    wall=1_795_924_800.0,
    kind="incident",
    subject="Person in corridor hall, 06:00",
    text="Person seen in room 5 (corridor hall).",
    facts=(("Room", "5 (corridor hall)"), ("Seen", "person, probability 0.87, in 4 pictures"), ("Why", "person seen")),
    room_id=5,
    room_name="corridor hall",
    picture=b"\xff\xd8\xff\xe0 a picture \xff\xd9",
    picture_name="room5.jpg",
)


def test_ntfy_gets_title_reason_and_picture() -> None:
    with serving() as server:
        transport = AppriseTransport(f"ntfy://127.0.0.1:{server.port}/{TOPIC}", "push", 5.0)
        where = transport.send(NOTICE)
    assert where == "the service ntfy of the channel 'push'"
    sent = b"".join(body for *_, body in server.requests)
    headers = {key.lower(): value for _, _, each, _ in server.requests for key, value in each.items()}
    said = unquote_plus(" ".join(path for _, path, *_ in server.requests)) + f"{headers} {sent!r}"
    assert "Person in corridor hall" in said
    assert "Person seen" in said
    assert b" a picture " in sent
    assert any(TOPIC in path or TOPIC.encode() in body for _, path, _, body in server.requests)


def test_ntfy_opens_the_page_and_has_a_button_that_marks_it_as_seen() -> None:
    links = {"link": "http://robot.local:8420/incidents/1", "seen_link": "http://robot.local:8420/seen/1/abc"}
    with serving() as server:
        AppriseTransport(f"ntfy://127.0.0.1:{server.port}/{TOPIC}", "push", 5.0).send(replace(NOTICE, **links))
    headers = {key.lower(): value for _, _, each, _ in server.requests for key, value in each.items()}
    said = unquote_plus(" ".join(path for _, path, *_ in server.requests)) + f"{headers}"
    assert headers.get("x-click") == links["link"]
    assert headers.get("x-actions") == f"http, Seen, {links['seen_link']}, method=POST, clear=true"
    assert links["link"] in said


def test_mail_by_apprise_reaches_a_server_of_mail() -> None:
    pytest.importorskip("aiosmtpd.smtp", reason="needs python3-aiosmtpd")
    from real_smtp import RealSmtp

    server = RealSmtp()
    try:
        url = f"mailto://127.0.0.1:{server.port}?from=robot@example.org&to=owner@example.org&mode=insecure"
        AppriseTransport(url, "push", 5.0).send(replace(NOTICE, link="http://robot.local:8420/incidents/1"))
    finally:
        server.stop()
    ((_, to, data, _),) = server.mails
    assert to == ["owner@example.org"]
    assert b"Person in corridor hall" in data
    assert b"http://robot.local:8420/incidents/1" in data


def test_a_json_service_gets_it_and_a_notice_without_a_picture() -> None:
    with serving() as server:
        transport = AppriseTransport(f"json://127.0.0.1:{server.port}/hook/{TOPIC}", "push", 5.0, with_picture=False)
        transport.send(NOTICE)
    ((_, _, _, body),) = server.requests
    tree = json.loads(body)
    assert tree["title"] == "Person in corridor hall, 06:00"
    assert tree["attachments"] == []


@pytest.mark.parametrize("status", [403, 500])
def test_a_refusal_is_told_without_the_address(status: int) -> None:
    with serving(status) as server:
        transport = AppriseTransport(f"ntfy://ada:secret-word@127.0.0.1:{server.port}/{TOPIC}", "push", 2.0)
        with pytest.raises(DeliveryError) as refused:
            transport.send(NOTICE)
    assert "the service ntfy of the channel 'push' did not take it: " in str(refused.value)
    assert TOPIC not in str(refused.value)
    assert "secret-word" not in str(refused.value)
    assert refused.value.answered
    assert not refused.value.permanent


def test_a_server_that_is_gone_or_silent_ends() -> None:
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        port = silent.getsockname()[1]
        with pytest.raises(DeliveryError):
            AppriseTransport(f"ntfy://127.0.0.1:{port}/{TOPIC}", "push", 0.5).send(NOTICE)
        silent.listen()
        with pytest.raises(DeliveryError) as failed:
            AppriseTransport(f"ntfy://127.0.0.1:{port}/{TOPIC}", "push", 0.5).send(NOTICE)
    assert TOPIC not in str(failed.value)


def written(folder: Path, url: str, mode: int = 0o600) -> Path:
    secret = folder / "push_url"
    secret.write_text(url + "\n", encoding="utf-8")
    secret.chmod(mode)
    path = folder / "channels.yaml"
    path.write_text(f"channels:\n  push:\n    type: apprise\n    url_file: {secret}\n", encoding="utf-8")
    return path


def test_a_channel_of_the_file(tmp_path: Path) -> None:
    around = Surroundings(home=tmp_path, environ={})
    (channel,) = load_channels(written(tmp_path, f"ntfys://ntfy.example.org/{TOPIC}"), around)
    assert channel.name == "push"
    assert TOPIC not in channel.transport.describe()


@pytest.mark.parametrize(
    ("url", "mode", "said"),
    [
        (f"nonsense://{TOPIC}", 0o600, "channels/push/url_file: holds no address that Apprise knows"),
        ("", 0o600, "channels/push/url_file: .* is empty"),
        (f"ntfy://localhost/{TOPIC}", 0o644, "channels/push/url_file: .* can be read by others, expected mode 600"),
    ],
)
def test_what_cannot_be_used_is_told_without_the_address(tmp_path: Path, url: str, mode: int, said: str) -> None:
    with pytest.raises(ParamError, match=said) as refused:
        load_channels(written(tmp_path, url, mode), Surroundings(home=tmp_path, environ={}))
    assert TOPIC not in str(refused.value)


def test_titles_say_what_and_where_first() -> None:
    assert title_of(NOTICE) == "Person in corridor hall, 06:00"
    assert body_of(NOTICE) == "Person seen\nPerson, probability 0.87, in 4 pictures"
    fault = Notice(id="1", wall=0.0, kind="fault", subject="the battery\nis low", text="Charge it.")
    assert (title_of(fault), body_of(fault)) == ("the battery is low", "Charge it.")
