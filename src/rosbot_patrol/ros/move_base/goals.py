"""The action server of move_base and its simple goal topic: they only set or clear the goal."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped
from move_base_msgs.msg import MoveBaseAction, MoveBaseActionGoal, MoveBaseFeedback, MoveBaseResult

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.navigation.interfaces import BAD_QUATERNION, Outcome
from rosbot_patrol.ros.messages.convert import pose2d_from_pose, pose_to_msg
from rosbot_patrol.tf.frames import Frames

log = logging.getLogger(__name__)


class GoalRefusedError(Exception):
    """Error: a goal that cannot be pursued; its text becomes the action's result text."""


def read_pose(msg: PoseStamped, frame: str, transforms: Frames) -> Pose2D:
    """Convert a pose of make_plan to a frame; as upstream, any orientation is accepted.

    Raises:
        GoalRefusedError: a value is not finite, or the frame is unknown.
    """
    try:
        pose = pose2d_from_pose(msg.pose, "the orientation of a pose for make_plan")
    except ValueError as err:
        raise GoalRefusedError(str(err)) from err
    return _in_frame(pose, msg.header.frame_id.lstrip("/"), frame, transforms)


def read_goal(msg: PoseStamped, frame: str, transforms: Frames) -> Pose2D:
    """Convert a goal message to a frame.

    Raises:
        GoalRefusedError: its quaternion is invalid (upstream's text), its position is invalid, or its frame is unknown.
    """
    q, p = msg.pose.orientation, msg.pose.position
    length = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
    if not math.isfinite(length) or length < 1e-6:
        raise GoalRefusedError(BAD_QUATERNION)
    tilt = 1.0 - 2.0 * (q.x * q.x + q.y * q.y) / length  # as upstream, the z axis must point up
    if abs(tilt - 1.0) > 1e-3:
        raise GoalRefusedError(BAD_QUATERNION)
    if not (math.isfinite(p.x) and math.isfinite(p.y)):
        raise GoalRefusedError(f"Aborting on goal because it was sent with an invalid position ({p.x}, {p.y})")
    yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y) / length, 1.0 - 2.0 * (q.y * q.y + q.z * q.z) / length)
    return _in_frame(Pose2D(p.x, p.y, yaw), msg.header.frame_id.lstrip("/"), frame, transforms)


def _in_frame(pose: Pose2D, source: str, frame: str, transforms: Frames) -> Pose2D:
    if source == frame:
        return pose
    try:
        return transforms.lookup(frame, source) @ pose
    except TransformError as err:
        log.error("a goal in frame '%s' cannot be used: %s", source, err)
        text = "The goal pose passed to this planner must be in the {} frame. It is instead in the {} frame."
        raise GoalRefusedError(text.format(frame, source)) from err


class GoalServer:
    """Goals from the action `move_base` and from `move_base_simple/goal`.

    Args:
        frame: frame of the returned goals.
        transforms: the node's tf listener.
        notify: called, on another thread, when a goal arrives or is cancelled.
    """

    def __init__(self, frame: str, transforms: Frames, notify: Callable[[], None]) -> None:
        self._frame = frame
        self._transforms = transforms
        self._pub_goal = rospy.Publisher("move_base/goal", MoveBaseActionGoal, queue_size=1)
        self._pub_current = rospy.Publisher("~current_goal", PoseStamped, queue_size=1)
        self._server = actionlib.SimpleActionServer("move_base", MoveBaseAction, auto_start=False)
        self._server.register_goal_callback(notify)
        self._server.register_preempt_callback(notify)
        rospy.Subscriber("move_base_simple/goal", PoseStamped, self._on_simple, queue_size=1)

    def start(self) -> None:
        """Start to accept goals."""
        self._server.start()

    def _on_simple(self, msg: PoseStamped) -> None:
        goal = MoveBaseActionGoal()
        goal.header.stamp = rospy.Time.now()
        goal.goal.target_pose = msg
        self._pub_goal.publish(goal)

    @property
    def is_active(self) -> bool:
        """Whether there is an active goal."""
        return bool(self._server.is_active())

    @property
    def is_cancelled(self) -> bool:
        """Whether the active goal was cancelled and no other follows."""
        return bool(self._server.is_preempt_requested()) and not self._server.is_new_goal_available()

    def take(self, now: float) -> Pose2D | None:
        """Take a new goal in the global frame, once; None if there is none or it was refused (and the client told)."""
        if not self._server.is_new_goal_available():
            return None
        goal = self._server.accept_new_goal()
        if goal is None:
            return None
        try:
            pose = read_goal(goal.target_pose, self._frame, self._transforms)
        except GoalRefusedError as err:
            log.error("%s", err)
            self._server.set_aborted(MoveBaseResult(), str(err))
            return None
        self._pub_current.publish(pose_to_msg(pose, self._frame, now))
        return pose

    def finish(self, outcome: Outcome) -> None:
        """Send the client the result."""
        if not self._server.is_active():
            return
        end = self._server.set_succeeded if outcome.succeeded else self._server.set_aborted
        end(MoveBaseResult(), outcome.text)

    def preempt(self) -> None:
        """Send the client the confirmation of its cancel request."""
        if self._server.is_active():
            self._server.set_preempted()

    def feedback(self, pose: Pose2D, now: float) -> None:
        """Send the client the robot's pose."""
        if self._server.is_active():
            self._server.publish_feedback(MoveBaseFeedback(base_position=pose_to_msg(pose, self._frame, now)))
