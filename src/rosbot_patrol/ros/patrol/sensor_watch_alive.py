"""The patrol's watch over sensor_watch: each reports if the other hangs, and the patrol whether it hears as much."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import rospy

from rosbot_patrol.msg import SensorStates
from rosbot_patrol.patrol.guard.absence import Absence
from rosbot_patrol.patrol.guard.hearing import Hearing
from rosbot_patrol.patrol.records.commands import OwnerMessage
from rosbot_patrol.ros.runtime.diagnostics import ERROR, OK, WARN, Health

log = logging.getLogger(__name__)

PART, EAR = "sensor_watch", "motion sensors"


class Neighbour:
    """Watch over /sensors/states, which comes at least every 5 s of wall time.

    Args:
        silent_after: silence after which sensor_watch counts as dead or hanging [s].
        notice_after: duration of the silence after which the owner hears of it [s].
        health: health of the patrol.
        listen: subscribes to the motion sensors anew.

    Attributes:
        hearing: has to be told of each message of a sensor.
    """

    def __init__(self, silent_after: float, notice_after: float, health: Health, listen: Callable[[], None]) -> None:
        self.hearing = Hearing()
        self._listen = listen
        self._absence = Absence(silent_after, notice_after)
        self._health = health
        self._is_gone: bool | None = None
        self._is_deaf = False

    def start(self) -> None:
        """Subscribe to /sensors/states."""
        rospy.Subscriber("sensors/states", SensorStates, self._on_states, queue_size=2)

    def _on_states(self, message: SensorStates) -> None:
        now = time.monotonic()
        self._absence.heard(now)
        if self.hearing.told(sum(sensor.messages for sensor in message.sensors), now):
            log.error("the motion sensors are not heard here, but by sensor_watch: the link was cut, listening anew")
            self._health.set(EAR, ERROR, "they are not heard, but sensor_watch hears them: the link was cut")
            self._listen()

    def step(self) -> tuple[OwnerMessage, ...]:
        """Report the state on /diagnostics; returns messages for the owner."""
        now = time.monotonic()
        silence = self._absence.silence(now)
        if self._absence.was_heard and (silence > 0.0) != self._is_gone:
            self._tell(silence)
        if self._is_deaf and not self.hearing.is_deaf:
            log.warning("the motion sensors are heard again")
            self._health.drop(EAR)
        self._is_deaf = self.hearing.is_deaf
        return self._absence.step(now) + self.hearing.step(now)

    def _tell(self, silence: float) -> None:
        if silence > 0.0:
            log.warning("sensor_watch has gone, or hangs: nothing was heard of it for %.0f s", silence)
            self._health.set(PART, WARN, "it has gone, or hangs: nobody tells of motion sensors that fail")
        else:
            log.log(logging.DEBUG if self._is_gone is None else logging.INFO, "sensor_watch is heard")
            self._health.set(PART, OK, "it is heard")
        self._is_gone = silence > 0.0
