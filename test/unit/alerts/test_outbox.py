import os
import subprocess
import sys

import pytest

from rosbot_patrol.alerts.mail import build_mail
from rosbot_patrol.alerts.outbox import Outbox
from rosbot_patrol.alerts.wording import incident_notice


@pytest.fixture
def put(make_incident, envelope):
    def put(outbox, *names):
        for name in names:
            outbox.put(name, build_mail(incident_notice(make_incident(id=name), b"picture"), envelope))

    return put


def drain(outbox, now=0.0):
    sent = []
    while entry := outbox.due(now):
        sent.append(entry.id)
        outbox.delivered(entry, now)
    return sent


def test_mails_leave_in_order_and_are_gone_then(tmp_path, put):
    outbox = Outbox(tmp_path / "out", interval=0.0)
    put(outbox, "b", "a", "c")
    assert drain(outbox) == ["b", "a", "c"]
    assert list(tmp_path.glob("out/*.eml")) == []
    assert outbox.wait(0.0) is None


def test_they_survive_the_program_in_order(tmp_path, put):
    put(Outbox(tmp_path), "b", "a")
    again = Outbox(tmp_path, interval=0.0)
    put(again, "c")
    assert drain(again) == ["b", "a", "c"]


def test_the_same_incident_waits_once(tmp_path, put):
    outbox = Outbox(tmp_path)
    put(outbox, "a", "a")
    assert len(outbox) == 1
    assert len(Outbox(tmp_path)) == 1


def test_what_was_delivered_does_not_wait_again(tmp_path, put):
    outbox = Outbox(tmp_path, interval=0.0)
    put(outbox, "a", "b")
    assert drain(outbox) == ["a", "b"]
    again = Outbox(tmp_path, interval=0.0)
    put(again, "a", "c")
    assert drain(again) == ["c"]
    assert [path.name[-5:] for path in sorted((tmp_path / "sent").iterdir())] == ["a.eml", "b.eml", "c.eml"]


def test_only_the_last_delivered_are_kept(tmp_path, put):
    outbox = Outbox(tmp_path, interval=0.0, keep=2)
    put(outbox, "a", "b", "c")
    drain(outbox)
    assert [path.name for path in sorted((tmp_path / "sent").iterdir())] == [
        "000000000002-b.eml",
        "000000000003-c.eml",
    ]


def test_the_interval_delays_and_never_drops(tmp_path, put):
    outbox = Outbox(tmp_path, interval=10.0)
    put(outbox, "a", "b")
    first = outbox.due(100.0)  # at once, however lately the program began
    outbox.delivered(first, 100.0)
    assert outbox.due(109.0) is None
    assert outbox.wait(109.0) == pytest.approx(1.0)
    assert outbox.due(110.0).id == "b"


def test_a_transport_that_is_down_is_tried_ever_more_seldom_and_keeps_the_order(tmp_path, put):
    outbox = Outbox(tmp_path, interval=0.0, first_delay=5.0, max_delay=60.0)
    put(outbox, "a", "b")
    now, delays = 0.0, []
    for _ in range(7):
        delays.append(outbox.failed(outbox.due(now), now))
        assert outbox.due(now + delays[-1] - 0.01) is None
        now += delays[-1]
        assert outbox.due(now).id == "a"
    assert delays == [5, 10, 20, 40, 60, 60, 60]
    assert drain(outbox, now) == ["a", "b"]


def test_a_mail_refused_for_good_lets_the_others_pass_and_stays(tmp_path, put):
    outbox = Outbox(tmp_path, interval=0.0)
    put(outbox, "bad", "good")
    outbox.failed(outbox.due(0.0), 0.0, permanent=True)
    assert drain(outbox, 1.0) == ["good"]
    assert outbox.due(5.0).id == "bad"
    assert len(Outbox(tmp_path)) == 1


def test_what_is_kept_is_the_mail(tmp_path, put):
    outbox = Outbox(tmp_path)
    put(outbox, "a")
    mail = Outbox(tmp_path).due(0.0).mail()
    assert mail["Subject"] == "rosbot patrol node"
    (picture,) = mail.iter_attachments()
    assert picture.get_content() == b"picture"


@pytest.mark.parametrize("content", [b"", b"\x00\xff garbage", b"no mail"])
def test_a_file_that_is_no_mail_is_set_aside(tmp_path, put, content):
    (tmp_path / "000000000001-x.eml").write_bytes(content)
    outbox = Outbox(tmp_path, interval=0.0)
    put(outbox, "a")
    entry = outbox.due(0.0)
    with pytest.raises(ValueError, match="is no mail"):
        entry.mail()
    assert outbox.set_aside(entry).read_bytes() == content
    assert drain(outbox) == ["a"]
    assert len(Outbox(tmp_path)) == 0


def test_strange_names_are_left_alone(tmp_path, caplog):
    (tmp_path / "notes.eml").write_text("mine")
    assert len(Outbox(tmp_path)) == 0
    assert (tmp_path / "notes.eml").exists()
    assert "left alone" in caplog.text


def test_an_id_that_is_no_file_name_is_refused(tmp_path, put):
    with pytest.raises(ValueError, match="is no id"):
        put(Outbox(tmp_path), "../escape")


def test_a_disk_that_does_not_take_it_leaves_no_half_file(tmp_path, put, monkeypatch):
    outbox = Outbox(tmp_path)
    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", lambda _: (_ for _ in ()).throw(OSError(28, "No space left on device")))
        with pytest.raises(OSError, match="No space left"):
            put(outbox, "a")
    assert [path.name for path in tmp_path.iterdir()] == ["sent"]
    put(outbox, "a")
    assert len(outbox) == 1


KILLED = """
import os, sys
from pathlib import Path
from email.message import EmailMessage
from rosbot_patrol.alerts.outbox import Outbox
mail = EmailMessage()
mail["From"], mail["Message-ID"] = "a@b.org", "<1@b.org>"
mail.set_content("x" * 100000)
point = sys.argv[2]
real = os.fsync
if point == "write":
    os.fsync = lambda handle: os._exit(9)
box = Outbox(Path(sys.argv[1]), interval=0.0)
box.put("a", mail)
if point == "sent":
    box.due(0.0)
    os._exit(9)
"""


@pytest.mark.parametrize(("point", "kept"), [("write", 0), ("sent", 1)])
def test_a_kill_at_any_point_leaves_a_whole_mail_or_none(tmp_path, point, kept):
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path), point], check=False)
    assert done.returncode == 9
    outbox = Outbox(tmp_path)
    assert len(outbox) == kept
    assert not list(tmp_path.glob(".*"))
    if kept:
        assert outbox.due(0.0).mail().get_content().strip() == "x" * 100000
