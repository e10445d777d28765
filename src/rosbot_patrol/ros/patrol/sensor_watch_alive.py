"""The patrol's watch over sensor_watch; each of the two reports if the other hangs."""

from __future__ import annotations

import logging
import time

import rospy

from rosbot_patrol.msg import SensorStates
from rosbot_patrol.patrol.guard.absence import Absence
from rosbot_patrol.patrol.records.commands import OwnerMessage
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN, Health

log = logging.getLogger(__name__)

PART = "sensor_watch"


class Neighbour:
    """Watch over /sensors/states, which comes at least every 5 s of wall time.

    Args:
        silent_after: silence after which sensor_watch counts as dead or hanging [s].
        notice_after: duration of the silence after which the owner hears of it [s].
        health: health of the patrol.
    """

    def __init__(self, silent_after: float, notice_after: float, health: Health) -> None:
        self._absence = Absence(silent_after, notice_after)
        self._health = health
        self._is_gone: bool | None = None

    def start(self) -> None:
        """Subscribe to /sensors/states."""
        rospy.Subscriber("sensors/states", SensorStates, self._on_states, queue_size=2)

    def _on_states(self, _: SensorStates) -> None:
        self._absence.heard(time.monotonic())

    def step(self) -> tuple[OwnerMessage, ...]:
        """Report the state on /diagnostics; returns messages for the owner."""
        now = time.monotonic()
        silence = self._absence.silence(now)
        if self._absence.was_heard and (silence > 0.0) != self._is_gone:
            self._tell(silence)
        return self._absence.step(now)

    def _tell(self, silence: float) -> None:
        if silence > 0.0:
            log.warning("sensor_watch has gone, or hangs: nothing was heard of it for %.0f s", silence)
            self._health.set(PART, WARN, "it has gone, or hangs: nobody tells of motion sensors that fail")
        else:
            log.log(logging.DEBUG if self._is_gone is None else logging.INFO, "sensor_watch is heard")
            self._health.set(PART, OK, "it is heard")
        self._is_gone = silence > 0.0
