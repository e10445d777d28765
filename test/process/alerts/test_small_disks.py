"""Notices on a real disk of 1 MB that fills or becomes read-only."""

import subprocess

import pytest
from post import Box, channel, deliver_all, dispatcher, notice, send_all, settle, spare

from rosbot_patrol.alerts.outbox.outbox import Outbox


@pytest.fixture
def disk(tmp_path):
    folder = tmp_path / "disk"
    folder.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "none", folder], capture_output=True).returncode:
        pytest.skip("needs the right to mount a small disk")
    yield folder
    subprocess.run(["umount", "-l", folder], check=True)


def read_only(folder, way="ro"):
    subprocess.run(["mount", "-o", f"remount,{way}", folder], check=True)


def test_a_disk_that_becomes_read_only_still_gives_what_waits_on_it_once(disk, tmp_path):
    """Who has the lock delivers; who starts then takes the lock for reading; nobody else does."""
    mail, box = Box(), disk / "outbox"
    first = dispatcher(box, channel("mail", mail))
    first.outbox.put(notice("a"))
    first.take_over()
    first.hand_over()
    read_only(disk)
    later, other = (dispatcher(box, channel("mail", mail)) for _ in range(2))
    assert later.take_over()
    assert not other.take_over()
    assert later.deliver("mail").delivered
    with pytest.raises(OSError, match="Read-only"):
        later.refresh()
    assert later.deliver("mail") is None
    with pytest.raises(OSError, match="Read-only"):
        later.outbox.put(notice("b"))
    later.hand_over()
    read_only(disk, "rw")


def test_a_notice_on_a_read_only_disk_is_not_sent_again_when_it_is_looked_at_again(disk):
    mail, box = Box(), disk / "outbox"
    post = dispatcher(box, channel("mail", mail))
    for name in ("a", "b", "c"):
        post.outbox.put(notice(name))
    post.take_over()
    post.hand_over()
    read_only(disk)
    post.take_over()
    while post.deliver("mail") is not None:
        with pytest.raises(OSError, match="Read-only"):
            post.refresh()
    assert mail.ids == ["a", "b", "c"]
    post.hand_over()
    read_only(disk, "rw")
    post.take_over()  # it knows what was taken, as the same process
    deliver_all(post)
    assert mail.ids == ["a", "b", "c"]
    post.hand_over()


def fill(path):
    with path.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))


def test_a_full_disk_with_no_reserve_sends_from_memory_and_keeps_it_when_there_is_room(disk):
    mail, box = Box(), Outbox(disk / "outbox")
    box.make()
    with pytest.raises(OSError, match="No space"):
        fill(disk / "filler")
    with pytest.raises(OSError, match="No space"):
        box.probe()
    post = spare(channel("mail", mail))
    with pytest.raises(OSError, match="No space"):
        box.put(notice("a", picture=bytes(100_000)))
    post.put(notice("a", picture=bytes(100_000)))
    send_all(post, "mail")
    with pytest.raises(OSError, match="No space"):
        settle(post, disk / "outbox")
    (disk / "filler").unlink()
    assert settle(post, disk / "outbox")
    box.probe()
    assert mail.ids == ["a"]
