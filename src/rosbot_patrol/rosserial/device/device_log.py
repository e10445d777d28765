"""Log lines of a motion sensor that the bridge understands; the firmware writes the same sentences."""

from __future__ import annotations

import re

WARN = 2  # rosserial_msgs/Log
STUCK_AFTER = 600.0  # [s]; the HC-SR501 holds its output for 300 s at most

_STUCK = re.compile(r"sensor (\d{1,3}): its output has been high for \d+ s")


def stuck_line(sensor_id: int, seconds: float) -> str:
    """Log line for a stuck output; the sensor reports rising edges only, so nothing else shows it."""
    return f"sensor {sensor_id}: its output has been high for {seconds:.0f} s"


def read_stuck_line(text: str) -> int | None:
    """The sensor id in such a line, None for any other line."""
    match = _STUCK.search(text)
    return int(match[1]) if match else None
