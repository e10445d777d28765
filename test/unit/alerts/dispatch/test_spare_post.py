"""Notices that the disk does not take: sent from memory, written later, never twice."""

import errno
import shutil
import threading

import pytest
from post import Box, Time, channel, deliver_all, dispatcher, notice, send_all, settle, spare

from rosbot_patrol.alerts.channels.mail import make_envelope
from rosbot_patrol.alerts.channels.transports.maildir import MaildirTransport
from rosbot_patrol.alerts.outbox.outbox import Outbox
from rosbot_patrol.alerts.outbox.receipts import Receipts


def test_it_leaves_by_every_channel_at_once(tmp_path):
    mail, phone = Box(), Box()
    post = spare(channel("mail", mail), channel("phone", phone))
    assert post.put(notice("a"))
    assert not post.put(notice("a"))
    first, _ = send_all(post, "mail", "phone")
    assert first.text == "notice a delivered by box: in the box"
    assert (mail.ids, phone.ids) == (["a"], ["a"])
    assert post.statuses() == []
    assert post.find("a") == notice("a")


def test_it_is_tried_as_long_as_the_process_lives(tmp_path):
    time, mail = Time(), Box()
    mail.down = "no network"
    post = spare(channel("mail", mail), time=time)
    post.put(notice("a"))
    for _ in range(200):
        send_all(post, "mail")
        time.now += 60.0
    (status,) = post.statuses()
    assert (status.waiting, status.error) == (1, "no network")
    mail.down = ""
    post.nudge()
    send_all(post, "mail")
    assert mail.ids == ["a"]


def test_what_one_channel_took_goes_to_the_others_only_when_the_disk_is_back(tmp_path):
    mail, phone = Box(), Box()
    phone.down = "no network"
    post = spare(channel("mail", mail), channel("phone", phone))
    for name in ("a", "b"):
        post.put(notice(name))
    send_all(post, "mail", "phone")
    assert settle(post, tmp_path)
    assert post.find("a") is None
    phone.down = ""
    disk = dispatcher(tmp_path, channel("mail", mail), channel("phone", phone))
    disk.take_over()
    deliver_all(disk)
    assert (mail.ids, phone.ids) == (["a", "b"], ["a", "b"])
    assert send_all(post, "mail", "phone") == []
    assert disk.outbox.waiting() == []
    assert Outbox(tmp_path).has("a")  # so that the same mission gives no second notice


def test_another_program_that_delivers_meanwhile_sends_nothing_twice(tmp_path):
    """The receipts come before the notice, and who delivers reads them after it looked at the folder."""
    mail = Box()
    disk = dispatcher(tmp_path, channel("mail", mail))
    disk.take_over()
    post = spare(channel("mail", mail))
    post.put(notice("a"))
    send_all(post, "mail")
    real, seen = Outbox.waiting, []

    def slow(self):
        if not seen:
            seen.append(settle(post, tmp_path))
        return real(self)

    disk.outbox.waiting = lambda: slow(disk.outbox)
    deliver_all(disk)
    assert seen == [True]
    assert mail.ids == ["a"]


def test_a_channel_that_is_busy_is_waited_for(tmp_path):
    mail, may_go, is_sending = Box(), threading.Event(), threading.Event()

    class Slow(Box):
        def send(self, told):
            is_sending.set()
            may_go.wait(5.0)
            return super().send(told)

    slow = Slow()
    post = spare(channel("mail", mail), channel("slow", slow))
    post.put(notice("a"))
    thread = threading.Thread(target=lambda: send_all(post, "slow"))
    thread.start()
    is_sending.wait(5.0)
    assert not settle(post, tmp_path)  # nobody knows whether it takes it
    assert not list(tmp_path.glob("*.notice"))
    may_go.set()
    thread.join()
    assert settle(post, tmp_path)
    disk = dispatcher(tmp_path, channel("mail", mail), channel("slow", slow))
    disk.take_over()
    deliver_all(disk)
    assert (mail.ids, slow.ids) == (["a"], ["a"])


@pytest.mark.parametrize("where", ["receipts", "notice"])
def test_a_disk_that_fails_again_in_the_midst_loses_and_doubles_nothing(tmp_path, where, monkeypatch):
    mail, phone = Box(), Box()
    phone.down = "no network"
    post = spare(channel("mail", mail), channel("phone", phone))
    post.put(notice("a"))
    send_all(post, "mail", "phone")

    def fail(*_):
        raise OSError(errno.EIO, "Input/output error")

    with monkeypatch.context() as patched:
        patched.setattr(*((Receipts, "add") if where == "receipts" else (Outbox, "put")), fail)
        for _ in range(3):
            with pytest.raises(OSError, match="Input/output"):
                settle(post, tmp_path)
    assert post.find("a") is not None
    assert settle(post, tmp_path)
    assert (tmp_path / "taken.jsonl").read_text().count("\n") == 1
    phone.down = ""
    disk = dispatcher(tmp_path, channel("mail", mail), channel("phone", phone))
    disk.take_over()
    deliver_all(disk)
    assert (mail.ids, phone.ids) == (["a"], ["a"])


def test_a_maildir_on_the_disk_that_is_gone_holds_up_no_other_channel(tmp_path):
    (tmp_path / "disk").write_text("a file")
    time, phone = Time(), Box()
    maildir = MaildirTransport(tmp_path / "disk" / "mail", make_envelope("me@example.org", ""))
    post = spare(channel("mail", maildir), channel("phone", phone), time=time)
    post.put(notice("a"))
    (refused, taken) = send_all(post, "mail", "phone")
    assert (refused.delivered, refused.permanent, taken.delivered) == (False, False, True)
    assert phone.ids == ["a"]
    (tmp_path / "disk").unlink()
    time.now += 10.0
    (late,) = send_all(post, "mail")
    assert late.delivered


def test_a_storm_becomes_a_digest_and_an_intruder_does_not_wait(tmp_path):
    mail = Box()
    post = spare(channel("mail", mail, interval=10.0))
    for number in range(5):
        post.put(notice(f"s{number}", kind="sensor"))
    post.put(notice("a"))
    send_all(post, "mail")
    assert [n.kind for n in mail.taken] == ["digest", "incident"]


def test_a_folder_that_is_removed_is_made_again(tmp_path):
    mail, box = Box(), tmp_path / "outbox"
    post = dispatcher(box, channel("mail", mail))
    post.outbox.put(notice("a"))
    post.take_over()
    deliver_all(post)
    shutil.rmtree(box)
    assert post.outbox.put(notice("b"))
    for _ in range(2):  # the lock went with it
        post.take_over()
    deliver_all(post)
    assert mail.ids == ["a", "b"]


def test_a_notice_that_is_there_though_its_folder_cannot_be_synced_counts_as_put(tmp_path, monkeypatch, caplog):
    box = Outbox(tmp_path)

    def fail(_):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr("rosbot_patrol.files.sync_folder", fail)
    assert box.put(notice("a"))
    assert [entry.id for entry in box.waiting()] == ["a"]
    assert "may not outlive a power cut" in caplog.text
