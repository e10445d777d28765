"""A notice that waits and is damaged on the disk is made again of its record, or told as lost."""

import logging
import os
from contextlib import suppress

import pytest
from post import Box, Time, channel, deliver_all, dispatcher

from rosbot_patrol.alerts.outbox.damaged_notices import replacement
from rosbot_patrol.alerts.outbox.incident_notices import incident_notice, verdict_notice
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox
from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.alerts.records.store import IncidentStore

ID = "20261121T010203Z-1"
SEEN = Incident(
    id=ID,
    wall=1_790_000_000.0,
    room_id=3,
    room_name="kitchen",
    phase="looking",
    object_class="person",
    probability=0.89,
    pictures=4,
    verdict="confirmed",
    reason="person seen in room 3 (kitchen)",
    confirmed=1_790_000_060.0,
)
JPEG = b"\xff\xd8 a picture"


def keep(folder, incident=SEEN, *, closed=True, picture=JPEG):
    with IncidentStore(folder, wall=1.79e9) as store:
        store.begin(incident)
        if picture:
            file = NewFile(name="seen.jpg", role="detection", data=picture)
            store.add_files(incident.id, [file])
        if closed:
            store.close(incident.id, wall=1.79e9 + 90.0)


@pytest.mark.parametrize("closed", [True, False])
def test_it_is_made_again_of_its_record(tmp_path, closed):
    keep(tmp_path, closed=closed)
    made = replacement(tmp_path, ID, 1.8e9)
    whole = incident_notice(SEEN, JPEG)
    assert (made.id, made.kind, made.wall, made.picture) == (ID, "incident", whole.wall, JPEG)
    assert made.text == whole.text
    assert "made again" in dict(made.facts)["Picture"] or "from the record" in dict(made.facts)["Picture"]


def test_a_verdict_is_made_again_too(tmp_path):
    clear = Incident(id=ID, wall=1.79e9, room_id=3, room_name="kitchen", verdict="unverified", reason="it was dark")
    keep(tmp_path, clear, picture=b"")
    assert replacement(tmp_path, f"{ID}-verdict", 1.8e9) == verdict_notice(clear)


def test_without_its_picture_it_says_so(tmp_path):
    keep(tmp_path)
    (tmp_path / "incidents" / ID / "seen.jpg").write_bytes(b"damaged too")
    made = replacement(tmp_path, ID, 1.8e9)
    assert made.picture is None
    assert "none" in dict(made.facts)["Picture"]


@pytest.mark.parametrize("state", ["no records", "no record", "nobody in the record", "a damaged record"])
def test_an_intruder_without_a_record_is_told_all_the_same_and_urgently(tmp_path, state):
    if state == "nobody in the record":
        keep(tmp_path, Incident(id=ID, wall=1.0, room_id=3, room_name="kitchen"))
    elif state != "no records":
        keep(tmp_path, Incident(id="other", wall=1.0, room_id=3, room_name="kitchen"))
    if state == "a damaged record":
        keep(tmp_path)
        (tmp_path / "incidents" / ID / "record.json").write_bytes(b"damaged" * 5000)
    made = replacement(tmp_path, ID, 1.8e9)
    assert (made.id, made.kind, made.is_urgent) == (ID, "incident", True)
    assert "Somebody was seen" in made.text
    assert "damaged" in made.text


@pytest.mark.parametrize("name", ["battery-1790000000.000", "20261121T010203Z-sensors4", f"{ID}-down-mail"])
def test_another_notice_is_told_as_lost(tmp_path, name):
    made = replacement(tmp_path, name, 1.8e9)
    assert (made.id, made.kind) == (name, "fault")
    assert name in made.text


def small():
    return Notice(
        id=ID, wall=1.0, kind="incident", subject="s", text="t", room_id=3, room_name="k", picture=b"\xff\xd8p"
    )


