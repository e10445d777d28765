"""Motion sensors for which a device may speak: those of the list, or the one it has proved to be."""

from __future__ import annotations

from rosbot_patrol.counts import count_of


class Voice:
    """Permitted sensors of one connection.

    Args:
        allowed: sensor ids permitted to its peer, None: any.
        most: maximum number of sensors that it may speak for.

    Attributes:
        proven_id: the sensor that it has proved to be, None if it has not.
    """

    def __init__(self, allowed: frozenset[int] | None, most: int) -> None:
        self.proven_id: int | None = None
        self._allowed = allowed
        self._most = most
        self._heard: set[int] = set()

    def prove(self, sensor_id: int) -> bool:
        """Restrict it to the sensor that it has proved to be; False if the list forbids that."""
        if self._allowed is not None and sensor_id not in self._allowed:
            return False
        self.proven_id = sensor_id
        self._allowed = frozenset((sensor_id,))
        return True

    def may_say(self, trigger: bytes) -> bool:
        """Whether it may send that EspTrigger."""
        if not trigger or trigger[0] in self._heard:
            return True
        if self._allowed is not None and trigger[0] not in self._allowed:
            return False
        if len(self._heard) >= self._most:
            return False
        self._heard.add(trigger[0])
        return True

    def why_not(self, trigger: bytes) -> str:
        """Reason why it may not."""
        if self.proven_id is not None:
            return f"it has proved to be sensor {self.proven_id}"
        if self._allowed is not None and trigger[0] not in self._allowed:
            return "the list has it as another sensor, or as none (~allow_sensors)"
        return f"it speaks for {count_of(len(self._heard), 'other')} already"
