"""kill -9 of those who put and of those who deliver, at moments left to chance: nothing that was promised is lost.

`python test_post_killed.py 300` does it so many times and prints what came of it (docs/alerts.md has the figures).
"""

import collections
import random
import signal
import subprocess
import sys
import tempfile
import time
from email import message_from_bytes
from pathlib import Path
from urllib.parse import unquote_plus

import pytest

pytest.importorskip("aiosmtpd.smtp", reason="needs python3-aiosmtpd")
from post_process import ENVELOPE, STALE
from push_server import serving
from real_smtp import RealSmtp

from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox

PROGRAM = str(Path(__file__).resolve().with_name("post_process.py"))


def start(*arguments):
    command = [sys.executable, PROGRAM, *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def kill(process):
    process.send_signal(signal.SIGKILL)
    said = process.stdout.read().split()
    process.wait()
    process.stdout.close()
    return said


def crash(folder, kills, rng, *push):
    """Kill by turns one who puts and one who delivers; returns what was promised, and what each channel has."""
    server, promised = RealSmtp(), []
    outbox, maildir = folder / "outbox", folder / "mail"
    deliverers = [start("deliver", outbox, maildir, server.port, *push) for _ in range(2)]  # one waits for its turn
    try:
        for i in range(kills):
            putter = start("put", outbox, f"p{i}")
            putter.stdout.readline()
            promised.append(f"p{i}-0")
            time.sleep(rng.uniform(0.0, 0.1))
            victim = rng.randrange(2)
            kill(deliverers[victim])
            deliverers[victim] = start("deliver", outbox, maildir, server.port, *push)
            promised += kill(putter)
        deadline = time.monotonic() + 60.0
        while Outbox(outbox).waiting() and time.monotonic() < deadline:
            time.sleep(0.05)
        left = Outbox(outbox).waiting()
    finally:
        for process in deliverers:
            kill(process)
        server.stop()
    mails = [message_from_bytes(data)["Message-ID"].strip("<>").split("@")[0] for _, _, data, _ in server.mails]
    files = [path.name.split(".P")[0] for path in (maildir / "new").iterdir()]
    return promised, left, mails, files


def check(promised, left, mails, files):
    """Nothing is lost; returns how many came twice by mail."""
    assert left == []
    assert len(set(promised)) == len(promised)
    assert set(promised) <= set(mails)
    assert set(promised) <= set(files)
    assert len(files) == len(set(files))  # a Maildir shows what lies there already
    for process in {name.split("-")[0] for name in mails}:  # in order, but for what came twice
        own = [int(name.split("-")[1]) for name in dict.fromkeys(mails) if name.split("-")[0] == process]
        assert own == sorted(own)
    return sum(count - 1 for count in collections.Counter(mails).values())


def test_kills_lose_nothing(tmp_path):
    promised, left, mails, files = crash(tmp_path, 4, random.Random(7))
    assert len(promised) >= 4
    assert check(promised, left, mails, files) <= 4  # at most the one that was under way


def test_kills_lose_nothing_on_its_way_to_a_phone(tmp_path):
    pytest.importorskip("apprise", reason="needs Apprise: scripts/bootstrap")
    with serving() as server:
        promised, left, mails, files = crash(tmp_path, 3, random.Random(8), server.port)
        check(promised, left, mails, files)
    said = [unquote_plus(path) + " ".join(headers.values()) for _, path, headers, _ in server.requests]
    bodies = [body.decode("utf-8", "replace") for *_, body in server.requests]
    for name in promised:
        assert any(name in each for each in (*said, *bodies)), name


def test_one_that_is_stopped_is_replaced_and_nothing_comes_twice_when_it_goes_on(tmp_path):
    server, outbox, maildir = RealSmtp(), tmp_path / "outbox", tmp_path / "mail"
    first = start("deliver", outbox, maildir, server.port)
    assert first.stdout.readline() == "delivers\n"
    second = start("deliver", outbox, maildir, server.port)
    try:
        first.send_signal(signal.SIGSTOP)
        for i in range(3):
            Outbox(outbox).put(Notice(id=f"n{i}", wall=1.79e9, kind="incident", subject="s", text="t"))
        wait_until(lambda: not Outbox(outbox).waiting(), STALE + 15.0)
        first.send_signal(signal.SIGCONT)
        Outbox(outbox).put(Notice(id="n3", wall=1.79e9, kind="incident", subject="s", text="t"))
        wait_until(lambda: not Outbox(outbox).waiting(), 10.0)
        time.sleep(0.5)
    finally:
        for process in (first, second):
            kill(process)
        server.stop()
    assert len(server.mails) == 4
    assert len(list((maildir / "new").iterdir())) == 4


def wait_until(is_so, seconds):
    deadline = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < deadline
        time.sleep(0.05)


if __name__ == "__main__":
    wanted, done, twice, notices = int(sys.argv[1]), 0, 0, 0
    while done < wanted:
        with tempfile.TemporaryDirectory() as place:
            outcome = crash(Path(place), min(20, wanted - done), random.Random(done))
        twice += check(*outcome)
        notices += len(outcome[0])
        done += min(20, wanted - done)
        print(f"{done} kills of one who delivers and {done} of one who puts: {notices} notices promised, none lost,"
              f" {twice} twice by mail (sender {ENVELOPE.sender})", flush=True)  # fmt: skip
