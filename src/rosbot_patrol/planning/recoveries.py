"""Recovery behaviours, step by step (match clear_costmap_recovery, rotate_recovery, move_slow_and_clear 1.17).

Differs:
    - All can be cancelled at any step.
    - The turn sums wrapped increments, has a time limit, and goes on until something is right ahead. Upstream does not
      start if any part of the turn is blocked, and so sees less. Where the bare outline can turn right round, it is
      the one that is checked; upstream checks the padded one, and cannot turn beside a wall.
    - Without `layer_names` all layers with sensors are cleared; upstream clears only a layer named "obstacles".
    - MoveSlowAndClear slows the local planner in use; upstream calls dynamic_reconfigure of the one named by
      `planner_namespace`.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.geometry import Pose2D, Twist2D, angle_difference
from rosbot_patrol.params import param
from rosbot_patrol.planning.critics import SUDDEN, Motion, ObstacleCritic
from rosbot_patrol.planning.interfaces import LocalPlanner, Recovery, RecoveryView

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class ClearCostmapParams:
    """Parameters of clear_costmap_recovery/ClearCostmapRecovery."""

    reset_distance: float = param(3.0, unit="m", lo=0.0, doc="side of the square around the robot that is kept")
    invert_area_to_clear: bool = param(False, doc="clear inside the square instead of outside")
    force_updating: bool = param(False, doc="compute the costs at once instead of at the next update")
    affected_maps: str = param("both", choices=("local", "global", "both"), doc="costmaps to clear")
    layer_names: list[str] = param([], doc="layers to clear; empty: all layers with sensors")


class ClearCostmap(Recovery):
    """Forgets sensor data beyond a distance from the robot."""

    def __init__(self, params: ClearCostmapParams, *, name: str) -> None:
        self.name = name
        self.params = params

    def start(self, view: RecoveryView) -> None:
        """Begin."""
        p = self.params
        where = "inside" if p.invert_area_to_clear else "outside"
        log.warning(
            "Clearing %s costmap%s %s a square (%.2fm) large centered on the robot.",
            p.affected_maps,
            "s" if p.affected_maps == "both" else "",
            where,
            p.reset_distance,
        )
        affected = ("global", "local") if p.affected_maps == "both" else (p.affected_maps,)
        missing = [self._clear(view, which) for which in affected]
        for name in sorted(set.intersection(*map(set, missing))):
            log.warning("Cannot clear layer %s because it does not exist", name)

    def _clear(self, view: RecoveryView, which: str) -> list[str]:
        p = self.params
        costmap = view.global_costmap if which == "global" else view.local_costmap
        pose = view.pose_global if which == "global" else view.pose_local
        names = p.layer_names or None
        missing = costmap.clear_square(pose, p.reset_distance, inside=p.invert_area_to_clear, names=names)
        if p.force_updating:
            costmap.update_now(view.now)
        return missing

    def step(self, view: RecoveryView) -> Twist2D | None:
        """One cycle; None when done."""
        return None

    @property
    def last_words(self) -> str:
        """Sentence on how it ended."""
        side = "within" if self.params.invert_area_to_clear else "beyond"
        return f"costmaps cleared {side} {self.params.reset_distance / 2.0:.2f} m"


@dataclass(frozen=True, kw_only=True)
class RotateParams:
    """Parameters of rotate_recovery/RotateRecovery (speeds default to the local planner's)."""

    sim_granularity: float = param(
        0.017, unit="rad", lo=0.001, doc="angle between the poses that are checked for collisions"
    )
    frequency: float = param(20.0, unit="Hz", lo=0.1, doc="accepted; the controller's frequency is used")
    acc_lim_th: float = param(3.2, unit="rad/s^2", lo=0.01, doc="maximum turning acceleration")
    max_rotational_vel: float = param(1.0, unit="rad/s", lo=0.0, doc="top turning speed")
    min_in_place_rotational_vel: float = param(
        0.4, unit="rad/s", lo=0.0, doc="slowest turning speed that moves the base"
    )
    yaw_goal_tolerance: float = param(0.1, unit="rad", lo=0.0, doc="tolerance at the end of the full turn")


class Rotate(Recovery):
    """One full turn on the spot, to see the surroundings."""

    def __init__(self, params: RotateParams, *, name: str) -> None:
        self.name = name
        self.params = params
        self._turned = 0.0
        self._yaw = 0.0
        self._started = 0.0
        self._words = ""

    def start(self, view: RecoveryView) -> None:
        """Begin."""
        log.warning("Rotate recovery behavior started.")
        self._turned, self._yaw, self._started = 0.0, view.pose_local.yaw, view.now
        self._words = ""

    def step(self, view: RecoveryView) -> Twist2D | None:
        """One cycle; None when done."""
        p = self.params
        self._turned += angle_difference(view.pose_local.yaw, self._yaw)
        self._yaw = view.pose_local.yaw
        left = math.tau - self._turned
        slowest = max(min(p.min_in_place_rotational_vel, p.max_rotational_vel), 0.05)
        if left <= p.yaw_goal_tolerance:
            self._words = "turned once"
            return None
        if view.now - self._started > 3.0 * math.tau / slowest:
            self._words = f"turned {math.degrees(self._turned):.0f} degrees only, the base does not follow"
            return None
        speed = max(min(p.max_rotational_vel, math.sqrt(2.0 * p.acc_lim_th * left)), slowest)
        # check half a second ahead, plus the time to brake
        ahead = min(left, 0.5 * speed + speed * speed / (2.0 * p.acc_lim_th))
        if not _is_free(view.local_costmap, view.pose_local, ahead, p.sim_granularity):
            log.error("Rotate recovery can't rotate in place because there is a potential collision. Cost: -1.00")
            self._words = f"something is in the way after {math.degrees(self._turned):.0f} degrees"
            return None
        return Twist2D(0.0, 0.0, speed)

    @property
    def last_words(self) -> str:
        """Sentence on how it ended."""
        return self._words


def _is_free(costmap: LayeredCostmap, pose: Pose2D, angle: float, step: float) -> bool:
    turn = Motion(horizon=1.0, accelerations=SUDDEN, angular_granularity=step)
    critic = ObstacleCritic(costmap.footprint, resolution=costmap.info.resolution)
    return critic.is_free(costmap.grid, pose, Twist2D(0.0, 0.0, max(angle, 1e-3)), turn)


@dataclass(frozen=True, kw_only=True)
class MoveSlowParams:
    """Parameters of move_slow_and_clear/MoveSlowAndClear."""

    clearing_distance: float = param(
        0.5, unit="m", lo=0.0, doc="distance to each side of the robot within which marks are forgotten"
    )
    limited_trans_speed: float = param(0.25, unit="m/s", lo=0.01, doc="top speed after the clearing")
    limited_rot_speed: float = param(0.45, unit="rad/s", lo=0.01, doc="top turning speed after the clearing")
    limited_distance: float = param(0.3, unit="m", lo=0.0, doc="distance for which these limits hold")
    planner_namespace: str = param("DWAPlannerROS", doc="accepted, has no effect: the limits go to the planner in use")
    max_trans_param_name: str = param("max_trans_vel", doc="accepted, has no effect")
    max_rot_param_name: str = param("max_rot_vel", doc="accepted, has no effect")


class MoveSlowAndClear(Recovery):
    """Forgets sensor data around the robot, and limits its speed for a while.

    Args:
        params: as upstream.
        name: of the behaviour.
        planner: the local planner to slow down; None: none.
    """

    def __init__(self, params: MoveSlowParams, *, name: str, planner: LocalPlanner | None) -> None:
        self.name = name
        self.params = params
        self._planner = planner

    def start(self, view: RecoveryView) -> None:
        """Begin."""
        log.warning("Move slow and clear recovery behavior started.")
        p = self.params
        side = 2.0 * p.clearing_distance
        view.global_costmap.clear_square(view.pose_global, side, inside=True)
        view.local_costmap.clear_square(view.pose_local, side, inside=True)
        if self._planner is not None:
            self._planner.limit_speed(p.limited_trans_speed, p.limited_rot_speed, distance=p.limited_distance)

    def step(self, view: RecoveryView) -> Twist2D | None:
        """One cycle; None when done."""
        return None

    @property
    def last_words(self) -> str:
        """Sentence on how it ended."""
        p = self.params
        return (
            f"costmaps cleared within {p.clearing_distance:.2f} m; no faster than {p.limited_trans_speed:.2f} m/s for "
            f"{p.limited_distance:.2f} m"
        )
