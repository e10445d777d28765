"""Turn of the robot on the spot while amcl searches: one scan may fit many places, the scans of a turn fit fewer.

It drives on `~cmd_vel`, where amcl publishes nothing at other times. In our launch files that is a source of twist_mux
above move_base, with the collision guard behind it.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable

import rospy
from geometry_msgs.msg import Twist

from rosbot_patrol.errors import TransformError
from rosbot_patrol.patrol.search.turn import Spin, SpinParams
from rosbot_patrol.ros.runtime.node import Worker, now
from rosbot_patrol.ros.runtime.transforms import Transforms

log = logging.getLogger(__name__)

STEP_S, IDLE_S = 0.05, 0.5  # of wall time
PARAMS = SpinParams(spin_speed=0.6)


class LookAround:
    """Turn the robot once on request.

    Args:
        transforms: the node's tf.
        odom: odometry frame.
        base: robot frame.
        is_over: whether the robot has been found, so that the turn may end early.
    """

    def __init__(self, transforms: Transforms, odom: str, base: str, is_over: Callable[[], bool]) -> None:
        self._transforms, self._odom, self._base = transforms, odom, base
        self._is_over = is_over
        self._lock = threading.Lock()
        self._spin: Spin | None = None
        self._wanted = threading.Event()
        self._publisher = rospy.Publisher("~cmd_vel", Twist, queue_size=1)

    def start(self) -> None:
        """Start a turn, or start it again."""
        with self._lock:
            self._spin = Spin(math.tau, params=PARAMS)
            self._wanted.set()

    def watch(self) -> None:
        """Prepare for turns."""
        Worker(self._work, name="look around").start()

    def _work(self) -> None:
        while not rospy.is_shutdown():
            if self._wanted.wait(IDLE_S):
                self._step()
                time.sleep(STEP_S)

    def _step(self) -> None:
        with self._lock:
            spin = self._spin
            if spin is None:
                self._wanted.clear()
                return
        step = spin.step(now(), self._yaw())
        is_found = self._is_over()
        twist = Twist()
        twist.angular.z = 0.0 if is_found else step.speed
        self._publisher.publish(twist)
        if not (is_found or step.done):
            return
        with self._lock:
            if self._spin is spin:
                self._spin = None
        if step.problem:
            log.warning("the look around for the search is over: %s", step.problem)
        elif not is_found:
            log.warning("looked around once without finding the robot on the map: the search goes on as it drives")

    def _yaw(self) -> float | None:
        try:
            return self._transforms.lookup(self._odom, self._base).yaw
        except TransformError:
            return None
