"""Scenario files: what is refused, and that what they say happens at its time."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import ParamError, WorldError
from rosbot_patrol.simulation.engine import STEP, Engine, EngineParams
from rosbot_patrol.simulation.player import ScenarioPlayer
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.scenario.file import Expect, Outcome, disappointments, read_scenario
from rosbot_patrol.simulation.sdf.world import World
from rosbot_patrol.simulation.sensors.motion_sensors import SensorPlace

ROOT = Path(__file__).parents[3]
SENSORS = [SensorPlace(id=5, room=5, x=3.0, y=3.0, yaw=0.0)]

PLAY = """
title: everything once
seed: 7
robot: {x: 0.5, y: 0.0}
actors:
  - {name: bob, at: 1.0, start: [3, 0], path: [[3, 2]], speed: 0.5, stays: 4.0}
  - {name: rex, model: dog, after: start, start: [-3, 0, 1.57], roam: 1.0}
  - {name: hydrant, model: fire_hydrant, after: driving, start: [4, 4]}
walks:
  - {actor: bob, at: 3.5, path: [[4, 0]], speed: 1.0}
doors:
  - {name: gate, hinge: [0, -3, 0]}
door_moves:
  - {door: gate, at: 2.0, opening: 1}
doorways:
  arch: {x: 2.0, y: -2.0, width: 1.2}
faults:
  - {kind: doorway_blocked, target: arch, at: 1.5, duration: 1.0}
  - {kind: lidar_silent, after: driving, at: 0.5}
triggers:
  - {sensor: 5, at: 2.25}
