"""Recovery behaviours (match clear_costmap_recovery and rotate_recovery 1.17), worked on step by step.

Differs: both can be cancelled at any step; the turn is counted by summing wrapped increments, ends when something
is in the way, and has a time limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.geometry import Pose2D, Twist2D, angle_difference
from rosbot_patrol.params import param
from rosbot_patrol.planning.critics import SUDDEN, Motion, ObstacleCritic
from rosbot_patrol.planning.interfaces import Recovery, RecoveryView


@dataclass(frozen=True, kw_only=True)
class ClearCostmapParams:
    """Parameters of clear_costmap_recovery/ClearCostmapRecovery."""

    reset_distance: float = param(3.0, unit="m", lo=0.0, doc="side of the square around the robot that is kept")
    force_updating: bool = param(False, doc="accepted; costmaps are always updated after clearing")
    affected_maps: str = param("both", choices=("local", "global", "both"))


class ClearCostmap(Recovery):
    """Forgets what was sensed farther away than a distance."""

    def __init__(self, params: ClearCostmapParams, *, name: str) -> None:
        self.name = name
        self.params = params

    def start(self, view: RecoveryView) -> None:
        """Begin."""
        if self.params.affected_maps in ("global", "both"):
            view.global_costmap.clear_outside(view.pose_global, self.params.reset_distance)
        if self.params.affected_maps in ("local", "both"):
            view.local_costmap.clear_outside(view.pose_local, self.params.reset_distance)

    def step(self, view: RecoveryView) -> Twist2D | None:
        """One cycle; None when done."""
        return None

    @property
    def last_words(self) -> str:
        """How it ended."""
        return f"costmaps cleared beyond {self.params.reset_distance / 2.0:.2f} m"


@dataclass(frozen=True, kw_only=True)
class RotateParams:
    """Parameters of rotate_recovery/RotateRecovery (speeds default to the local planner's)."""

    sim_granularity: float = param(0.017, unit="rad", lo=0.001, doc="step between poses that are checked")
    frequency: float = param(20.0, unit="Hz", lo=0.1, doc="accepted; the controller's frequency is used")
    acc_lim_th: float = param(3.2, unit="rad/s^2", lo=0.01)
    max_rotational_vel: float = param(1.0, unit="rad/s", lo=0.0)
    min_in_place_rotational_vel: float = param(0.4, unit="rad/s", lo=0.0)
    yaw_goal_tolerance: float = param(0.1, unit="rad", lo=0.0)


class Rotate(Recovery):
    """One full turn on the spot, to see what is around."""

    def __init__(self, params: RotateParams, *, name: str) -> None:
        self.name = name
        self.params = params
        self._turned = 0.0
        self._yaw = 0.0
        self._started = 0.0
        self._words = ""

    def start(self, view: RecoveryView) -> None:
        """Begin."""
        self._turned, self._yaw, self._started = 0.0, view.pose_local.yaw, view.now
        self._words = ""

    def step(self, view: RecoveryView) -> Twist2D | None:
        """One cycle; None when done."""
        p = self.params
        self._turned += angle_difference(view.pose_local.yaw, self._yaw)
        self._yaw = view.pose_local.yaw
        left = math.tau - self._turned
        slowest = max(p.min_in_place_rotational_vel, 0.05)
        if left <= p.yaw_goal_tolerance:
            self._words = "turned once"
            return None
        if view.now - self._started > 3.0 * math.tau / slowest:
            self._words = f"turned {math.degrees(self._turned):.0f} degrees only, the base does not follow"
            return None
        speed = max(min(p.max_rotational_vel, math.sqrt(2.0 * p.acc_lim_th * left)), slowest)
        if not _is_free(view.local_costmap, view.pose_local, min(left, 0.5 * speed), p.sim_granularity):
            self._words = f"something is in the way after {math.degrees(self._turned):.0f} degrees"
            return None
        return Twist2D(0.0, 0.0, speed)

    @property
    def last_words(self) -> str:
        """How it ended."""
        return self._words


def _is_free(costmap: LayeredCostmap, pose: Pose2D, angle: float, step: float) -> bool:
    turn = Motion(horizon=1.0, accelerations=SUDDEN, angular_granularity=step)
    critic = ObstacleCritic(costmap.footprint, resolution=costmap.info.resolution)
    return critic.is_free(costmap.grid, pose, Twist2D(0.0, 0.0, max(angle, 1e-3)), turn)
