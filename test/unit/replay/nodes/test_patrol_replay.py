"""The patrol over bags of a small world."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import made_patrol
import numpy as np
import pytest
from made_bag import Maker, write_bag
from made_patrol import POINTS, RecordedWorld, looking

from rosbot_patrol.errors import BagError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.belief.belief import Belief
from rosbot_patrol.replay.bags.bag import Bag
from rosbot_patrol.replay.bags.raw_ros1 import read_goal, read_result
from rosbot_patrol.replay.nodes import patrol as patrol_replay
from rosbot_patrol.replay.nodes.patrol_log import FIELDS
from rosbot_patrol.replay.nodes.patrol_records import KINDS
from rosbot_patrol.replay.nodes.setup import Setup, build_replay
from rosbot_patrol.replay.results.comparison import compare
from rosbot_patrol.replay.results.tables import Result
from rosbot_patrol.replay.runner import run_replay


def recorded(folder: Path, drive: Callable[[RecordedWorld], object], **given: object) -> tuple[Path, RecordedWorld]:
    world = RecordedWorld(**given)
    for _ in range(25):
        world.step()
    drive(world)
    for _ in range(5):
        world.step()
    (folder / "rooms.yaml").write_text(POINTS)
    messages = sorted(world.messages, key=lambda each: each[0])
    return write_bag(folder / "patrol.bag", messages, latching=["/tf_static"]), world


def replayed(path: Path) -> Result:
    setup = Setup(node="patrol_robot", tree={"look_around": "spin"}, rooms=path.parent / "rooms.yaml")
    with Bag(path) as bag:
        return run_replay(bag, build_replay(setup))


def in_room_2(world: RecordedWorld) -> bool:
    return looking(world) and world.x > 19.0


def test_a_clear_room_gives_the_verdict_and_goals_of_the_run(tmp_path: Path) -> None:
    path, world = recorded(tmp_path, lambda w: w.mission(2))
    result = replayed(path)
    verdicts, goals = result.tables["verdicts"], result.tables["goals"]
    assert verdicts["verdict"].tolist() == [world.ended[0].verdict.value] == ["clear"]
    assert verdicts["reason"].tolist() == [world.ended[0].reason]
    assert goals["x"].tolist() == [20.0, 0.0]
    assert goals["phase"].tolist() == ["driving", "returning"]
    assert result.counts["notices"] == 0
    states = result.tables["reports"]["state"].tolist()
    phases = [state for i, state in enumerate(states) if i == 0 or states[i - 1] != state]
    assert phases == ["starting", "idle", "driving", "looking", "returning", "idle"]
    assert result.tables["turns"]["is_turning"].tolist() == [True, False]


def test_an_intruder_is_confirmed_at_the_same_moment(tmp_path: Path) -> None:
    path, world = recorded(tmp_path, lambda w: w.mission(2), person_when=in_room_2)
    result = replayed(path)
    notices = result.tables["notices"]
    assert notices["label"].tolist() == ["person"]
    assert notices["room"].tolist() == [2]
    assert result.tables["verdicts"]["verdict"].tolist() == ["confirmed"]
    assert len(world.notices) == 1


def test_the_same_bit_for_bit(tmp_path: Path) -> None:
    path, _ = recorded(tmp_path, lambda w: w.mission(2), person_when=in_room_2)
    assert replayed(path).digest == replayed(path).digest


def test_steps_left_out_at_rest_change_nothing_of_a_mission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def drive(world: RecordedWorld) -> None:
        world.mission(2)
        for _ in range(100):
            world.step()
        world.mission(2)

    path, _ = recorded(tmp_path, drive, person_when=in_room_2)
    sparing = replayed(path)
    monkeypatch.setattr(patrol_replay, "AT_REST", 1)
    whole = replayed(path)
    assert sparing.counts.pop("steps") < whole.counts.pop("steps") - 80
    assert compare(whole, sparing, {name: replace(field, tolerance=0.0) for name, field in FIELDS.items()}) == []


def test_a_room_that_cannot_be_reached_is_told_as_move_base_told_it(tmp_path: Path) -> None:
    path, world = recorded(tmp_path, lambda w: w.mission(2), refuse={20.0})
    result = replayed(path)
    assert world.ended[0].verdict.value == "unreachable"
    assert result.tables["verdicts"]["verdict"].tolist() == ["unreachable"]
    assert "Failed to find a valid plan" in result.tables["verdicts"]["reason"][0]


def test_a_planted_fault_is_caught_and_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, _ = recorded(tmp_path, lambda w: w.mission(2), person_when=in_room_2)
    stored = replayed(path)
    assert compare(stored, replayed(path), FIELDS) == []
    monkeypatch.setattr(Belief, "see", lambda self, now, frame, view: [])  # nobody is believed any more
    differences = {each.name: each.text for each in compare(stored, replayed(path), FIELDS)}
    assert "1 of 1 stored rows are missing" in differences["notices.rows"]
    assert "(stored confirmed, now " in differences["verdicts.verdict"]


def test_without_triggers_there_is_nothing_to_replay(tmp_path: Path) -> None:
    path, _ = recorded(tmp_path, lambda w: None)
    with pytest.raises(BagError, match=r"has no topic '/motion_trigger' \(rosbot_patrol/EspTrigger\)"):
        replayed(path)


def test_events_of_times_of_their_own_are_compared_in_their_order(tmp_path: Path) -> None:
    path, _ = recorded(tmp_path, lambda w: w.mission(2))
    stored, found = replayed(path), replayed(path)
    stamps = found.tables["reports"]["stamp"]
    stamps += 0.2
    assert compare(stored, found, FIELDS) == []
    stamps[-1] += 3.0
    assert [each.name for each in compare(stored, found, FIELDS)] == ["reports.stamp"]
    assert np.all(np.diff(stamps) >= 0.0)


@pytest.mark.parametrize(("moves", "count", "text"), [(True, 0, ""), (False, 3, "Zürich: no way there")])
def test_fast_parsers_give_what_rosbags_gives(moves: bool, count: int, text: str) -> None:
    maker, store = Maker(), made_patrol.NOETIC
    trigger = maker.new(made_patrol.TRIGGER, 7, moves)
    seen = maker.new(made_patrol.COUNT, maker.header(12.345678901, "camera"), count)
    called = made_patrol.goal_message(maker, 12.5, "/patrol-1-12.5", Pose2D(1.0, 2.0, 3.0))
    ended = made_patrol.result_message(maker, 13.5, "", 3 + count, text)
    for message in (trigger, seen, called, ended):
        name, raw = message.__msgtype__, maker.bytes(message)
        kind = KINDS[name]
        assert kind.fast is not None
        assert kind.fast(raw) == kind.convert(store.deserialize_ros1(raw, name))
        assert kind.md5 == store.generate_msgdef(name, ros_version=1)[1]


@pytest.mark.parametrize("read", [read_goal, read_result])
@pytest.mark.parametrize("length", [0, 15, 27, 60])
def test_a_goal_or_result_that_ends_early_is_told(read: Callable[[bytes], object], length: int) -> None:
    raw = struct.pack("<IIII3sIII10s", 0, 1, 2, 3, b"map", 3, 4, 4_000, b"a goal")
    with pytest.raises(struct.error):
        read(raw[:length])
