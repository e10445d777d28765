"""What the local planners that sample velocities have in common."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import INSCRIBED
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.errors import ControlError
from rosbot_patrol.geometry import Pose2D, Twist2D, angle_difference
from rosbot_patrol.grid import Grid, cells_of_points
from rosbot_patrol.planning.critics import ObstacleCritic, OscillationCritic, Situation, distances_from, shrink
from rosbot_patrol.planning.interfaces import Array, LocalPlanner, LocalView
from rosbot_patrol.planning.trajectory_planner_stop import StopAndTurn, StopLimits
from rosbot_patrol.planning.trajectory_planner_track import Track
from rosbot_patrol.planning.tunable import changed

P = TypeVar("P")

_TOO_NEAR = 0.3  # of a plan that is blocked, less than this ahead is not worth driving [m]


@dataclass
class _SpeedLimit:
    """Speeds [m/s, rad/s] that hold until the robot has moved by `distance` [m] from where it was first seen."""

    trans: float
    rot: float
    distance: float
    since: Pose2D | None = None

    def is_over(self, pose: Pose2D) -> bool:
        if self.since is None:
            self.since = pose
        return math.hypot(pose.x - self.since.x, pose.y - self.since.y) >= self.distance


@dataclass(frozen=True)
class Ground:
    """What one cycle drives over: costs in coarse cells, the plan as far as it leads, distances to its end [cells]."""

    coarse: Grid
    plan: Array
    goal_field: NDArray[np.float32]

    def situation(self, view: LocalView, samples: Array, ends: Array, nose: float) -> Situation:
        """What critics look at."""
        return Situation(
            pose=view.pose,
            samples=samples,
            ends=ends,
            coarse=self.coarse,
            plan=self.plan,
            nose=nose,
            goal_field=self.goal_field,
        )


class SamplingPlanner(LocalPlanner, Generic[P]):
    """Follows a plan by velocities that are sampled, simulated and judged; at the goal it stops and turns.

    Args:
        params: the planner's own.
        footprint: the robot's padded outline.
        resolution: of the local costmap [m].
    """

    tunable: ClassVar[tuple[str, ...]] = ()

    def __init__(self, params: P, footprint: Footprint, *, resolution: float) -> None:
        self.params = params
        self._driven = params  # what holds now: `params`, or slower
        self._limit: _SpeedLimit | None = None
        self._obstacles = ObstacleCritic(footprint, resolution=resolution)
        self._oscillation = OscillationCritic()
        self._track = Track()
        self._stop = StopAndTurn(self._obstacles)
        self._local_plan: Array = np.empty((0, 3))
        self._visible: Array = np.empty((0, 3))

    # ---- what a planner has of its own

    @property
    @abstractmethod
    def _stop_limits(self) -> StopLimits:
        """Limits at the goal."""

    @property
    @abstractmethod
    def _goal_rule(self) -> tuple[float, bool]:
        """How near to the goal is there [m], and whether it stays so."""

    @abstractmethod
    def _slowed(self, params: P, trans: float, rot: float) -> P:
        """Parameters with lower top speeds [m/s, rad/s]."""

    @abstractmethod
    def _follow(self, view: LocalView) -> Twist2D:
        """The velocity for this cycle, away from the goal; raises ControlError."""

    # ---- parameters

    def set_params(self, params: P) -> None:
        """Other parameters from the next cycle on; plan, goal and a limit of speed stay.

        Raises:
            TypeError: they belong to another planner.
        """
        if type(params) is not type(self.params):
            raise TypeError(f"expected {type(self.params).__name__}, got {type(params).__name__}")
        self.params = params
        self._apply()

    def reconfigure(self, changes: Mapping[str, Any], *, name: str = "") -> P:
        """Change some of the parameters in `tunable`, as a dynamic_reconfigure server asks; returns all of them.

        Raises:
            ParamError: one is not tunable, of the wrong type or out of bounds; `name` is the prefix in its message.
        """
        self.set_params(changed(self.params, changes, self.tunable, name=name))
        return self.params

    def limit_speed(self, trans: float, rot: float, *, distance: float) -> None:
        """Drive no faster than this [m/s, rad/s] until the robot has moved by `distance` [m]."""
        self._limit = _SpeedLimit(trans, rot, distance)
        self._apply()

    def _apply(self) -> None:
        limit = self._limit
        self._driven = self.params if limit is None else self._slowed(self.params, limit.trans, limit.rot)

    # ---- plan and goal

    def reset(self) -> None:
        """Forget the goal that was worked on."""
        self._track.xy_reached = False
        self._oscillation.reset()
        self._stop.reset()

    def set_plan(self, poses: Array) -> None:
        """Follow a new plan; raises ControlError where it cannot."""
        if self._track.take(poses):
            self._stop.reset()

    @property
    def local_plan(self) -> Array:
        """What the last velocity would drive."""
        return self._local_plan

    @property
    def visible_plan(self) -> Array:
        """The part of the plan that is followed now."""
        return self._visible

    def _is_at_goal(self, view: LocalView) -> bool:
        tolerance, latch = self._goal_rule
        return self._track.is_at_goal(view, tolerance=tolerance, latch=latch)

    def is_goal_reached(self, view: LocalView) -> bool:
        """Whether the robot stands at the goal, turned as it should."""
        if len(self._track.poses) == 0 or not self._is_at_goal(view):
            return False
        limits = self._stop_limits
        error = angle_difference(self._track.goal(view).yaw, view.pose.yaw)
        return abs(error) <= limits.yaw_tolerance and limits.is_standing(view.velocity)

    def compute(self, view: LocalView) -> Twist2D:
        """The velocity for this cycle; raises ControlError."""
        if not all(map(math.isfinite, (*view.pose, *view.velocity, *view.local_from_plan))):
            raise ControlError("the robot's pose or velocity is not a number")
        if len(self._track.poses) == 0:
            raise ControlError("there is no plan to follow")
        if self._limit is not None and self._limit.is_over(view.pose):
            self._limit = None
            self._apply()
        self._local_plan = np.empty((0, 3))
        if self._is_at_goal(view):
            goal = self._track.goal(view)
            self._visible = np.array([view.pose, goal])
            return self._stop.step(view, goal, self._stop_limits)
        self._stop.reset()
        return self._follow(view)

    # ---- what is ahead

    def _ground(self, view: LocalView, plan: Array) -> Ground:
        """The plan up to its last pose in view that the robot can get to, and the distances to it.

        Raises:
            ControlError: something stands on the plan right ahead, and nothing leads round it.
        """
        coarse = shrink(view.costmap)
        field = distances_from(coarse, plan[-1:, :2])
        if not _reaches(coarse, field, view.pose, plan[-1]):
            plan = _reachable_part(coarse, view.pose, plan)
            field = distances_from(coarse, plan[-1:, :2])
        return Ground(coarse, plan, field)


def _reaches(coarse: Grid, field: NDArray[np.float32], pose: Pose2D, goal: Array) -> bool:
    """Whether distances to a goal's place are known where the robot is, and the goal itself is free."""
    info = coarse.info
    ix, iy = info.cell_of_clamped(goal[0], goal[1])
    if coarse.cells[iy, ix] >= INSCRIBED:
        return False
    ix, iy = info.cell_of_clamped(pose.x, pose.y)
    cross = (field[iy, max(ix - 1, 0) : ix + 2], field[max(iy - 1, 0) : iy + 2, ix])
    return any(bool(np.isfinite(part).any()) for part in cross)


def _reachable_part(coarse: Grid, pose: Pose2D, plan: Array) -> Array:
    info = coarse.info
    distances = distances_from(coarse, np.array([[pose.x, pose.y]]))
    ix, iy = cells_of_points(info, plan[:, :2]).T
    reachable = np.isfinite(distances[iy.clip(0, info.height - 1), ix.clip(0, info.width - 1)])
    last = int(np.flatnonzero(reachable)[-1]) if reachable.any() else -1
    if last == len(plan) - 1:
        return plan
    gap = math.hypot(plan[last, 0] - pose.x, plan[last, 1] - pose.y) if last >= 0 else 0.0
    if gap < _TOO_NEAR:
        raise ControlError("something stands on the plan and there is no way round it in view")
    return plan[: last + 1]
