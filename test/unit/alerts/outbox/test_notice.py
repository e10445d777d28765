import json

import pytest

from rosbot_patrol.alerts.outbox.notice import Notice


def make(**given):
    values = {"id": "20261121T010203Z-1", "wall": 1_790_000_000.25, "kind": "incident", "subject": "s", "text": "t"}
    return Notice(**{**values, **given})


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"room_id": 3, "room_name": "Küche – 台所 🚪", "verdict": "confirmed", "incident": "i-1"},
        {"picture": bytes(range(256)), "picture_name": "room3.jpg"},
        {"picture": b""},
        {"facts": (("Room", "3"), ("Why", "a\nb")), "channels": ("mail", "phone")},
        {"link": "http://robot.local:8420/incidents/1", "seen_link": "http://robot.local:8420/seen/1/abc"},
        {"text": "lone \udcff surrogate, \0 and \u2028"},
    ],
)
def test_a_notice_comes_back_from_disk_as_it_was(given):
    notice = make(**given)
    data = notice.to_bytes()
    assert Notice.from_bytes(data) == notice
    data.decode("ascii")


@pytest.mark.parametrize("name", ["", "../x", "a b", "a\n", ".hidden", "-rf", "x" * 151, "ü"])
def test_an_id_that_is_no_file_name_is_refused(name):
    with pytest.raises(ValueError, match="is no id of a notice"):
        make(id=name)


@pytest.mark.parametrize("data", [b"", b"\0\xff", b"[]", b"{}", b'{"format": 1}', b'{"format": "1"}', b"[" * 100_000])
def test_what_is_no_notice_is_said(data):
    with pytest.raises(ValueError, match="is no notice"):
        Notice.from_bytes(data)


@pytest.mark.parametrize(("key", "value"), [("subject", 3), ("wall", "soon"), ("facts", [1]), ("picture", "%")])
def test_a_field_of_the_wrong_kind_is_said(key, value):
    tree = json.loads(make().to_bytes()) | {key: value}
    with pytest.raises(ValueError, match="is no notice"):
        Notice.from_bytes(json.dumps(tree).encode())


def test_a_newer_format_is_said():
    tree = json.loads(make().to_bytes()) | {"format": 2}
    with pytest.raises(ValueError, match="is of format 2, this version knows up to 1"):
        Notice.from_bytes(json.dumps(tree).encode())


def test_every_cut_of_the_file_is_noticed():
    data = make(picture=b"\xff\xd8 picture").to_bytes()
    for length in range(len(data) - 1):
        with pytest.raises(ValueError, match="is no notice"):
            Notice.from_bytes(data[:length])
