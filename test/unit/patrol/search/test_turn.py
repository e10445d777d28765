import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.geometry import wrap_angle
from rosbot_patrol.patrol.search.turn import Spin, SpinParams, wrap_turn


class Base:
    """A base that follows its command with a delay, seen through odometry at 20 Hz."""

    def __init__(self, spin, delay=0.08, yaw=0.0, gain=1.0):
        self.spin, self.gain = spin, gain
        self.truth = yaw
        self.start = yaw
        self.queue = [0.0] * round(delay / 0.01)
        self.now = 0.0
        self.speeds = []

    def run(self, limit=60.0, clearance=lambda now: None, seen=lambda now: True, hold=lambda now: False):
        yaw = wrap_angle(self.truth)
        command = 0.0
        ticks = 0
        while self.now < limit:
            if ticks % 5 == 0:
                yaw = wrap_angle(self.truth)
            if ticks % 4 == 0:
                step = self.spin.step(
                    self.now, yaw if seen(self.now) else None, clearance(self.now), hold=hold(self.now)
                )
                command = step.speed
                self.speeds.append(command)
                if step.done:
                    return step
            self.queue.append(command * self.gain)
            self.truth += self.queue.pop(0) * 0.01
            self.now += 0.01
            ticks += 1
        raise AssertionError("the turn never ended")

    @property
    def turned(self):
        return self.truth - self.start


@pytest.mark.parametrize(
    ("asked", "wrapped"),
    [
        (math.pi, math.pi),
        (0.0, 0.0),
        (math.tau, math.tau),
        (-math.pi / 2, 1.5 * math.pi),
        (-math.tau, 0.0),
        (math.tau + 1.0, 1.0),
        (2 * math.tau, math.tau),
        (-math.tau - 1.0, math.tau - 1.0),
    ],
)
def test_angles_wrap_as_the_originals(asked, wrapped):
    assert wrap_turn(asked) == pytest.approx(wrapped)


def test_no_angle_is_refused():
    with pytest.raises(ValueError, match="nan is no angle"):
        wrap_turn(math.nan)


@pytest.mark.parametrize("start", [0.0, 3.1, -3.1])
@pytest.mark.parametrize("clockwise", [True, False])
def test_a_full_turn_ends_within_six_degrees_at_rest(start, clockwise):
    base = Base(Spin(math.tau, clockwise), yaw=start)
    step = base.run()
    assert step.problem == ""
    assert base.speeds[-1] == 0.0
    assert abs(math.degrees(abs(base.turned)) - 360) < 6
    assert (base.turned < 0) == clockwise
    assert base.now < 14


@given(delay=st.floats(0.0, 0.2), gain=st.floats(0.7, 1.3), speed=st.floats(0.3, 1.5), angle=st.floats(0.3, math.tau))
def test_other_bases_and_angles(delay, gain, speed, angle):
    base = Base(Spin(angle, False, params=SpinParams(spin_speed=speed)), delay=delay, gain=gain)
    assert base.run().problem == ""
    assert abs(math.degrees(base.turned - angle)) < 6


def test_nothing_to_turn_is_done_at_once():
    base = Base(Spin(0.0))
    assert base.run(limit=2.0).problem == ""
    assert base.turned == 0.0


def test_a_wobble_the_wrong_way_counts_as_what_it_is():
    # the original reads -2 degrees as 358 and is done at once
    spin = Spin(math.pi, clockwise=False)
    spin.step(0.0, 0.0)
    step = spin.step(0.1, math.radians(-2))
    assert not step.done
    assert step.speed > 0
    assert spin.turned_deg == pytest.approx(-2)


def test_a_base_that_does_not_turn_ends_by_time_out():
    base = Base(Spin(math.tau), gain=0.0)
    step = base.run()
    assert "did not turn far enough in 30 s" in step.problem
    assert base.speeds[-1] == 0.0


def test_an_obstacle_that_goes_is_waited_for():
    base = Base(Spin(math.tau))
    step = base.run(clearance=lambda now: 0.1 if 2.0 < now < 6.0 else 1.0)
    assert step.problem == ""
    assert base.speeds[round(4.0 / 0.04)] == 0.0
    assert abs(math.degrees(abs(base.turned)) - 360) < 6


def test_an_obstacle_that_stays_ends_the_turn_and_is_named():
    base = Base(Spin(math.tau))
    step = base.run(clearance=lambda now: 0.15 if now > 2.0 else 1.0)
    assert "something is 0.15 m from the robot's centre, too near to turn" in step.problem
    assert "of 360 degrees" in step.problem
    assert base.now < 13


def test_a_lost_heading_stops_the_robot_and_ends_the_turn():
    base = Base(Spin(math.tau))
    step = base.run(seen=lambda now: now < 2.0)
    assert "the heading in odom is not known" in step.problem
    assert base.speeds[round(3.0 / 0.04)] == 0.0


def test_a_hold_stands_still_and_costs_no_time():
    base = Base(Spin(math.tau))
    step = base.run(limit=120, hold=lambda now: 2.0 < now < 60.0)
    assert step.problem == ""
    assert base.now > 60
    assert abs(math.degrees(abs(base.turned)) - 360) < 6
