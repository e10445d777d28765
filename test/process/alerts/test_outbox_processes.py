"""The outbox among processes: a full disk, a kill at any point, several that put at once."""

import errno
import multiprocessing
import os
import subprocess
import sys

import pytest

from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox


def make(name, **given):
    return Notice(**{"id": name, "wall": 1.79e9, "kind": "incident", "subject": "s", "text": "t", **given})


def ids(outbox):
    return [entry.id for entry in outbox.waiting()]


FULL = """
import logging, sys
from pathlib import Path
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox
place = Path(sys.argv[1])
box = Outbox(place / "outbox")
import rosbot_patrol.alerts.outbox.outbox as module
module.RESERVE = 300_000
box.tidy()
with (place / "filler").open("wb", buffering=0) as file:
    try:
        while True:
            file.write(b"x" * 4096)
    except OSError as err:
        print("full:", err.errno)
count = 0
try:
    for i in range(100):
        box.put(Notice(id=f"n{i}", wall=1.0, kind="incident", subject="s", text="t", picture=b"p" * 30_000))
        count += 1
except OSError as err:
    print("refused:", err.errno)
print("kept:", count, "read:", sum(len(box.read(e).picture) == 30_000 for e in Outbox(place / "outbox").waiting()))
(place / "filler").unlink()
print("again:", box.put(Notice(id="late", wall=1.0, kind="incident", subject="s", text="t")))
"""


def test_a_really_full_disk(tmp_path):
    """A file system of 3 MB, filled to the last block: what was promised is there whole, the rest is refused."""
    mount = f'mount -t tmpfs -o size=3m none {tmp_path} && exec {sys.executable} -c "$1" {tmp_path}'
    done = subprocess.run(
        ["unshare", "-rm", "sh", "-c", mount, "sh", FULL], capture_output=True, text=True, check=False
    )
    if "unshare" in done.stderr or "mount" in done.stderr:
        pytest.skip(f"no file system of its own can be made here: {done.stderr.strip()}")
    said = dict(line.split(":", 1) for line in done.stdout.splitlines())
    assert said["full"] == said["refused"] == f" {errno.ENOSPC}", done.stdout + done.stderr
    kept = int(said["kept"].split()[0])
    assert kept >= 3
    assert f"read: {kept}" in said["kept"]
    assert said["again"] == " True"


KILLED = """
import os, sys
from pathlib import Path
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox
if sys.argv[2] == "write":
    os.fsync = lambda handle: os._exit(9)
box = Outbox(Path(sys.argv[1]))
box.put(Notice(id="a", wall=1.0, kind="incident", subject="s", text="x" * 100000))
os._exit(9)
"""


@pytest.mark.parametrize(("point", "kept"), [("write", 0), ("after", 1)])
def test_a_kill_at_any_point_leaves_a_whole_notice_or_none(tmp_path, point, kept):
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path), point], check=False)
    assert done.returncode == 9
    outbox = Outbox(tmp_path)
    assert len(ids(outbox)) == kept
    for scratch in tmp_path.glob(".*.tmp"):
        os.utime(scratch, (0, 0))
    outbox.tidy()
    assert not list(tmp_path.glob(".*"))


def put_many(folder, name, count):
    outbox = Outbox(folder)
    for i in range(count):
        outbox.put(make(f"{name}-{i}"))


def test_several_processes_put_at_once(tmp_path):
    context = multiprocessing.get_context("fork")
    workers = [context.Process(target=put_many, args=(tmp_path, name, 40)) for name in "abc"]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    found = ids(Outbox(tmp_path))
    assert len(found) == 120
    for name in "abc":
        own = [int(i.split("-")[1]) for i in found if i.startswith(name)]
        assert own == sorted(own)
