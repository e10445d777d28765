"""Steady time, and the stamps of a clock that is set in it."""

from __future__ import annotations

import pytest

from rosbot_patrol.patrol.mission.steady import Heard, SteadyClock


def run(clock: SteadyClock, start: float, seconds: float) -> float:
    """Ten steps a second from a time of the clock on; returns its last time."""
    for k in range(round(seconds * 10) + 1):
        clock.step(start + 0.1 * k)
    return start + seconds


def test_until_the_clock_is_set_both_times_are_the_same() -> None:
    clock = SteadyClock()
    now = run(clock, 1.7e9, 20.0)
    assert clock.time == now
    assert clock.steady(now - 0.3) == now - 0.3
    assert clock.steady(now + 5.0) == now + 5.0


@pytest.mark.parametrize("by", [-2.0, -60.0, -3600.0, 10.0, 60.0, 3.2e7])
def test_stamps_from_before_and_after_the_setting_come_in_order(by: float) -> None:
    clock = SteadyClock()
    run(clock, 100.0, 10.0)
    run(clock, 110.1 + by, 0.3)
    taken = [109.8, 109.9, 110.0, 110.1 + by, 110.2 + by, 110.3 + by]
    assert [clock.steady(stamp) for stamp in taken] == pytest.approx([109.8, 109.9, 110.0, 110.1, 110.2, 110.3])
    assert clock.time == pytest.approx(110.4)


def test_it_is_set_back_and_put_right_again() -> None:
    clock = SteadyClock()
    run(clock, 100.0, 10.0)
    run(clock, 50.0, 5.0)
    run(clock, 115.2, 5.0)
    assert clock.time == pytest.approx(120.2)
    assert clock.steady(120.0) == pytest.approx(120.0)
    assert clock.steady(55.0) == pytest.approx(115.1)  # still on its way from before


def test_pictures_of_a_camera_that_is_a_little_ahead_are_of_now() -> None:
    clock = SteadyClock()
    run(clock, 100.0, 10.0)
    run(clock, 50.0, 5.0)
    assert clock.steady(55.05) == pytest.approx(clock.time)


def test_time_never_goes_back() -> None:
    clock, last = SteadyClock(), 0.0
    for now in (100.0, 100.1, 99.0, 99.1, 5.0, 5.1, 4e9, 4e9 + 0.1, 4e9, 0.0):
        clock.step(now)
        assert clock.time >= last
        last = clock.time
    assert clock.time < 101.5


@pytest.mark.parametrize("by", [-60.0, -3600.0, 60.0])
def test_who_died_before_the_clock_was_set_stays_dead(by: float) -> None:
    """Also when the clock comes by the time of the last word once more."""
    clock, ages = SteadyClock(), []
    heard = Heard(clock)
    for k in range(1200):
        now = 100.0 + 0.1 * k + (by if k >= 50 else 0.0)
        clock.step(now)
        ages.append(clock.time - heard.steady(now if k < 40 else 104.0))
    assert ages[40:] == sorted(ages[40:])
    assert ages[-1] == pytest.approx(115.9, abs=0.2)


@pytest.mark.parametrize("by", [2.0, 4.9, -2.0, 60.0])
def test_nobody_falls_silent_by_a_setting_of_the_clock(by: float) -> None:
    clock = SteadyClock()
    heard = Heard(clock)
    for k in range(100):
        now = 100.0 + 0.1 * k + (by if k >= 50 else 0.0)
        clock.step(now)
        before = now - 0.1 if k != 50 else 104.9
        assert clock.time - heard.steady(before) < 1.05
