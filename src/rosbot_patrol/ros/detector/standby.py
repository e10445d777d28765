"""Standby of a detector for another one, such as the robot's for the PC's: active while the other is silent."""

from __future__ import annotations

import logging
import time

import rospy
from darknet_ros_msgs.msg import ObjectCount

from rosbot_patrol.ros.runtime.diagnostics import OK, WARN, Health

log = logging.getLogger(__name__)

PART = "standing in"


class Standby:
    """Watch for another detector, by the topic that counts objects: a detector publishes it with each picture.

    It uses wall time, because a dead machine must be noticed in simulations too.

    Args:
        topic: topic of the count.
        after: silence of the other after which this one is active [s]; 0: there is no other.
        health: receives the state.
    """

    def __init__(self, topic: str, after: float, health: Health) -> None:
        self._topic, self._after, self._health = topic, after, health
        self._heard = time.monotonic()
        self._other = ""
        self._is_working: bool | None = None
        if after > 0.0:
            rospy.Subscriber(topic, ObjectCount, self._hear, queue_size=1)

    def is_wanted(self) -> bool:
        """Whether this detector must work now; logs each change."""
        if self._after <= 0.0:
            return True
        is_working = time.monotonic() - self._heard > self._after
        if is_working != self._is_working:
            self._is_working = is_working
            self._tell()
        return is_working

    def _hear(self, message: ObjectCount) -> None:
        sender = str(message._connection_header["callerid"])
        if sender != rospy.get_name():
            self._heard, self._other = time.monotonic(), sender

    def _tell(self) -> None:
        if not self._is_working:
            text = f"{self._other or 'another detector'} looks at pictures"
            log.info("standing by: %s", text)
            self._health.set(PART, OK, text)
            return
        who = f"{self._other} has gone" if self._other else f"no other detector on {rospy.resolve_name(self._topic)}"
        text = f"{who}: looks at pictures in its place"
        log.warning(text)
        self._health.set(PART, WARN, text)
