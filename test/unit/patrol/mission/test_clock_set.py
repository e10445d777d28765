"""A clock that is set in mid mission changes nothing of what the robot does, sees and tells."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import pytest
from belief_pictures import good_network
from room_world import ROOMS, Place, World

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.goal import GoalLink
from rosbot_patrol.patrol.mission.manager import PatrolManager
from rosbot_patrol.patrol.records.inputs import Battery, Frame, Inputs, ScanView
from rosbot_patrol.patrol.records.mission import Verdict

BEGAN = 100.0
HOUR, YEAR = 3600.0, 3600.0 * 24 * 365

Settings = dict[float, float]


class SetClock:
    """A manager whose clock is set at some times [s] by so much [s], and whose detector takes its time."""

    def __init__(self, manager, settings: Settings, latency: float = 0.0) -> None:
        self._manager, self._settings, self._latency = manager, settings, latency
        self._frames: list[tuple[float, Frame]] = []
        self._views: dict[int, tuple[ScanView, ScanView]] = {}

    def __getattr__(self, name: str):
        return getattr(self._manager, name)

    def clock(self, time: float) -> float:
        """What the clock says at a time [s]."""
        return time + sum(by for at, by in self._settings.items() if at <= time)

    def step(self, now: float, inputs: Inputs):
        self._frames += [(now + self._latency, self._stamped(frame)) for frame in inputs.frames]
        due = tuple(frame for at, frame in self._frames if at <= now)
        self._frames = [(at, frame) for at, frame in self._frames if at > now]
        said = dataclasses.replace(
            inputs,
            frames=due,
            scan=self._view(inputs.scan),
            detector_at=self.clock(inputs.detector_at),
            camera_at=self.clock(inputs.camera_at),
        )
        return self._manager.step(self.clock(now), said)

    def _stamped(self, frame: Frame) -> Frame:
        return frame if frame.stamp is None else dataclasses.replace(frame, stamp=self.clock(frame.stamp))

    def _view(self, view: ScanView | None) -> ScanView | None:
        if view is None:
            return None
        if id(view) not in self._views:
            scan = dataclasses.replace(view.scan, stamp=self.clock(view.scan.stamp))
            self._views[id(view)] = view, dataclasses.replace(view, scan=scan)
        return self._views[id(view)][1]


def played(people: Callable[[float], list[Place]], settings: Settings, *, score: float = 0.9, latency: float = 0.0):
    """A world whose mission is over, and its clock."""
    world = World(people)
    world.score = lambda pose: score
    clock = SetClock(world.manager, settings, latency)
    world.manager = clock
    world.mission()
    return world, clock


def told(world: World):
    """What the owner learns: the verdict, how much was seen, and who is where."""
    (mission,) = world.ended
    places = [[tuple(round(v, 6) for v in place) for place in notice.mission.people] for notice in world.notices]
    return mission.verdict, round(mission.share_seen, 1), places


def pictures(world: World) -> list[int]:
    return [notice.seen.pictures for notice in world.notices]


def half_hidden(now: float) -> list[Place]:
    return [(7.0, 1.0)]


def walking(now: float) -> list[Place]:
    return [(6.0 + 0.04 * (now - BEGAN), 2.5)]


def passing_behind(now: float) -> list[Place]:
    return [(3.0, 1.0 + 0.25 * (now - BEGAN - 20.0))] if 20.0 < now - BEGAN < 28.0 else []


SCENES = {
    "half hidden": (half_hidden, 0.55, 0.0),
    "half hidden, slow detector": (half_hidden, 0.55, 1.2),
    "walking": (walking, 0.9, 0.0),
    "behind": (passing_behind, 0.9, 0.0),
}
WHEN = (BEGAN + 8.02, BEGAN + 14.0, BEGAN + 21.3)  # on the way, at the first turn, after it


@pytest.fixture(scope="module")
def unset() -> dict[str, World]:
    """Each scene with a clock that nobody sets."""
    return {name: played(who, {}, score=score, latency=late)[0] for name, (who, score, late) in SCENES.items()}


@pytest.mark.parametrize("by", [-0.5, -2.0, -HOUR, -YEAR, 60.0, YEAR])
@pytest.mark.parametrize("scene", SCENES)
def test_a_clock_set_three_times_changes_nothing(scene: str, by: float, unset: dict[str, World]) -> None:
    who, score, late = SCENES[scene]
    world, _ = played(who, dict.fromkeys(WHEN, by), score=score, latency=late)
    assert told(world) == told(unset[scene])
    assert pictures(world) == pytest.approx(pictures(unset[scene]), rel=0.2)
    assert world.now == pytest.approx(unset[scene].now, abs=12.0)  # one way more or less


@pytest.mark.parametrize("by", [2.0, 4.9])  # so little may as well be a pause of the program, and counts as time
@pytest.mark.parametrize("scene", ["half hidden", "walking"])
def test_a_clock_that_goes_forward_a_little_loses_nobody(scene: str, by: float, unset: dict[str, World]) -> None:
    who, score, late = SCENES[scene]
    world, _ = played(who, dict.fromkeys(WHEN, by), score=score, latency=late)
    assert world.ended[0].verdict is unset[scene].ended[0].verdict
    assert len(world.notices) == len(unset[scene].notices)


@pytest.mark.parametrize("by", [-HOUR, HOUR])
def test_a_picture_is_found_by_the_stamp_that_the_camera_gave_it(by: float) -> None:
    world, clock = played(half_hidden, {WHEN[0]: by, WHEN[1]: -by / 2.0}, score=0.9)
    (notice,) = world.notices
    given = [clock.clock(BEGAN + 0.08 * step) for step in range(int((world.now - BEGAN) / 0.08) + 1)]
    assert min(abs(notice.seen.stamp + 0.05 - stamp) for stamp in given) < 1e-6


@pytest.mark.parametrize("by", [-2.0, -60.0, -YEAR, 2.0, 4.9, 60.0, YEAR])
def test_an_empty_room_is_clear_whenever_the_clock_is_set(by: float) -> None:
    world, _ = played(lambda now: [], {BEGAN + 3.0 * k: by for k in range(1, 12)})
    assert world.ended[0].verdict is Verdict.CLEAR


@pytest.mark.parametrize("by", [-60.0, -HOUR, 60.0, YEAR])
def test_a_battery_that_is_low_stays_so_when_the_clock_is_set(by: float) -> None:
    manager = PatrolManager(ROOMS, network=good_network)
    words = []
    for k in range(100):
        now = BEGAN + 0.1 * k + (by if k >= 50 else 0.0)
        battery = Battery(share=0.1, at=BEGAN + 4.0)
        link = GoalLink(is_up=True)
        words += manager.step(now, Inputs(battery=battery, link=link, yaw=0.0, pose=Pose2D(), detector_at=now)).words
    assert [word.is_over for word in words] == [False]
