"""Local planner under the name dwa_local_planner/DWAPlannerROS (matches dwa_local_planner 1.17).

The dynamic window approach (Fox, Burgard, Thrun 1997): of the velocities reachable in one control cycle, each held for
`sim_time`, it takes the best by its critics (`rosbot_patrol.planning.critics`): oscillation, obstacle, goal_front,
alignment, path, goal and twirling. At the goal it stops and turns to the heading. Parameters have upstream's names and
dynamic_reconfigure's defaults. Distances to plan and goal are weighted per metre, as are upstream's cells times
resolution (path_distance_bias 32, goal_distance_bias 24, as in its documentation).

Differs:
    - Distances are Euclidean around obstacles and interpolated; upstream counts 4-connected cells.
    - The swept footprint is checked cell by cell, whatever the steps. `stop_time_buffer` works: a velocity is
      admissible only if the robot can stop that long before an obstacle; upstream only reads it.
    - A standing base may start with `min_vel_trans` or `min_vel_theta` even if one cycle's acceleration gives less.
      Upstream then finds no velocity, or cannot turn on the spot.
    - If nothing is free over `sim_time`, slow motions are tried over 0.6 s. A robot whose footprint touches an obstacle
      may move if it then touches less, or back out at `min_vel_trans`. If only the padding touches, it may move slowly
      by its bare outline. So are turns on the spot where that outline can turn right round.
    - The local goal lies about a metre along the plan, beyond the reach of a trajectory; upstream takes the last pose
      in view and gets stuck in a bend. If something blocks the plan, the way round it becomes the plan; without one,
      the robot stops short of the place and says so.
    - The latch of `latch_xy_goal_tolerance` is kept when a new plan leads to the same goal.
    - Names from before Noetic (`max_trans_vel`, ...) work, with a warning; upstream warns and ignores them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.errors import ControlError
from rosbot_patrol.geometry import Twist2D
from rosbot_patrol.planning.critics import (
    AlignmentCritic,
    GoalDistanceCritic,
    GoalFrontCritic,
    Motion,
    PathDistanceCritic,
    Situation,
    TwirlingCritic,
)
from rosbot_patrol.planning.interfaces import Array, LocalView
from rosbot_patrol.planning.local_planners.base import SamplingPlanner
from rosbot_patrol.planning.local_planners.dwa_params import TUNABLE, DWAPlannerParams
from rosbot_patrol.planning.local_planners.ground import Ground
from rosbot_patrol.planning.local_planners.stop import StopLimits

_SHORT = 0.6  # duration of slow motions in narrow places [s]
_BEYOND = 0.2  # distance of the local goal beyond the reach of a trajectory [m]
_EPS = 1e-4


class DWAPlanner(SamplingPlanner[DWAPlannerParams]):
    """Samples the reachable velocities and drives the best.

    Args:
        params: as upstream.
        footprint: the robot's padded outline.
        resolution: of the local costmap [m].
    """

    tunable = TUNABLE

    def __init__(self, params: DWAPlannerParams, footprint: Footprint, *, resolution: float) -> None:
        super().__init__(params, footprint, resolution=resolution)
        self._at_start = params
        self._path, self._alignment = PathDistanceCritic(), AlignmentCritic()
        self._goal, self._goal_front = GoalDistanceCritic(), GoalFrontCritic()
        self._twirling = TwirlingCritic()

    def reconfigure(self, changes: Mapping[str, Any], *, name: str = "") -> DWAPlannerParams:
        """Change parameters; `restore_defaults` restores those of the start. See `SamplingPlanner`."""
        if changes.get("restore_defaults"):
            self.set_params(self._at_start)
            return self._at_start
        return super().reconfigure(changes, name=name)

    @property
    def _goal_rule(self) -> tuple[float, bool]:
        return self._driven.xy_goal_tolerance, self._driven.latch_xy_goal_tolerance

    @property
    def _stop_limits(self) -> StopLimits:
        p = self._driven
        return StopLimits(
            yaw_tolerance=p.yaw_goal_tolerance,
            slowest_turn=p.min_vel_theta,
            fastest_left=p.max_vel_theta,
            fastest_right=p.max_vel_theta,
            accelerations=(p.acc_lim_x, p.acc_lim_y, p.acc_lim_theta),
            trans_stopped=p.trans_stopped_vel,
            rot_stopped=p.theta_stopped_vel,
            period=1.0 / p.controller_frequency,
        )

    def _slowed(self, params: DWAPlannerParams, trans: float, rot: float) -> DWAPlannerParams:
        return replace(
            params,
            max_vel_trans=min(params.max_vel_trans, trans),
            min_vel_trans=min(params.min_vel_trans, trans),
            max_vel_theta=min(params.max_vel_theta, rot),
            min_vel_theta=min(params.min_vel_theta, rot),
        )

    # ---- following

    def _follow(self, view: LocalView) -> Twist2D:
        """The best reachable velocity; if none is free, a slow one that is simulated for a shorter time."""
        p = self._driven
        self._visible = self._track.part_in_view(view, prune=p.prune_plan)
        ground = self._ground(view, p.max_vel_trans * p.sim_time + p.forward_point_distance + _BEYOND)
        samples = self._samples(view)
        slow = samples[np.hypot(samples[:, 0], samples[:, 1]) <= max(p.min_vel_trans, 0.1) + _EPS]
        short = min(p.sim_time, _SHORT)
        best = self._best(view, ground, samples, p.sim_time)
        if best is None:
            best = self._best(view, ground, slow, short)
        if best is None and self._obstacles.is_squeezed(view.costmap, view.pose):
            back = np.array([[-max(p.min_vel_trans, 0.05), 0.0, 0.0]])
            best = self._best(view, ground, back, short)
            if best is None:
                best = self._best(view, ground, np.concatenate((slow, back)), short, bare=True)
        if best is None:
            raise ControlError("the DWA planner found no velocity that is free of obstacles")
        self._oscillation.remember(
            view.pose,
            best,
            still=p.min_vel_trans,
            distance=p.oscillation_reset_dist,
            angle=p.oscillation_reset_angle,
        )
        return best

    def _samples(self, view: LocalView) -> Array:
        """Reachable velocities (vx, vy, wz), shape (K, 3), within the base's limits."""
        p, v = self._driven, view.velocity
        most_x, most_y = min(p.max_vel_x, p.max_vel_trans), min(p.max_vel_y, p.max_vel_trans)
        window = 1.0 / p.controller_frequency if p.use_dwa else p.sim_time
        if not p.use_dwa:  # do not overshoot the goal
            goal = self._track.goal(view)
            reach = math.hypot(goal.x - view.pose.x, goal.y - view.pose.y) / p.sim_time
            most_x, most_y = max(min(most_x, reach), p.min_vel_x), max(min(most_y, reach), p.min_vel_y)
        vx = _within(v.vx, p.acc_lim_x * window, p.min_vel_x, most_x, start=p.min_vel_trans, count=p.vx_samples)
        vy = _within(v.vy, p.acc_lim_y * window, p.min_vel_y, most_y, start=p.min_vel_trans, count=p.vy_samples)
        fastest = p.max_vel_theta
        wz = _within(v.wz, p.acc_lim_theta * window, -fastest, fastest, start=p.min_vel_theta, count=p.vth_samples)
        out = np.stack(np.meshgrid(vx, vy, wz, indexing="ij"), axis=-1).reshape(-1, 3)
        speed, turn = np.hypot(out[:, 0], out[:, 1]), np.abs(out[:, 2])
        moves = (speed + _EPS >= p.min_vel_trans) | (turn + _EPS >= p.min_vel_theta)
        return np.ascontiguousarray(out[moves & (speed - _EPS <= p.max_vel_trans) & (speed + turn > _EPS)])

    def _motion(self, horizon: float) -> Motion:
        p = self._driven
        return Motion(
            horizon=horizon,
            accelerations=(p.acc_lim_x, p.acc_lim_y, p.acc_lim_theta),
            granularity=p.sim_granularity,
            angular_granularity=p.angular_sim_granularity,
            stop_time_buffer=p.stop_time_buffer,
            growing=(p.scaling_speed, p.max_scaling_factor, p.max_vel_trans),
            is_held=p.use_dwa,
        )

    def _best(
        self, view: LocalView, ground: Ground, samples: Array, horizon: float, *, bare: bool = False
    ) -> Twist2D | None:
        """The best sample, None if none is free.

        Raises:
            ControlError: some are free, but lead nowhere.
        """
        if not len(samples):
            return None
        p, motion = self._driven, self._motion(horizon)
        slowly = replace(motion, horizon=min(horizon, _SHORT), is_held=False)
        danger, ends = self._dangers(view, samples, motion, slowly, growth=p.max_scaling_factor, bare=bare)
        free = np.isfinite(danger) & ~self._oscillation.forbidden(samples)
        if not free.any():
            return None
        samples, ends = np.ascontiguousarray(samples[free]), np.ascontiguousarray(ends[free])
        situation = ground.situation(view, samples, ends, p.forward_point_distance)
        cost = p.occdist_scale * danger[free] + self._scores(situation)
        best = int(np.argmin(cost))
        if not math.isfinite(cost[best]):
            raise ControlError("no free trajectory leads on along the plan")
        twist = Twist2D(*samples[best].tolist())
        self._local_plan = self._obstacles.trace(view.pose, view.velocity, twist, motion)
        return twist

    def _scores(self, situation: Situation) -> Array:
        """Weighted critics of the final poses, shape (K,)."""
        p = self._driven
        cost = p.path_distance_bias * self._path.score(situation)
        cost += p.goal_distance_bias * self._goal.score(situation)
        if situation.nose > 0.0:
            cost += p.goal_distance_bias * self._goal_front.score(situation)
            if situation.goal_distance**2 > situation.nose**2 * p.cheat_factor:
                cost += p.path_distance_bias * self._alignment.score(situation)
        if p.twirling_scale > 0.0:
            cost += p.twirling_scale * self._twirling.score(situation)
        return cost


def _within(speed: float, change: float, least: float, most: float, *, start: float, count: int) -> Array:
    """Speeds reachable next: within a change and the limits, evenly spaced, including 0 if it lies between.

    Args:
        speed: now.
        change: largest change of speed.
        least: lower limit.
        most: upper limit.
        start: slowest speed that moves a standing base.
        count: how many.
    """
    if most <= least:
        return np.array([most])
    low, high = speed - change, speed + change
    if abs(speed) < start:
        low, high = min(low, -start), max(high, start)
    low, high = min(max(low, least), most), max(min(high, most), least)
    speeds = np.linspace(low, high, max(count, 2)) if high > low else np.array([low])
    return np.union1d(speeds, [0.0]) if low < 0.0 < high else speeds
