"""Base of both local planners: samples, simulates and scores velocities."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

import numpy as np

from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.errors import ControlError
from rosbot_patrol.geometry import Pose2D, Twist2D, angle_difference
from rosbot_patrol.planning.critics import Motion, ObstacleCritic, OscillationCritic
from rosbot_patrol.planning.interfaces import Array, LocalPlanner, LocalView
from rosbot_patrol.planning.local_planners.ground import Ground, survey_ground
from rosbot_patrol.planning.local_planners.stop import StopAndTurn, StopLimits
from rosbot_patrol.planning.local_planners.track import Track
from rosbot_patrol.tunable import changed

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

P = TypeVar("P", bound="DataclassInstance")

_LOOKAHEAD = 1.0  # minimum distance of the local goal along the plan [m]


@dataclass
class _SpeedLimit:
    """Speed limit [m/s, rad/s] until the robot has moved by `distance` [m] from where it was first seen."""

    trans: float
    rot: float
    distance: float
    since: Pose2D | None = None

    def is_over(self, pose: Pose2D) -> bool:
        if self.since is None:
            self.since = pose
        return math.hypot(pose.x - self.since.x, pose.y - self.since.y) >= self.distance


class SamplingPlanner(LocalPlanner, Generic[P]):
    """Follows a plan by velocities that are sampled, simulated and scored; at the goal it stops and turns.

    Args:
        params: the planner's own.
        footprint: the robot's padded outline.
        resolution: of the local costmap [m].
    """

    tunable: ClassVar[tuple[str, ...]] = ()

    def __init__(self, params: P, footprint: Footprint, *, resolution: float) -> None:
        self.params = params
        self._driven = params  # the parameters in force: `params`, or with lower speeds
        self._limit: _SpeedLimit | None = None
        self._obstacles = ObstacleCritic(footprint, resolution=resolution)
        self._oscillation = OscillationCritic()
        self._radius = footprint.circumscribed_radius
        self._track = Track()
        self._stop = StopAndTurn(self._obstacles)
        self._local_plan: Array = np.empty((0, 3))
        self._visible: Array = np.empty((0, 3))

    # ---- for subclasses

    @property
    @abstractmethod
    def _stop_limits(self) -> StopLimits:
        """Limits at the goal."""

    @property
    @abstractmethod
    def _goal_rule(self) -> tuple[float, bool]:
        """Distance from the goal that counts as reached [m], and whether that is latched."""

    @abstractmethod
    def _slowed(self, params: P, trans: float, rot: float) -> P:
        """Parameters with lower top speeds [m/s, rad/s]."""

    @abstractmethod
    def _follow(self, view: LocalView) -> Twist2D:
        """Velocity for this cycle away from the goal; raises ControlError."""

    # ---- parameters

    def set_params(self, params: P) -> None:
        """Use other parameters from the next cycle on; plan, goal and speed limit stay.

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

    def fit(self, footprint: Footprint, *, resolution: float) -> None:
        """Use another padded outline of the robot, or cells of another size [m]."""
        self._obstacles = ObstacleCritic(footprint, resolution=resolution)
        self._radius = footprint.circumscribed_radius
        self._stop = StopAndTurn(self._obstacles)

    def limit_speed(self, trans: float, rot: float, *, distance: float) -> None:
        """Limit the speed to this [m/s, rad/s] until the robot has moved by `distance` [m]."""
        self._limit = _SpeedLimit(trans, rot, distance)
        self._apply()

    def _apply(self) -> None:
        limit = self._limit
        self._driven = self.params if limit is None else self._slowed(self.params, limit.trans, limit.rot)

    # ---- plan and goal

    def reset(self) -> None:
        """Forget the current goal."""
        self._track.xy_reached = False
        self._oscillation.reset()
        self._stop.reset()

    def set_plan(self, poses: Array) -> None:
        """Follow a new plan; raises ControlError if it cannot."""
        if self._track.take(poses):
            self._stop.reset()

    @property
    def local_plan(self) -> Array:
        """Trajectory of the last velocity."""
        return self._local_plan

    @property
    def visible_plan(self) -> Array:
        """Part of the plan that is followed now."""
        return self._visible

    def _is_at_goal(self, view: LocalView) -> bool:
        tolerance, latch = self._goal_rule
        return self._track.is_at_goal(view, tolerance=tolerance, latch=latch)

    def is_goal_reached(self, view: LocalView) -> bool:
        """Whether the robot stands at the goal with the right heading."""
        if len(self._track.poses) == 0 or not self._is_at_goal(view):
            return False
        limits = self._stop_limits
        error = angle_difference(self._track.goal(view).yaw, view.pose.yaw)
        return abs(error) <= limits.yaw_tolerance and limits.is_standing(view.velocity)

    def compute(self, view: LocalView) -> Twist2D:
        """Velocity for this cycle; raises ControlError."""
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

    def _ground(self, view: LocalView, lookahead: float) -> Ground:
        """Ground to follow now; raises ControlError if something blocks the plan and there is no way round."""
        return survey_ground(
            view, self._visible, behind=self._track.behind, lookahead=max(lookahead, _LOOKAHEAD), radius=self._radius
        )

    def _dangers(
        self,
        view: LocalView,
        samples: Array,
        motion: Motion,
        other: Motion,
        *,
        growth: float = 0.0,
        bare: bool = False,
    ) -> tuple[Array, Array]:
        """Mean obstacle cost of two models of how the base reaches a velocity; both must be free.

        Turns on the spot are checked without the padding where the bare robot can turn right round.

        Args:
            view: input of this cycle.
            samples: velocities (vx, vy, wz), shape (K, 3).
            motion: expected response of the base.
            other: alternative response.
            growth: largest growth of the footprint.
            bare: use the footprint without padding.

        Returns:
            Costs, shape (K,), inf if blocked, and the final poses of `motion`, shape (K, 3).
        """
        reach = motion.reach(samples, view.velocity)
        around = self._obstacles.survey(view.costmap, view.pose, reach, growth=growth, bare=bare)
        ends = np.empty((len(samples), 3))
        danger = self._obstacles.drive(around, view.velocity, samples, motion, ends=ends)
        danger = 0.5 * danger + 0.5 * self._obstacles.drive(around, view.velocity, samples, other, failed=danger)
        held = ~samples[:, :2].any(axis=1) & np.isinf(danger)
        if not bare and held.any() and self._obstacles.has_room_to_turn(view.costmap, view.pose):
            turns = np.ascontiguousarray(samples[held])
            danger[held], ends[held] = self._dangers(view, turns, motion, other, bare=True)
        return danger, ends
