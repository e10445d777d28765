"""The passive infrared sensor: cone, reach, motion across it, hold, lock-out, warm-up."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.motion_sensors import MotionSensor, MotionSensorParams, SensorPlace, bearing_in_cone

DT = 0.1
PLACE = SensorPlace(id=1, room=1, x=0.0, y=0.0, yaw=0.0)


def play(sensor: MotionSensor, seconds: float, *, start: float = 0.0, rate: float = 0.0) -> list[tuple[float, bool]]:
    """Levels while one body changes its bearing at a rate [rad/s]."""
    out = []
    for i in range(round(seconds / DT)):
        now = start + i * DT
        out.append((now, sensor.update(now, [("person", (now - start) * rate)])))
    return out


def length_high(levels: list[tuple[float, bool]]) -> float:
    return sum(DT for _, high in levels if high)


@pytest.mark.parametrize(
    ("x", "y", "seen"), [(3, 0, True), (0.9, 1.0, True), (0.1, 1.0, False), (-1, 0, False), (7.1, 0, False)]
)
def test_cone_and_reach(x: float, y: float, seen: bool) -> None:
    assert (bearing_in_cone(MotionSensorParams(), PLACE, Pose2D(x, y, 0)) is not None) == seen


def test_who_crosses_fires_it_and_who_stands_does_not() -> None:
    assert any(high for _, high in play(MotionSensor(MotionSensorParams()), 3.0, rate=0.2))
    assert not any(high for _, high in play(MotionSensor(MotionSensorParams()), 10.0, rate=0.0))


def test_a_slow_drift_is_not_motion() -> None:
    assert not any(high for _, high in play(MotionSensor(MotionSensorParams()), 20.0, rate=math.radians(1.0)))


def test_hold_lasts_as_long_as_set_and_is_prolonged_by_motion() -> None:
    sensor = MotionSensor(MotionSensorParams())
    play(sensor, 1.0, rate=0.3)
    assert sensor.is_high
    assert length_high(play(sensor, 6.0, start=1.0)) == pytest.approx(2.4, abs=0.25)
    moving = MotionSensor(MotionSensorParams())
    assert length_high(play(moving, 10.0, rate=0.1)) > 8.0
    single = MotionSensor(MotionSensorParams(retrigger=False))
    first = play(single, 4.0, rate=0.1)
    assert length_high(first) == pytest.approx(2.5, abs=0.15)


def test_blind_for_the_lock_out_after_the_output_fell() -> None:
    sensor = MotionSensor(MotionSensorParams(retrigger=False))
    levels = play(sensor, 20.0, rate=0.2)
    falls = [a[0] for a, b in pairwise(levels) if a[1] and not b[1]]
    rises = [b[0] for a, b in pairwise(levels) if b[1] and not a[1]]
    gaps = [min(r for r in rises if r > f) - f for f in falls[:-1]]
    assert gaps
    assert all(2.4 <= gap <= 3.1 for gap in gaps)


def test_silent_while_warming_up_unless_prewarmed() -> None:
    cold = MotionSensor(MotionSensorParams(prewarmed=False), started=0.0)
    assert not any(high for _, high in play(cold, 59.0, rate=0.2))
    assert any(high for _, high in play(cold, 3.0, start=60.0, rate=0.2))
