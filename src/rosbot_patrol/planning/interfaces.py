"""Interfaces of global planners, local planners and recovery behaviours, without ROS."""

# ruff: noqa: B027 - a planner overrides only the hooks that it needs
from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.grid import Grid

Array = NDArray[np.float64]


class GlobalPlanner(ABC):
    """Plans a path over a costmap."""

    @abstractmethod
    def plan(self, costmap: Grid, start: Pose2D, goal: Pose2D, *, tolerance: float | None = None) -> Array:
        """Plan from start to goal: poses, shape (N, 3), in the costmap's frame.

        Args:
            costmap: costs; may be written to.
            start: in the costmap's frame.
            goal: in the costmap's frame.
            tolerance: maximum distance of the plan's end from the goal [m]; None: the planner's own parameter.

        Raises:
            PlanningError: StartOccupied, GoalOccupied, OutOfBounds or NoPath.
        """


@dataclass(frozen=True, kw_only=True)
class LocalView:
    """Input of a local planner in one control cycle, all in the local costmap's frame.

    Attributes:
        now: time [s].
        pose, velocity: the robot's.
        costmap: costs around it (a copy, may be written to).
        local_from_plan: pose of the plan's frame in the local costmap's.
    """

    now: float
    pose: Pose2D
    velocity: Twist2D
    costmap: Grid
    local_from_plan: Pose2D = Pose2D()


class LocalPlanner(ABC):
    """Computes velocities that follow a plan."""

    @abstractmethod
    def set_plan(self, poses: Array) -> None:
        """Follow a plan of shape (N, 3), in the plan's frame; raises ControlError if it cannot."""

    @abstractmethod
    def compute(self, view: LocalView) -> Twist2D:
        """Velocity for this cycle; raises ControlError if none is safe."""

    @abstractmethod
    def is_goal_reached(self, view: LocalView) -> bool:
        """Whether the robot stands at the plan's end."""

    def reset(self) -> None:
        """Forget the current goal."""

    def fit(self, footprint: Footprint, *, resolution: float) -> None:
        """Use another padded outline of the robot, or cells of another size [m]."""

    def limit_speed(self, trans: float, rot: float, *, distance: float) -> None:
        """Limit the speed to this [m/s, rad/s] until the robot has moved by `distance` [m]; may be ignored."""

    @property
    def local_plan(self) -> Array:
        """Trajectory of the last velocity, shape (N, 3), in the local costmap's frame."""
        return np.empty((0, 3))

    @property
    def visible_plan(self) -> Array:
        """Part of the plan that is followed now, shape (N, 3), in the local costmap's frame."""
        return np.empty((0, 3))


@dataclass(frozen=True, kw_only=True)
class RecoveryView:
    """Input of a recovery behaviour in one cycle.

    Attributes:
        now: time [s].
        pose_global, pose_local: the robot's, in each costmap's frame.
        global_costmap, local_costmap: may be cleared.
    """

    now: float
    pose_global: Pose2D
    pose_local: Pose2D
    global_costmap: LayeredCostmap
    local_costmap: LayeredCostmap


class Recovery(ABC):
    """A recovery behaviour for a stuck robot; it runs step by step, so that it can be cancelled."""

    name: str = ""

    @abstractmethod
    def start(self, view: RecoveryView) -> None:
        """Begin."""

    @abstractmethod
    def step(self, view: RecoveryView) -> Twist2D | None:
        """Velocity for this cycle, None when done."""

    @property
    def last_words(self) -> str:
        """Sentence for the log on how it ended; empty if there is nothing to say."""
        return ""
