"""Calls that the bridge received while the patrol was down, from sensor_watch's last call of each sensor."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from pathlib import Path

import rospy

from rosbot_patrol.msg import SensorStates
from rosbot_patrol.patrol.calls.liveness import Vigil
from rosbot_patrol.patrol.calls.repeats import Repeats
from rosbot_patrol.patrol.records.request import Request
from rosbot_patrol.ros.runtime.node import now

log = logging.getLogger(__name__)

_LISTEN = 15.0  # longest wait: sensor_watch reports all sensors every five seconds [s]


class MissedCalls:
    """One query, after the start, for the calls in the gap.

    Args:
        path: file of the patrol's signs of life.
        ask: receives the missed calls.
        room_of: room of a sensor's id, None if it has none.
    """

    def __init__(self, path: Path, ask: Callable[[Request], None], room_of: Callable[[int], int | None]) -> None:
        self._ask, self._room_of = ask, room_of
        self._vigil = Vigil(path, time.time())
        if self._vigil.problem:
            log.error(
                "%s cannot be used: %s; calls of the time before the start may be missed", path, self._vigil.problem
            )
        self._refused = Repeats(600.0)
        self._began = time.monotonic()
        self._heard = 0
        self._subscriber: rospy.Subscriber | None = None

    def start(self) -> None:
        """Start listening, if there was a gap."""
        if self._vigil.has_gap:
            self._subscriber = rospy.Subscriber("sensors/states", SensorStates, self._on_states, queue_size=5)

    def step(self) -> None:
        """Write a sign of life; stop listening after a while."""
        try:
            self._vigil.step(time.time())
        except OSError as err:
            if self._refused.is_news(0, now()):
                log.error("no sign of life can be left: %s; calls of a restart may be missed", err)
        if self._subscriber is not None and time.monotonic() - self._began > _LISTEN:
            self._subscriber.unregister()
            self._subscriber = None

    def end(self) -> None:
        """Record a regular end of the patrol."""
        try:
            self._vigil.end()
        except OSError as err:
            log.error("the sign of life cannot be taken away: %s", err)

    def _on_states(self, message: SensorStates) -> None:
        self._heard += 1
        if self._heard != 2:  # the first is latched, of unknown age; those after the second add nothing
            return
        for sensor in message.sensors:
            wall = time.time() - sensor.motion
            is_missed = sensor.motion >= 0.0 and self._vigil.missed(wall)
            room = self._room_of(sensor.id) if is_missed else None
            if room is not None:
                note = f"its sensor called {sensor.motion:.0f} s ago, while the patrol was down"
                log.warning("room %d: %s", room, note)
                self._ask(Request(room_id=room, wall=wall, note=note))
