import json

import pytest

from rosbot_patrol.patrol.mission.resume import PatrolStore

MEMORY = {"count": 2, "queue": [3], "mission": None, "last_verdict": ""}


def test_the_same_run_goes_on(tmp_path):
    store = PatrolStore(tmp_path / "sub" / "patrol.json", "run")
    store.note_latched("/rostopic_1", 4)
    store.save(MEMORY)
    again = PatrolStore(tmp_path / "sub" / "patrol.json", "run")
    assert again.memory == MEMORY
    assert again.is_handled("/rostopic_1", 4)
    assert not again.is_handled("/rostopic_1", 5)
    assert not again.is_handled("/rostopic_2", 4)


def test_another_run_goes_on_too_but_its_latched_triggers_are_new(tmp_path):
    store = PatrolStore(tmp_path / "p.json", "one")
    store.note_latched("/rostopic_1", 4)
    store.save(MEMORY, taken=7, schedule={"night": 5.0})
    again = PatrolStore(tmp_path / "p.json", "two")
    assert (again.memory, again.taken, again.schedule) == (MEMORY, 7, {"night": 5.0})
    assert not again.is_handled("/rostopic_1", 4)


def test_another_house_starts_empty(tmp_path, caplog):
    PatrolStore(tmp_path / "p.json", "run", "flat.yaml").save(MEMORY, taken=7)
    again = PatrolStore(tmp_path / "p.json", "run", "house.yaml")
    assert (again.memory, again.taken) == ({}, 7)
    assert "is of the house of flat.yaml" in caplog.text


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff", b"{}", json.dumps({"version": 99}).encode()])
def test_a_broken_file_is_said_and_dropped(tmp_path, caplog, content):
    path = tmp_path / "p.json"
    path.write_bytes(content)
    assert PatrolStore(path, "run").memory == {}
    assert f"{path} cannot be used" in caplog.text


def test_senders_do_not_pile_up(tmp_path):
    store = PatrolStore(tmp_path / "p.json", "run")
    for i in range(300):
        store.note_latched(f"/s{i}", 1)
    assert not store.is_handled("/s0", 1)
    assert store.is_handled("/s299", 1)
