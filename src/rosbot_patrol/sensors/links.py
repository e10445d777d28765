"""Connections over which a bridge hears its sensors, as it reports them to the supervision."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rosbot_patrol.rosserial.device.device_log import read_stuck_line
from rosbot_patrol.sensors.problems import Link

MAX_LINKS = 2000  # a gateway may speak for many sensors; beyond this number the longest silent one is forgotten


@dataclass(slots=True)
class _Heard:
    at: float
    messages: int = 0
    triggers: int = 0
    is_stuck: bool = False


class Links:
    """Counts messages by sensor and connection; cheap, because it runs for each message."""

    def __init__(self) -> None:
        self._heard: dict[tuple[int, str], _Heard] = {}

    def __len__(self) -> int:
        return len(self._heard)

    def heard(self, sensor_id: int, peer: str, now: float, *, move: bool) -> bool:
        """Count a message; returns whether it is this sensor's first on this connection."""
        heard = self._heard.get((sensor_id, peer))
        is_new = heard is None
        if heard is None:
            if len(self._heard) >= MAX_LINKS:
                del self._heard[min(self._heard, key=lambda key: self._heard[key].at)]
            heard = self._heard[sensor_id, peer] = _Heard(now)
        heard.at = now
        heard.messages += 1
        if move:
            heard.triggers += 1
            heard.is_stuck = False  # the output fell and rose again
        return is_new

    def logged(self, peer: str, text: str) -> bool:
        """Evaluate a log line of the device; returns whether it changes anything."""
        sensor_id = read_stuck_line(text)
        heard = None if sensor_id is None else self._heard.get((sensor_id, peer))
        if heard is None or heard.is_stuck:
            return False
        heard.is_stuck = True
        return True

    def closed(self, peer: str) -> bool:
        """End a connection; returns whether a sensor was heard on it."""
        ended = [key for key in self._heard if key[1] == peer]
        for key in ended:
            del self._heard[key]
        return bool(ended)

    def snapshot(self, now: float, of_peer: Callable[[str], tuple[bool, float | None]]) -> list[Link]:
        """All links; `of_peer` returns whether a connection is proven, and how far its clock is ahead [s]."""
        found = []
        for (sensor_id, peer), heard in self._heard.items():
            proven, clock_offset = of_peer(peer)
            found.append(
                Link(
                    sensor_id=sensor_id,
                    peer=peer,
                    heard=max(now - heard.at, 0.0),
                    messages=heard.messages,
                    triggers=heard.triggers,
                    proven=proven,
                    is_stuck=heard.is_stuck,
                    clock_offset=clock_offset,
                )
            )
        return found
