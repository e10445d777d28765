"""What a motion sensor logs about itself that the bridge understands; the firmware writes the same sentences."""

from __future__ import annotations

import re

WARN = 2  # rosserial_msgs/Log
STUCK_AFTER = 600.0  # [s]; the HC-SR501 holds its output for 300 s at most

_STUCK = re.compile(r"sensor (\d{1,3}): its output has been high for \d+ s")


def stuck_line(sensor_id: int, seconds: float) -> str:
    """The output of the motion sensor does not fall any more; as it reports rises only, nothing else tells."""
    return f"sensor {sensor_id}: its output has been high for {seconds:.0f} s"


def read_stuck_line(text: str) -> int | None:
    """The sensor id of such a line, None for any other."""
    match = _STUCK.search(text)
    return int(match[1]) if match else None
