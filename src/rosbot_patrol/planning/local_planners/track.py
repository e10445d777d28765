"""The plan that a local planner follows, and the part of it that lies behind."""

from __future__ import annotations

import math

import numpy as np

from rosbot_patrol.errors import ControlError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.planning.critics import critic_kernels as kernels
from rosbot_patrol.planning.interfaces import Array, LocalView


class Track:
    """A plan, the robot's progress on it, and whether the robot has reached the goal's position."""

    def __init__(self) -> None:
        self.poses: Array = np.empty((0, 3))
        self.passed = 0
        self.behind = 0  # number of poses of the last visible part that lie behind
        self.xy_reached = False

    def take(self, poses: Array) -> bool:
        """Follow a new plan, shape (N, 3); returns whether its goal differs from the previous one.

        Raises:
            ControlError: it has no poses, or some that are no numbers.
        """
        poses = np.array(poses, dtype=np.float64, order="C")
        if len(poses) == 0:
            raise ControlError("a plan without poses cannot be followed")
        if poses.ndim != 2 or poses.shape[1] != 3 or not np.isfinite(poses).all():
            raise ControlError("a plan with poses that are no numbers cannot be followed")
        is_new = len(self.poses) == 0 or not np.allclose(self.poses[-1], poses[-1], atol=1e-6)
        self.poses, self.passed = poses, 0
        if is_new:
            self.xy_reached = False
        return is_new

    def goal(self, view: LocalView) -> Pose2D:
        """The plan's end in the local costmap's frame."""
        return view.local_from_plan @ Pose2D(*self.poses[-1].tolist())

    def is_at_goal(self, view: LocalView, *, tolerance: float, latch: bool) -> bool:
        """Whether the robot is at the goal's position, or with `latch` has been there."""
        goal = self.goal(view)
        near = math.hypot(goal.x - view.pose.x, goal.y - view.pose.y) <= tolerance
        if near and latch:
            self.xy_reached = True
        return near or self.xy_reached

    def part_in_view(self, view: LocalView, *, prune: bool) -> Array:
        """Visible part of the plan in the local frame: from the robot to where it leaves the local costmap.

        Args:
            view: input of this cycle.
            prune: drop the part behind the robot.

        Raises:
            ControlError: it does not pass through the local costmap.
        """
        info = view.costmap.info
        width, height = info.size
        edge = info.resolution
        window = np.array(
            [
                info.origin_x + edge,
                info.origin_x + width - 1.001 * edge,
                info.origin_y + edge,
                info.origin_y + height - 1.001 * edge,
            ]
        )
        place = np.array(view.local_from_plan, dtype=np.float64)
        here = np.array([view.pose.x, view.pose.y], dtype=np.float64)
        poses, nearest, self.behind = kernels.cut_plan(self.poses, self.passed, place, here, window, prune)
        if len(poses) == 0:
            raise ControlError("the plan does not pass through the local costmap")
        self.passed = nearest
        return poses
