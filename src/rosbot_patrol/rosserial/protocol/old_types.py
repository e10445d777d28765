"""Message types of old firmware whose definition changed between ROS melodic and noetic.

A device announces the MD5 sum of the definition that it was built with. Its bytes are rewritten to the newer
definition, and those sent to it to the older one. sensor_msgs/BatteryState is the only such type that a ROSbot sends:
noetic added `temperature` after `voltage`, and `cell_temperature` after `cell_voltage`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import NamedTuple

from rosbot_patrol.errors import ProtocolError

_NAN = struct.pack("<f", float("nan"))
_TEXT_AT = 12  # offset of a header's frame_id, after seq and stamp
_LEVELS = 24  # current to percentage, status to present [bytes]


class OldType(NamedTuple):
    """The older definition of a type.

    Attributes:
        name: "package/Type".
        old, new: MD5 sums of the definitions.
        upgrade: converts older bytes to newer ones; downgrade: the reverse. Both raise ProtocolError.
    """

    name: str
    old: str
    new: str
    upgrade: Callable[[bytes], bytes]
    downgrade: Callable[[bytes], bytes]


def find_old_type(message_type: str, theirs: str, ours: str) -> OldType | None:
    """Find the older definition that a device has of a type; None if it is unknown here.

    Args:
        message_type: "package/Type".
        theirs: MD5 sum of the device's definition.
        ours: MD5 sum of the workspace's definition.
    """
    for each in OLD_TYPES:
        if (each.name, each.old, each.new) == (message_type, theirs, ours):
            return each
    return None


def _after_numbers(data: bytes, at: int) -> tuple[int, int]:
    """Length of an array of 4-byte numbers, and the offset of its end."""
    try:
        (count,) = struct.unpack_from("<I", data, at)
    except struct.error as err:
        raise ProtocolError("", f"a BatteryState of {len(data)} bytes ends too early") from err
    end = at + 4 + 4 * count
    if end > len(data):
        raise ProtocolError("", f"a BatteryState of {len(data)} bytes ends in an array of {count} cells")
    return count, end


def _voltage_at(data: bytes) -> int:
    try:
        (length,) = struct.unpack_from("<I", data, _TEXT_AT)
    except struct.error as err:
        raise ProtocolError("", f"a BatteryState of {len(data)} bytes ends too early") from err
    return _TEXT_AT + 4 + int(length)


def _upgrade_battery(data: bytes) -> bytes:
    levels = _voltage_at(data) + 4
    cells = levels + _LEVELS
    count, end = _after_numbers(data, cells)
    temperatures = struct.pack("<I", count) + _NAN * count
    return data[:levels] + _NAN + data[levels:end] + temperatures + data[end:]


def _downgrade_battery(data: bytes) -> bytes:
    temperature = _voltage_at(data) + 4
    levels = temperature + 4
    _, cells_end = _after_numbers(data, levels + _LEVELS)
    _, temperatures_end = _after_numbers(data, cells_end)
    return data[:temperature] + data[levels:cells_end] + data[temperatures_end:]


OLD_TYPES = (
    OldType(
        "sensor_msgs/BatteryState",
        "476f837fa6771f6e16e3bf4ef96f8770",
        "4ddae7f048e32fda22cac764685e3974",
        _upgrade_battery,
        _downgrade_battery,
    ),
)