def test_no_single_bit_changes_what_a_notice_says():
    whole = small().to_bytes()
    wrong = []
    for i in range(len(whole)):
        for bit in range(8):
            with suppress(ValueError):
                found = Notice.from_bytes(bytes([*whole[:i], whole[i] ^ 1 << bit, *whole[i + 1 :]]))
                wrong += [(i, bit, found)] * (found != small())
    assert wrong == []


def test_no_cut_and_no_zeroes_make_another_notice():
    whole = small().to_bytes()
    for size in range(len(whole)):
        for data in (whole[:size], whole[:size] + bytes(len(whole) - size)):
            with pytest.raises(ValueError, match="notice"):
                Notice.from_bytes(data)


def test_a_notice_of_an_earlier_version_has_no_checksum():
    data = small().to_bytes()
    start = data.index(b',\n "check"')
    assert Notice.from_bytes(data[:start] + b"\n}") == small()


def harm(path, how):
    data = path.read_bytes()
    if how == "a folder":
        path.unlink()
        path.mkdir()
    else:
        later = data.replace(b'"format": 1', b'"format": 9')
        path.write_bytes({"emptied": b"", "cut": data[:50], "zeroes": bytes(len(data))}.get(how, later))


def mend(box, folder):
    """As the node's post does."""
    for name, notice_id in box.broken():
        box.put(replacement(folder, notice_id, 1.8e9))
        box.mended(name)


@pytest.mark.parametrize("how", ["emptied", "cut", "zeroes", "a folder", "a later version's"])
@pytest.mark.parametrize("is_read", [True, False])
def test_it_leaves_once_by_each_channel_that_did_not_take_it(tmp_path, how, is_read):
    keep(tmp_path)
    time, mail, phone = Time(), Box(), Box()
    phone.down = "no network"
    post = dispatcher(tmp_path / "outbox", channel("mail", mail), channel("phone", phone), time=time)
    post.outbox.put(incident_notice(SEEN, JPEG))
    post.take_over()
    deliver_all(post)
    (path,) = (tmp_path / "outbox").glob("*.notice")
    if not is_read:
        post.hand_over()
        post = dispatcher(tmp_path / "outbox", channel("mail", mail), channel("phone", phone))
    harm(path, how)
    phone.down, time.now = "", time.now + 10.0
    post.take_over()
    deliver_all(post)
    mend(post.outbox, tmp_path)
    deliver_all(post)
    mend(post.outbox, tmp_path)
    deliver_all(post)
    assert (mail.ids, phone.ids) == ([ID], [ID])
    assert phone.taken[0].picture == JPEG
    assert how == "a later version's" or list((tmp_path / "outbox").glob("*.broken-told"))
    assert post.outbox.broken() == []
    assert how == "a later version's" or Outbox(tmp_path / "outbox").broken() == []


def test_a_damaged_file_that_cannot_be_moved_is_made_good_for_all_the_same(tmp_path, monkeypatch):
    logging.disable(logging.CRITICAL)
    keep(tmp_path)
    box = Outbox(tmp_path / "outbox")
    box.put(incident_notice(SEEN, JPEG))
    (path,) = (tmp_path / "outbox").glob("*.notice")
    path.write_bytes(b"")
    monkeypatch.setattr(Outbox, "set_aside", lambda *_: os.rename("/nowhere/a", "/nowhere/b"))
    assert box.waiting() == []
    mend(box, tmp_path)
    assert [entry.id for entry in box.waiting()] == [ID]
    assert box.broken() == []
    logging.disable(logging.NOTSET)


def test_a_file_with_the_name_of_another_notice_is_damaged(tmp_path):
    box = Outbox(tmp_path)
    box.put(small())
    (path,) = tmp_path.glob("*.notice")
    path.rename(tmp_path / "000000000001-20261121T010203Z-9.notice")
    assert box.waiting() == []
    assert box.broken() == [("000000000001-20261121T010203Z-9.broken", "20261121T010203Z-9")]
