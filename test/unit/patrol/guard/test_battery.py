"""What a driver's BatteryState tells, and when the battery counts as low."""

import math

import pytest

from rosbot_patrol.patrol.guard.battery import BatteryParams, BatteryWatch, battery_of, check_battery
from rosbot_patrol.patrol.records.inputs import Battery

TURTLEBOT3 = BatteryParams(battery_voltage_first=True)


def is_low(params, *said, before=False):
    """Whether the battery is low after these were said, one a second."""
    watch = BatteryWatch(params)
    watch.is_low = before
    for now, battery in enumerate(said):
        watch.step(float(now), Battery(share=battery.share, voltage=battery.voltage, at=float(now)))
    return watch.is_low


@pytest.mark.parametrize(
    ("share", "is_present", "known"),
    [
        (0.0, False, None),  # a ROSbot's firmware: C++'s default
        (-0.0, False, None),
        (0.0, True, 0.0),  # truly empty
        (0.5, False, 0.5),
        (1.0, False, 1.0),
        (1.13, True, None),  # a TurtleBot3's, full
        (87.0, True, None),  # per cent
        (-1.0, True, None),
        (math.nan, True, None),
        (math.inf, True, None),
    ],
)
def test_what_is_known_of_the_share(share, is_present, known):
    assert battery_of(share, 12.0, is_present=is_present).share == known


@pytest.mark.parametrize(
    ("voltage", "known"), [(12.4, 12.4), (0.0, None), (-1.0, None), (math.nan, None), (math.inf, None)]
)
def test_what_is_known_of_the_voltage(voltage, known):
    assert battery_of(math.nan, voltage, is_present=False).voltage == known


@pytest.mark.parametrize(
    ("volts", "before", "low"),
    [(12.4, False, False), (10.9, False, False), (10.7, False, True), (11.3, True, True), (11.5, True, False)],
)
def test_a_rosbot_is_judged_by_its_voltage(volts, before, low):
    said = battery_of(0.0, volts, is_present=False)
    assert is_low(BatteryParams(), said, before=before) is low


def test_a_battery_of_which_nothing_is_known_is_not_low():
    assert not is_low(BatteryParams(), battery_of(0.0, 0.0, is_present=False), before=True)
    assert not is_low(BatteryParams(battery_low_voltage=0.0), battery_of(0.0, 9.5, is_present=False))


@pytest.mark.parametrize(("volts", "low"), [(12.5, False), (11.0, False), (10.7, True)])
def test_a_turtlebot3_is_judged_by_its_voltage(volts, low):
    said = battery_of(volts / 11.1, volts, is_present=True)  # 0.96 at 10.7 V
    assert is_low(TURTLEBOT3, said) is low


def test_voltage_first_takes_the_share_where_there_is_no_voltage():
    assert is_low(TURTLEBOT3, battery_of(0.1, math.nan, is_present=True))
    assert not is_low(TURTLEBOT3, battery_of(0.3, 0.0, is_present=True))


def test_another_battery_is_not_judged_by_the_limits_of_a_rosbot(caplog):
    said = battery_of(math.nan, 7.4, is_present=True)  # two cells
    assert not is_low(BatteryParams(), said, said, said)
    (warning,) = caplog.messages
    assert "7.4 V, and battery_low_voltage is 10.8 V" in warning
    assert is_low(BatteryParams(battery_low_voltage=7.5, battery_ok_voltage=7.9), said)


def test_a_battery_that_was_low_stays_so_while_it_fades():
    assert is_low(BatteryParams(), *(battery_of(0.0, volts, is_present=False) for volts in (10.5, 9.0, 8.0, 11.0)))


def test_the_limit_by_voltage_can_be_switched_off():
    check_battery(BatteryParams(battery_low_voltage=0.0))
    check_battery(BatteryParams(battery_low_voltage=0.0, battery_ok_voltage=0.0))


# -- sag, emptiness, charger


def step_all(watch, volts, seconds, *, at_rest=False, start=0.0):
    for k in range(round(seconds * 2.5)):
        now = start + k / 2.5
        watch.step(now, Battery(voltage=volts, at=now), at_rest=at_rest)
    return start + seconds


def test_a_sag_under_load_is_no_low_battery_but_a_lasting_one_is():
    watch = BatteryWatch(BatteryParams())
    now = step_all(watch, 11.2, 10.0)
    now = step_all(watch, 10.5, 1.6, start=now)
    assert not watch.is_low
    now = step_all(watch, 11.2, 5.0, start=now)
    step_all(watch, 10.5, 4.0, start=now)
    assert watch.is_low


def test_a_battery_is_empty_below_a_share_or_a_part_of_the_low_voltage():
    watch = BatteryWatch(BatteryParams())
    step_all(watch, 10.3, 6.0)
    assert (watch.is_low, watch.is_empty) == (True, False)
    step_all(watch, 10.2, 6.0, start=10.0)
    assert watch.is_empty
    watch.step(20.0, Battery(share=0.1, at=20.0))
    assert (watch.is_low, watch.is_empty) == (True, False)
    watch.step(21.0, Battery(share=0.07, at=21.0))
    assert watch.is_empty


def test_a_charger_shows_by_a_rise_at_rest_and_goes_with_a_fall_or_a_drive():
    watch = BatteryWatch(BatteryParams())
    now = step_all(watch, 10.6, 20.0, at_rest=True)
    now = step_all(watch, 10.8, 40.0, at_rest=True, start=now)  # recovers from the drive
    assert not watch.is_charging
    now = step_all(watch, 11.2, 20.0, at_rest=True, start=now)
    assert watch.is_charging
    now = step_all(watch, 12.4, 20.0, at_rest=True, start=now)
    assert watch.is_charging
    now = step_all(watch, 12.2, 20.0, at_rest=True, start=now)  # unplugged
    assert not watch.is_charging
    now = step_all(watch, 12.6, 20.0, at_rest=True, start=now)
    assert watch.is_charging
    step_all(watch, 12.6, 1.0, start=now)
    assert not watch.is_charging


def test_a_driver_that_reports_charging_is_believed():
    watch = BatteryWatch(BatteryParams())
    watch.step(0.0, Battery(share=0.1, is_charging=True, at=0.0))
    assert watch.is_charging
