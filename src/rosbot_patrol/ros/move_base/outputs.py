"""Outputs of move_base: velocities, plans, recovery status and health."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rospy
from geometry_msgs.msg import Twist
from move_base_msgs.msg import RecoveryStatus
from nav_msgs.msg import Path
from numpy.typing import NDArray

from rosbot_patrol.costmap.fed import FedCostmap
from rosbot_patrol.geometry import Twist2D
from rosbot_patrol.navigation.interfaces import Command, Reason, State
from rosbot_patrol.planning.interfaces import LocalPlanner
from rosbot_patrol.ros.messages.convert import path_to_msg, twist_to_msg
from rosbot_patrol.ros.runtime.diagnostics import ERROR, OK, WARN, Health
from rosbot_patrol.ros.runtime.node import now

_SHOWN_POSES = 400
_HEALTH_PERIOD = 1.0


class Outputs:
    """The topics of move_base besides the action's and the costmaps'; messages without a subscriber are not built.

    Args:
        global_name: namespace of the global planner's plan.
        local_name: namespace of the local planner's plan.
        global_frame: frame of global plans.
        local_frame: frame of the local planner's outputs.
    """

    def __init__(self, global_name: str, local_name: str, *, global_frame: str, local_frame: str) -> None:
        self._frames = global_frame, local_frame
        self._cmd = rospy.Publisher("cmd_vel", Twist, queue_size=1)
        self._plan = rospy.Publisher(f"~{global_name}/plan", Path, queue_size=1)
        self._global_plan = rospy.Publisher(f"~{local_name}/global_plan", Path, queue_size=1)
        self._local_plan = rospy.Publisher(f"~{local_name}/local_plan", Path, queue_size=1)
        self._recovery = rospy.Publisher("move_base/recovery_status", RecoveryStatus, queue_size=1)

    def send(self, twist: Twist2D) -> None:
        """Send a velocity to the base."""
        self._cmd.publish(twist_to_msg(twist))

    def publish(self, command: Command, controller: LocalPlanner, time: float) -> None:
        """Publish the results of a navigator step."""
        if command.twist is not None:
            self.send(command.twist)
        if command.recovery is not None:
            self._tell_recovery(command.recovery, time)
        if command.plan is not None:
            self._show(self._plan, command.plan, self._frames[0], time)
        if command.reason is Reason.DRIVING:
            self._show(self._global_plan, controller.visible_plan, self._frames[1], time)
            self._show(self._local_plan, controller.local_plan, self._frames[1], time)

    def _show(self, publisher: rospy.Publisher, poses: NDArray[np.float64], frame: str, time: float) -> None:
        if publisher.get_num_connections() == 0:
            return
        if len(poses) > _SHOWN_POSES:
            keep = np.linspace(0, len(poses) - 1, _SHOWN_POSES).astype(int)
            poses = poses[keep]
        publisher.publish(path_to_msg(poses, frame, time))

    def _tell_recovery(self, recovery: tuple[int, int, str], time: float) -> None:
        msg = RecoveryStatus()
        msg.current_recovery_number, msg.total_number_of_recoveries, msg.recovery_behavior_name = recovery
        msg.pose_stamped.header.stamp = rospy.Time.from_sec(time)
        self._recovery.publish(msg)


class HealthTeller:
    """Report move_base's health on /diagnostics, once a second.

    Args:
        costmaps: the global one and the local one.
    """

    def __init__(self, costmaps: Sequence[FedCostmap]) -> None:
        self._health = Health()
        self._costmaps = costmaps
        self._due = float("-inf")

    def tell(self, time: float, state: State, reason: str, slow_cycles: int) -> None:
        """Publish if it is due."""
        if self._due - _HEALTH_PERIOD <= time < self._due:
            return
        self._due = time + _HEALTH_PERIOD
        values = {"state": state.value, "reason": reason, "slow cycles": slow_cycles}
        troubles = [text for costmap in self._costmaps for text in costmap.troubles(now())]
        problems = [f"{c.name}: {c.problem}" for c in self._costmaps if c.problem]
        if problems:
            self._health.set("", WARN if state is State.IDLE else ERROR, "; ".join(problems), values)
        elif state is not State.IDLE and not self._costmaps[-1].is_current(time):
            self._health.set("", ERROR, "; ".join(["sensor data is out of date", *troubles]), values)
        elif troubles:
            self._health.set("", WARN, "; ".join(troubles), values)
        else:
            self._health.set("", OK, state.value, values)
