"""Calls that the bridge received while the patrol was down, from sensor_watch's last call of each sensor."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from pathlib import Path

import rospy

from rosbot_patrol.counts import count_of
from rosbot_patrol.msg import SensorStates
from rosbot_patrol.patrol.calls.liveness import Vigil
from rosbot_patrol.patrol.calls.repeats import Repeats
from rosbot_patrol.patrol.records.commands import OwnerMessage
from rosbot_patrol.patrol.records.request import Request
from rosbot_patrol.ros.runtime.node import now
from rosbot_patrol.sensors.problems import duration

log = logging.getLogger(__name__)

_LISTEN = 15.0  # longest wait: sensor_watch reports all sensors every five seconds [s]


class MissedCalls:
    """One query, after the start, for the calls in the gap.

    Args:
        path: file of the patrol's signs of life.
        ask: receives the missed calls.
        room_of: room of a sensor's id, None if it has none.
        tell: receives what the owner has to know.
    """

    def __init__(
        self,
        path: Path,
        ask: Callable[[Request], None],
        room_of: Callable[[int], int | None],
        tell: Callable[[OwnerMessage], None],
    ) -> None:
        self._ask, self._room_of, self._tell = ask, room_of, tell
        self._wall = time.time()
        self._vigil = Vigil(path, self._wall)
        if self._vigil.problem:
            log.error(
                "%s cannot be used: %s; calls of the time before the start may be missed", path, self._vigil.problem
            )
        self._refused = Repeats(600.0)
        self._began = time.monotonic()
        self._heard = 0
        self._subscriber: rospy.Subscriber | None = None
        self._missed: int | None = None  # sensors that called in the gap, None: not known yet
        self._is_told = self._vigil.down is None

    def start(self) -> None:
        """Start listening, if there was a gap."""
        if self._vigil.has_gap:
            self._subscriber = rospy.Subscriber("sensors/states", SensorStates, self._on_states, queue_size=5)

    def step(self) -> None:
        """Write a sign of life; stop listening after a while; tell the owner once how long the guard was down."""
        try:
            self._vigil.step(time.time())
        except OSError as err:
            if self._refused.is_news(0, now()):
                log.error("no sign of life can be left: %s; calls of a restart may be missed", err)
        if self._subscriber is not None and time.monotonic() - self._began > _LISTEN:
            self._subscriber.unregister()
            self._subscriber = None
        if not self._is_told and (self._missed is not None or self._subscriber is None):
            self._is_told = True
            self._tell(
                OwnerMessage(
                    kind="the guard was down", text=down_text(self._vigil.down or self._wall, self._wall, self._missed)
                )
            )

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
        missed = 0
        for sensor in message.sensors:
            wall = time.time() - sensor.motion
            is_missed = sensor.motion >= 0.0 and self._vigil.missed(wall)
            room = self._room_of(sensor.id) if is_missed else None
            if room is not None:
                note = f"its sensor called {sensor.motion:.0f} s ago, while the patrol was down"
                log.warning("room %d: %s", room, note)
                self._ask(Request(room_id=room, wall=wall, note=note))
                missed += 1
        self._missed = missed


def down_text(begin: float, end: float, missed: int | None) -> str:
    """One sentence about a gap; times in seconds since 1970; `missed`: sensors that called in it, None: not known."""
    times = [time.strftime("%Y-%m-%d %H:%M:%S %Z", time.localtime(wall)) for wall in (begin, end)]
    if missed is None:
        calls = "calls of motion sensors in that time are not known"
    elif missed:
        calls = f"{count_of(missed, 'motion sensor')} called in that time, and the robot looks there now"
    else:
        calls = "no motion sensor called in that time, as far as the sensors' watch knows"
    return f"the guard was down from {times[0]} to {times[1]} ({duration(end - begin)}); {calls}"
