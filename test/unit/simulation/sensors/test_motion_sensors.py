"""The passive infrared sensor: cone, reach, motion across it, hold, lock-out, warm-up."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.sensors.motion_sensors import (
    MotionSensor,
    MotionSensorParams,
    SensorPlace,
    bearing_in_cone,
)

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


# Measured, as one would on a bench -----------------------------------------------------------------------------------

FINE = 0.01


def bench(params: MotionSensorParams, seconds: float, *, moves_until: float = math.inf) -> list[tuple[float, bool]]:
    """When the output changed [s], and to what, while somebody runs to and fro across the zones until a time."""
    sensor = MotionSensor(params, started=0.0)
    changes, level = [], False
    for i in range(round(seconds / FINE)):
        now = i * FINE
        bearing = math.radians(30.0) * math.sin(6.0 * min(now, moves_until))
        if sensor.update(now, [("person", bearing)]) != level:
            level = not level
            changes.append((now, level))
    return changes


@pytest.mark.parametrize("cone_deg", [60.0, 110.0, 120.0])
def test_the_cone_is_as_wide_as_configured(cone_deg: float) -> None:
    params = MotionSensorParams(cone_deg=cone_deg)
    place = SensorPlace(id=1, room=1, x=2.0, y=-1.0, yaw=2.5)
    seen = []
    for tenth in range(3600):
        bearing = math.radians(tenth / 10.0)
        body = Pose2D(2.0 + 3.0 * math.cos(bearing), -1.0 + 3.0 * math.sin(bearing), 0.0)
        seen.append(bearing_in_cone(params, place, body) is not None)
    assert sum(seen) / 10.0 == pytest.approx(cone_deg, abs=0.2)


@pytest.mark.parametrize("reach", [3.0, 7.0])
def test_it_reaches_as_far_as_configured(reach: float) -> None:
    params = MotionSensorParams(reach=reach)
    seen = [bearing_in_cone(params, PLACE, Pose2D(0.01 * i, 0.0, 0.0)) is not None for i in range(1, 1000)]
    assert 0.01 * sum(seen) == pytest.approx(reach, abs=0.011)


@pytest.mark.parametrize("hold", [2.5, 5.0, 20.0])
def test_the_output_is_held_as_long_as_configured(hold: float) -> None:
    (rise, _), (fall, _) = bench(MotionSensorParams(hold=hold, retrigger=False), hold + 4.0, moves_until=0.5)
    assert rise < 0.5
    assert fall - rise == pytest.approx(hold, abs=1.5 * FINE)


@pytest.mark.parametrize("lock_out", [0.0, 2.5, 6.0])
def test_it_is_blind_after_the_fall_as_long_as_configured(lock_out: float) -> None:
    changes = bench(MotionSensorParams(hold=2.5, lock_out=lock_out, retrigger=False), 30.0)
    falls = [at for at, level in changes if not level]
    rises = [at for at, level in changes if level]
    gaps = [rise - fall for fall, rise in zip(falls, rises[1:], strict=False)]
    assert min(gaps) >= lock_out - 1e-9
    assert max(gaps) < lock_out + 0.2  # then the first motion across a zone fires it


def test_it_warms_up_as_long_as_configured() -> None:
    changes = bench(MotionSensorParams(prewarmed=False, warm_up=60.0), 62.0)
    assert 60.0 <= changes[0][0] < 60.2
    assert bench(MotionSensorParams(prewarmed=True), 2.0)[0][0] < 0.2


def test_a_person_who_comes_straight_at_it_is_not_noticed() -> None:
    sensor = MotionSensor(MotionSensorParams())
    for i in range(350):  # from 6.5 m to 3 m at a metre a second
        bearing = bearing_in_cone(MotionSensorParams(), PLACE, Pose2D(6.5 - 0.01 * i, 0.2, math.pi))
        assert bearing is not None
        assert not sensor.update(i * FINE, [("person", bearing)])
