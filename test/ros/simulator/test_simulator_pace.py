"""The clock in lockstep with who has to keep up, on a wall clock of the test's own."""

from __future__ import annotations

import itertools
import logging

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.ros.simulator.pace import Lockstep, LockstepParams, Pace, SharedClock

TICK = 0.01


class Wall:
    """A wall clock, and a consumer on it that answers each so many seconds of its own while it lives."""

    def __init__(self, topic: str, every: float, *, tick_cost: float = 0.001) -> None:
        self.now = 0.0
        self.sim = 0.0
        self.topic = topic
        self.every = every
        self.dies_at = float("inf")
        self.answers: list[float] = []
        self._next = 0.0
        self._tick_cost = tick_cost
        params = LockstepParams(topics=(topic,), slack=0.3, patience=0.4)
        self.lockstep = Lockstep(params, lambda: self.sim, clock=lambda: self.now, sleep=self.pass_by)

    def pass_by(self, seconds: float) -> None:
        until = self.now + seconds
        while self._next <= until:
            self.now, self._next = self._next, self._next + self.every
            if self.now < self.dies_at:
                self.answers.append(self.sim)
                self.lockstep.note(self.topic, "/consumer")
        self.now = until

    def run(self, sim_seconds: float) -> None:
        for _ in range(round(sim_seconds / TICK)):
            self.sim += TICK
            self.pass_by(self._tick_cost)
            self.lockstep.wait()


@pytest.mark.parametrize("every", [0.05, 0.1, 0.3])
def test_a_slow_consumer_slows_the_clock_and_misses_nothing(every: float) -> None:
    wall = Wall("/looks", every)
    wall.run(30.0)
    assert 30.0 / wall.now == pytest.approx(0.3 / every, rel=0.1)
    gaps = [b - a for a, b in itertools.pairwise(wall.answers)]
    assert max(gaps) <= 0.3 + 2 * TICK
    assert sum(wall.lockstep.take_waited().values()) == pytest.approx(wall.now - 3.0, rel=0.15)
    assert wall.lockstep.take_waited() == {}
    assert wall.lockstep.idle == ()


def test_how_busy_the_machine_is_changes_how_long_it_takes_and_not_how_often_a_consumer_looks() -> None:
    looks = []
    for cost in (0.0001, 0.002, 0.004):
        wall = Wall("/looks", 0.2 + 10 * cost, tick_cost=cost)
        wall.run(60.0)
        looks.append(len(wall.answers))
        assert max(b - a for a, b in itertools.pairwise(wall.answers)) <= 0.3 + 2 * TICK
    assert max(looks) - min(looks) <= 0.05 * max(looks)


def test_a_dead_one_holds_the_clock_up_once_for_the_patience_and_is_named(caplog: pytest.LogCaptureFixture) -> None:
    wall = Wall("/looks", 0.1, tick_cost=0.0)
    wall.run(3.0)
    wall.dies_at, died = wall.now, wall.now
    with caplog.at_level(logging.INFO):
        wall.run(10.0)
    assert wall.now - died == pytest.approx(0.4, abs=0.11)
    assert wall.lockstep.idle == ("/looks of /consumer",)
    said = [r.message for r in caplog.records]
    assert said == ["the clock waited 0.4 s for /looks of /consumer, and goes on without"]
    wall.lockstep.note("/looks", "/consumer")  # it is back
    assert wall.lockstep.idle == ()


def test_who_has_never_spoken_is_not_waited_for() -> None:
    wall = Wall("/looks", 0.1, tick_cost=0.001)
    wall.dies_at = -1.0
    wall.run(5.0)
    assert wall.now == pytest.approx(0.5, abs=0.01)
    assert wall.lockstep.idle == ()


class Lap:
    """A wall clock that a pace sleeps on, and how long each step took on it."""

    def __init__(self, rate: float) -> None:
        self.now = 100.0
        self.steps: list[float] = []
        self._sim = 0.0
        self.pace = Pace(rate, clock=lambda: self.now, sleep=self._sleep)

    def _sleep(self, seconds: float) -> None:
        self.now += seconds

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK)):
            before = self.now
            self._sim += TICK
            self.pace.wait(self._sim)
            self.steps.append(self.now - before)


@pytest.mark.parametrize("rate", [0.5, 1.0, 4.0])
def test_a_rate_is_held(rate):
    lap = Lap(rate)
    lap.run(1.0)
    assert lap.steps == pytest.approx([TICK / rate] * 100)


def test_after_a_short_stall_the_clock_catches_up_without_a_jump():
    """A jump would look to other nodes as if they had been slow."""
    lap = Lap(1.0)
    lap.run(0.5)
    lap.now += 0.2
    lap.run(0.8)
    assert lap.now == pytest.approx(101.3)
    assert min(lap.steps[51:]) >= TICK / 1.5 - 1e-9  # the first after it is due at once


def test_after_a_long_stall_it_goes_on_from_there():
    lap = Lap(1.0)
    lap.run(0.5)
    lap.now += 2.0
    lap.run(1.0)
    assert lap.now == pytest.approx(103.5, abs=2 * TICK)


def test_rate_0_waits_for_nothing():
    lap = Lap(0.0)
    lap.run(1.0)
    assert lap.now == 100.0


class Told:
    """A simulation that keeps to a clock which the test tells; a second of it takes `cost` seconds of that."""

    def __init__(self, now: float, *, cost: float = 0.0) -> None:
        self.now, self.sim, self._cost = now, 0.0, cost
        self.clock = SharedClock(lambda: self.now)
        self.clock.restart(self.sim)

    def run(self, until: float) -> None:
        """Let the clock run in steps of its own 10 ms."""
        while self.now < until - 1e-9:
            self.now = round(self.now + TICK, 4)
            while self.clock.is_due(self.sim) and (not self._cost or self.now < until):
                self.sim = round(self.sim + TICK, 4)
                self.now = round(self.now + TICK * self._cost, 6)


def test_a_simulation_keeps_to_the_clock_of_another_from_where_that_stands() -> None:
    told = Told(500.0)
    told.run(510.0)
    assert told.sim + told.clock.ahead == pytest.approx(510.0, abs=2 * TICK)
    assert told.sim == pytest.approx(10.0, abs=2 * TICK)


def test_nothing_is_due_before_the_clock_has_begun_nor_while_it_stands() -> None:
    told = Told(0.0)
    assert not told.clock.is_due(told.sim)
    told.now = 20.0
    assert told.clock.is_due(told.sim)
    told.run(25.0)
    stood = told.sim
    assert not told.clock.is_due(told.sim)
    assert told.sim == stood


def test_a_slow_simulation_falls_behind_says_how_far_and_never_jumps() -> None:
    told = Told(100.0, cost=2.0)
    told.run(110.0)
    assert told.clock.ahead == 100.0
    assert 0.0 <= told.clock.behind(told.sim) < 10.0
    assert told.sim < 6.0


def test_a_clock_that_begins_anew_is_followed_from_there() -> None:
    told = Told(300.0)
    told.run(310.0)
    told.now = 2.0
    told.run(5.0)
    assert told.sim + told.clock.ahead == pytest.approx(5.0, abs=2 * TICK)
    assert told.sim == pytest.approx(13.0, abs=3 * TICK)
