"""The console's orders, as calls of services and actions."""

from __future__ import annotations

import logging
import threading
import time
from typing import Any

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped, Twist
from std_srvs.srv import SetBool, Trigger

from rosbot_patrol.console.live.hub import Hub
from rosbot_patrol.console.live.orders import Answer
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.msg import PatrolAction, PatrolGoal
from rosbot_patrol.ros.messages.convert import pose_to_msg
from rosbot_patrol.ros.runtime.node import Worker, now
from rosbot_patrol.srv import Arm, Mute

log = logging.getLogger(__name__)

_PATIENCE = 3.0  # [s] for a service
_DEAD_MAN = 0.3  # [s] after the last command by hand the robot stands still
_PERIOD = 0.1  # [s] between two commands
_FASTEST, _QUICKEST = 0.3, 1.0  # [m/s], [rad/s] by hand


class RosRobot:
    """Carries out what people order.

    Args:
        hub: knows what the guard does.
    """

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._patrol = actionlib.ActionClient("patrol", PatrolAction)
        self._goals: list[Any] = []  # a goal without a handle reports nothing
        self._goal = rospy.Publisher("move_base_simple/goal", PoseStamped, queue_size=1)
        self._wheels = rospy.Publisher("cmd_vel/teleop", Twist, queue_size=1)
        self._lock = threading.Lock()
        self._wanted, self._wanted_at = Twist(), float("-inf")
        self._has_order = threading.Event()
        Worker(self._drive, name="driving").start()

    def look(self, room_id: int) -> Answer:
        """Look at a room now."""
        if not self._patrol.wait_for_server(rospy.Duration.from_sec(_PATIENCE)):
            return Answer(accepted=False, text="The guard does not answer.")
        self._goals = [*self._goals[-10:], self._patrol.send_goal(PatrolGoal(rooms=[room_id]))]
        return Answer(accepted=True, text="the robot looks there, after the rooms that sensors call for")

    def look_at_all(self) -> Answer:
        """Look at all rooms."""
        return self._trigger("patrol/all")

    def home(self) -> Answer:
        """Give up what runs, and drive home."""
        return self._trigger("patrol/home")

    def cancel(self) -> Answer:
        """Give up what runs."""
        return self._trigger("patrol/cancel")

    def stop(self, *, pressed: bool) -> Answer:
        """Press or release the emergency stop."""
        self._release()
        response = _call("patrol/emergency_stop", SetBool, pressed)
        if isinstance(response, Answer):
            return response
        return Answer(accepted=bool(response.success), text=response.message)

    def arm(self, mode: str) -> Answer:
        """Change the mode."""
        response = _call("patrol/arm", Arm, mode)
        if isinstance(response, Answer):
            return response
        return Answer(accepted=bool(response.accepted), text=response.message)

    def mute(self, room_id: int, seconds: float) -> Answer:
        """Let the sensors of a room start no mission for a while, 0: let them count again."""
        response = _call("patrol/mute", Mute, room_id, seconds)
        if isinstance(response, Answer):
            return response
        return Answer(accepted=bool(response.accepted), text=response.message)

    def drive_to(self, x: float, y: float) -> Answer:
        """Drive to a place in map [m]."""
        guard = self._hub.state.guard
        if guard is not None and guard.doing not in ("idle", "starting"):
            return Answer(accepted=False, text="the guard is on a mission: give that up first")
        if self._goal.get_num_connections() == 0:
            return Answer(accepted=False, text="nothing drives the robot: move_base does not run")
        robot = self._hub.scene.robot
        yaw = robot[2] if robot is not None else 0.0
        self._goal.publish(pose_to_msg(Pose2D(x, y, yaw), "map", now()))
        return Answer(accepted=True, text="the robot drives there, if there is a way")

    def drive(self, forward: float, turn: float) -> None:
        """Drive by hand, for 0.3 s."""
        twist = Twist()
        twist.linear.x, twist.angular.z = forward * _FASTEST, turn * _QUICKEST
        with self._lock:
            self._wanted, self._wanted_at = twist, time.monotonic()
        self._has_order.set()

    def _release(self) -> None:
        with self._lock:
            self._wanted_at = float("-inf")

    def _drive(self) -> None:
        """Repeat the command while it is fresh; then stand still once, and leave the wheels to others."""
        while not rospy.is_shutdown():
            if not self._has_order.wait(1.0):
                continue
            with self._lock:
                is_fresh = time.monotonic() - self._wanted_at <= _DEAD_MAN
                twist = self._wanted if is_fresh else Twist()
                if not is_fresh:
                    self._has_order.clear()
            self._wheels.publish(twist)
            time.sleep(_PERIOD if is_fresh else 0.0)

    def _trigger(self, name: str) -> Answer:
        response = _call(name, Trigger)
        if isinstance(response, Answer):
            return response
        return Answer(accepted=bool(response.success), text=response.message)


def _call(name: str, kind: Any, *values: Any) -> Any:
    """The response of a service, or the answer why there is none."""
    try:
        rospy.wait_for_service(name, _PATIENCE)
        return rospy.ServiceProxy(name, kind)(*values)
    except (rospy.ROSException, rospy.ServiceException) as err:
        log.warning("%s: %s", name, err)
        return Answer(accepted=False, text="The guard does not answer.")
