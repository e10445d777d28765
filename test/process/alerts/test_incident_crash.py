"""kill -9 at any moment: what a call had written is there, the chain fits, and the next start goes on."""

import random
import subprocess
import sys
import time

from rosbot_patrol.alerts.records.opening import open_store
from rosbot_patrol.alerts.records.repair import close_abandoned, repair
from rosbot_patrol.alerts.records.verify import verify

KILLS = 15

WRITER = """
import itertools, sys
from pathlib import Path
from rosbot_patrol.alerts.records.incident import Event, Incident
from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.repair import close_abandoned, repair
from rosbot_patrol.alerts.records.opening import open_store

def say(*words):
    print(*words, flush=True)

store, said = open_store(Path(sys.argv[1]), wall=1.0)
assert not said, said
repair(store, wall=1.0)
close_abandoned(store, [], wall=1.0)
say("ready")
for i in itertools.count():
    name = f"r{sys.argv[2]}-{i}"
    store.begin(Incident(id=name, wall=float(i), room_id=1, room_name="hall"))
    say("begun", name)
    store.record(name, add=[Event(wall=1.0, kind="note", text="one")])
    say("event", name)
    store.add_files(name, [NewFile(name=f"{k}.jpg", role="look", data=bytes([k]) * 20000) for k in range(3)])
    say("files", name)
    store.close(name, wall=2.0, verdict="clear")
    say("closed", name)
    if i % 3 == 2:
        store.amend(f"r{sys.argv[2]}-{i - 1}", wall=3.0, text="added")
        store.remove(f"r{sys.argv[2]}-{i - 2}", wall=3.0, why="test")
        say("removed", f"r{sys.argv[2]}-{i - 2}")
"""


def write_and_kill(folder, number, seconds):
    """What a writer had said when it was killed."""
    command = [sys.executable, "-c", WRITER, str(folder), str(number)]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    lines = [child.stdout.readline()]
    time.sleep(seconds)
    child.kill()
    lines += child.stdout.readlines()
    child.wait()
    assert lines[0] == "ready\n"
    return [tuple(line.split()) for line in lines[1:] if line.endswith("\n")]


def test_a_kill_at_any_moment_leaves_incidents_that_verify(quick_disk):
    dice = random.Random(7)
    said = []
    for number in range(KILLS):
        said += write_and_kill(quick_disk, number, dice.uniform(0.0, 0.05))
        store, complaints = open_store(quick_disk, wall=1.0)
        assert complaints == []
        done = verify(store)
        assert done.fits, done.problems
        repair(store, wall=1.0)
        _check_all_is_there(store, said)
        store.close_index()
    store, _ = open_store(quick_disk, wall=1.0)
    close_abandoned(store, [], wall=1.0)
    done = verify(store)
    assert done.fits, done.problems
    assert done.open == 0
    assert done.records > 0
    assert {name for what, name in said if what == "closed"}


def _check_all_is_there(store, said):
    removed = {name for what, name in said if what == "removed"}
    for what, name in said:
        kept = store.get(name)
        if name in removed:
            assert kept is None
            assert not store.folder.path(name).exists()
        elif kept is not None:  # None: it was being removed when the kill came
            assert what != "closed" or kept.verdict == "clear"
            assert what != "event" or kept.events[0].text == "one"
            assert what != "files" or len(kept.files) == 3
        else:
            assert ("closed", name) in said