expect: {verdicts: {5: confirmed}, mails: 1}
"""


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    def write(text: str) -> Path:
        path = tmp_path / "play.yaml"
        path.write_text(text)
        return path

    return write


@pytest.fixture
def engine() -> Iterator[Engine]:
    engine = Engine(World(), EngineParams(seed=7), sensors=SENSORS)
    engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
    yield engine
    engine.close()


def play(player: ScenarioPlayer, engine: Engine, until: float) -> None:
    while engine.now < until - STEP / 2:
        player.advance()
        engine.step()


def names(engine: Engine) -> set[str]:
    return {a.name for a in engine.population.walkers}


def test_everything_happens_at_its_time(write, engine: Engine) -> None:
    told: list[tuple[float, str]] = []
    calls: list[float] = []
    player = ScenarioPlayer(
        read_scenario(write(PLAY)),
        engine,
        lambda sensor: calls.append(engine.now),
        lambda text: told.append((engine.now, text)),
    )
    play(player, engine, 3.0)
    assert names(engine) == {"rex"}
    player.event("on_guard")
    play(player, engine, 4.0)
    assert names(engine) == {"rex"}
    play(player, engine, 4.1)
    assert names(engine) == {"rex", "bob"}
    play(player, engine, 7.0)
    player.event("driving")
    player.event("on_guard")  # only the first counts
    play(player, engine, 9.0)
    assert names(engine) == {"rex", "hydrant"}
    assert [fault.kind for fault, _ in engine.faults.active] == ["lidar_silent"]
    assert engine.population.doors[0].opening == pytest.approx(1.0, abs=0.01)
    assert calls == pytest.approx([5.25])
    assert not player.waiting
    expected = {
        "rex (dog) appears at (-3.0, 0.0)": 0.0,
        "bob (person) appears at (3.0, 0.0)": 4.0,
        "fault: doorway_blocked arch for 1 s": 4.5,
        "the door gate opens": 5.0,
        "motion sensor 5 is made to call": 5.25,
        "bob walks on": 6.5,
        "hydrant (fire_hydrant) appears at (4.0, 4.0)": 7.0,
        "fault: lidar_silent": 7.5,
        "bob is gone": 8.0,
    }
    assert [text for _, text in told] == list(expected)
    assert [at for at, _ in told] == pytest.approx(list(expected.values()))


def test_two_plays_with_one_seed_are_the_same_bit_for_bit(write) -> None:
    def run() -> list[object]:
        engine = Engine(World(), EngineParams(seed=7), sensors=SENSORS)
        engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
        player = ScenarioPlayer(read_scenario(write(PLAY)), engine, lambda _: None, lambda _: None)
        player.event("on_guard")
        play(player, engine, 3.0)
        seen = [engine.scan().ranges.tobytes(), *(tuple(a.pose) for a in engine.population.walkers)]
        engine.close()
        return seen

    assert run() == run()


def test_its_settings_become_launch_arguments_and_files_are_relative_to_it(write, tmp_path: Path) -> None:
    (tmp_path / "my.world").write_text("<sdf/>")
    scenario = read_scenario(write("world: my.world\nseed: 3\n"))
    assert scenario.launch_arguments == {"world": str(tmp_path / "my.world"), "seed": "3"}
    assert scenario.robot is None
    assert scenario.expect is None


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("actros: []", "actros: 'actros' is not known here, did you mean 'actors'?"),
        ("actors: {}", "actors: expected a list, got {}"),
        ("actors: [{name: a}]", "actors[0]/start: is missing"),
        ("actors: [{name: a, start: [1]}]", "actors[0]/start: expected points [x, y] or [x, y, yaw], got [1.0]"),
        ("actors: [{name: a, start: [1, .nan]}]", "actors[0]/start[1]: expected a number"),
        ("actors: [{name: a, start: [0, 0], at: -1}]", "actors[0]/at: is -1.0, expected at least 0.0 s"),
        (
            "actors: [{name: a, start: [0, 0], sped: 1}]",
            "actors[0]/sped: 'sped' is not known here, did you mean",
        ),
        ("actors: [{name: a, start: [0, 0], model: horse}]", "actors[0]: actor 'a': is of the model 'horse'"),
        ("actors: [{name: a, start: [0, 0], look: nobody}]", "actors[0]: "),
        ("actors: [{name: a, start: [0, 0], after: tea}]", "actors[0]/after: is 'tea', expected one of , start"),
        ("actors: [{name: a, start: [0, 0]}, {name: a, start: [1, 1]}]", "actors[1]/name: 'a' is used twice"),
        ("actors: [{name: a, start: [0, 0], roam: 1, path: [[1, 1]]}]", "actors[0]/roam: stands beside a path"),
        ("walks: [{actor: a}]", "walks[0]/path: is missing, and so is roam"),
        (
            "faults: [{kind: camera_blak}]",
            "faults[0]/kind: 'camera_blak' is not known here, did you",
        ),
        ("faults: [lidar_silent]", "faults[0]: expected the keys of a fault, got 'lidar_silent'"),
        ("faults: [{kind: odometry_slip, factor: -1}]", "faults[0]/factor: is -1.0, expected at least 0.0"),
        ("triggers: [{sensor: x}]", "triggers[0]/sensor: expected a whole number, got 'x'"),
        ("doorways: {a: {x: 1}}", "doorways/a/y: is missing"),
        ("doors: [{name: d, hinge: [0, 0], swing: 9}]", "doors[0]/swing: is 9.0, expected at most 3.1 rad"),
        ("expect: {verdicts: {5: maybe}}", "expect/verdicts/5: is 'maybe', expected one of confirmed, clear"),
        ("expect: {verdicts: {five: clear}}", "expect/verdicts/five: is no room, expected its number"),
        ("expect: {mail: 1}", "expect/mail: 'mail' is not known here, did you mean 'mails'?"),
        ("world: no.world", "world: 'no.world' is no file"),
        ("seed: -1", "seed: is -1, expected at least 0"),
        ("begin: later", "begin: is 'later', expected one of start, on_guard"),
    ],
)
def test_a_file_that_is_wrong_is_said_in_a_sentence_with_file_and_key(write, text: str, sentence: str) -> None:
    path = write(text)
    with pytest.raises(ParamError) as caught:
        read_scenario(path)
    assert str(caught.value).startswith(f"{path}: {sentence}")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "walks: [{actor: bib, path: [[1, 1]]}]\nactors: [{name: bob, start: [0, 0]}]",
            "walks[0]/actor: 'bib' is not known",
        ),
        ("triggers: [{sensor: 9}]", "triggers[0]/sensor: there is no motion sensor 9 (there: 5)"),
        ("faults: [{kind: motion_stuck, target: 9}]", "faults[0]/target: there is no motion sensor 9 (there: 5)"),
        ("faults: [{kind: doorway_blocked, target: arch}]", "faults[0]/target: 'arch' is not there"),
        ("door_moves: [{door: gate, opening: 1}]", "door_moves[0]/door: 'gate' is not there"),
    ],
)
def test_what_the_world_does_not_have(write, engine: Engine, text: str, sentence: str) -> None:
    path = write(text)
    with pytest.raises(ParamError) as caught:
        ScenarioPlayer(read_scenario(path), engine, lambda _: None, lambda _: None)
    assert str(caught.value).startswith(f"{path}: {sentence}")


def test_what_cannot_be_done_in_the_middle_of_it_is_an_error(write, engine: Engine) -> None:
    text = "begin: start\nfaults: [{kind: doorway_blocked, x: 0, y: 0.1, at: 1.0}]"
    player = ScenarioPlayer(read_scenario(write(text)), engine, lambda _: None, lambda _: None)
    with pytest.raises(WorldError, match="the robot is there"):
        play(player, engine, 2.0)
    assert engine.now == pytest.approx(1.0)


def test_what_came_otherwise_than_expected() -> None:
    expect = Expect(verdicts={5: "confirmed", 3: "clear"}, mails=1, missions=2)
    good = Outcome(verdicts={5: "confirmed", 3: "clear"}, missions=2, mails=1, is_home=True)
    assert disappointments(expect, good) == []
    assert expect.least_missions == 2
    bad = Outcome(verdicts={5: "unverified"}, missions=1, mails=0, is_home=False)
    assert disappointments(expect, bad) == [
        "The verdict for room 5 should have been confirmed; it was unverified.",
        "The verdict for room 3 should have been clear; no mission to it has ended.",
        "2 missions should have ended; there were 1.",
        "1 mail should have been written; there were 0.",
        "The robot should have been home.",
    ]


@pytest.mark.parametrize("path", sorted((ROOT / "scenarios").glob("*.yaml")), ids=lambda p: p.stem)
def test_our_own_are_sound(path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        scenario = read_scenario(path)
    assert scenario.setting.title
    assert scenario.expect is not None
    assert not caplog.records
    assert np.isfinite(scenario.expect.within)
