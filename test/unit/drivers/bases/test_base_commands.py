"""Commands to a base: limits, time-out, repetition; and the share of a battery."""

from __future__ import annotations

import math

import pytest

from rosbot_patrol.drivers.bases.adapter import AdapterParams, CommandGate, check_adapter, share_of_voltage
from rosbot_patrol.errors import ParamError
from rosbot_patrol.geometry import STOP, Twist2D


def test_commands_are_limited_and_nonsense_stops() -> None:
    gate = CommandGate(AdapterParams(max_speed=0.3, max_turn=1.0))
    assert gate.take(Twist2D(2.0, 0.0, -3.0), 0.0) == Twist2D(0.3, 0.0, -1.0)
    assert gate.take(Twist2D(math.nan, 0.0, 0.1), 0.1) == STOP


def test_the_base_is_stopped_once_after_the_last_command() -> None:
    gate = CommandGate(AdapterParams(command_timeout=0.5))
    assert gate.due(0.0) is None
    gate.take(Twist2D(0.2, 0.0, 0.0), 1.0)
    assert gate.due(1.4) is None
    assert gate.due(1.5) == STOP
    assert gate.due(1.6) is None


def test_commands_are_repeated_for_a_base_that_wants_it() -> None:
    gate = CommandGate(AdapterParams(command_rate=10.0))
    gate.take(Twist2D(0.2, 0.0, 0.0), 0.0)
    assert [gate.due(at) for at in (0.05, 0.1, 0.15, 0.2)] == [
        *(None, Twist2D(0.2, 0.0, 0.0), None, Twist2D(0.2, 0.0, 0.0))
    ]
    assert gate.due(0.5) == STOP
    assert gate.due(0.61) == STOP


def test_the_share_of_a_voltage() -> None:
    assert [share_of_voltage(volts, 9.0, 12.0) for volts in (8.0, 9.0, 10.5, 13.0)] == [0.0, 0.0, 0.5, 1.0]
    assert math.isnan(share_of_voltage(math.nan, 9.0, 12.0))
    with pytest.raises(ParamError, match=r"/n/battery_full: is 9, expected more than battery_flat 9.9"):
        check_adapter(AdapterParams(battery_full=9.0), "/n/")
