"""Local planner under the name base_local_planner/TrajectoryPlannerROS (matches base_local_planner 1.17).

It samples forward and turning velocities, simulates each for `sim_time`, and takes the one with the smallest
path_distance_bias * distance to the plan + goal_distance_bias * distance to the local goal + occdist_scale * cost. At
the goal it stops and turns to the heading. Parameters have upstream's names and the defaults of its dynamic_reconfigure
file, which take precedence there.

Differs:
    - Distances are Euclidean around obstacles and interpolated. They are taken at the trajectory's end and at a point
      `heading_lookahead` ahead of it. Upstream counts 4-connected cells, and looks ahead only for turns on the spot.
    - The obstacle cost is that of the cells under the robot's centre; upstream includes those under its edges.
    - The swept footprint is checked cell by cell, whatever the steps. It is checked both for a base that accelerates
      within its limits and for one that reaches the velocity at once. `stop_time_buffer` works; upstream only reads it.
    - If nothing is free over `sim_time`, slow motions are tried over 0.6 s before the robot backs up.
    - It backs up only if the space behind is free; upstream does so blindly. After 2 s it looks ahead again; upstream
      may turn to and fro for ever.
    - A robot whose footprint touches an obstacle may move if it then touches less. If only the padding touches, it may
      move slowly by its bare outline. Upstream finds no trajectory.
    - Turns on the spot are checked by the bare outline where that can turn right round. With its padding a robot beside
      a wall could not, and crept on into the corner that it should leave.
    - The local goal lies about a metre along the plan, beyond the reach of a trajectory; upstream takes the last pose
      in view and cuts corners. If something blocks the plan, the way round it becomes the plan; without one, the robot
      stops short of the place and says so.
    - `simple_attractor` uses the squared distance to the local goal in metres, whatever `meter_scoring`.
    - `y_vels` defaults to -0.3, -0.1, 0.1, 0.3; the dynamic_reconfigure file has a wrong sign in the last one.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.errors import ControlError
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D, angle_difference
from rosbot_patrol.planning.critics import (
    SUDDEN,
    AlignmentCritic,
    AttractionCritic,
    FacingGoalCritic,
    GoalDistanceCritic,
    HeadingCritic,
    Motion,
    PathDistanceCritic,
    Situation,
)
from rosbot_patrol.planning.interfaces import Array, LocalView
from rosbot_patrol.planning.local_planners.base import SamplingPlanner
from rosbot_patrol.planning.local_planners.ground import Ground
from rosbot_patrol.planning.local_planners.stop import StopLimits
from rosbot_patrol.planning.local_planners.trajectory_params import TUNABLE, TrajectoryPlannerParams, read_speeds

_SHORT, _SLOW = 0.6, 0.1  # duration [s] of slow motions [m/s] in narrow places
_HEADING_WEIGHT = 0.3  # weight of an angle with heading_scoring (upstream's)
_STRAFE = 0.1  # speed forward and sideways of a holonomic base's two slanting samples [m/s] (upstream's)
_BEYOND = 0.2  # distance of the local goal beyond the reach of a trajectory [m]
_ESCAPE_TIME = 2.0  # [s]
_NOTHING_FREE = "no trajectory is free of obstacles"


class TrajectoryPlanner(SamplingPlanner[TrajectoryPlannerParams]):
    """Samples velocities and drives the best.

    Args:
        params: as upstream.
        footprint: the robot's padded outline.
        resolution: of the local costmap [m].
    """

    tunable = TUNABLE

    def __init__(self, params: TrajectoryPlannerParams, footprint: Footprint, *, resolution: float) -> None:
        super().__init__(params, footprint, resolution=resolution)
        self._path, self._alignment = PathDistanceCritic(), AlignmentCritic()
        self._goal, self._facing = GoalDistanceCritic(), FacingGoalCritic()
        self._heading, self._attraction = HeadingCritic(), AttractionCritic()
        self._escape_from: Pose2D | None = None
        self._escape_since = 0.0

    def reset(self) -> None:
        """Forget the current goal."""
        super().reset()
        self._escape_from = None

    @property
    def _goal_rule(self) -> tuple[float, bool]:
        return self._driven.xy_goal_tolerance, self._driven.latch_xy_goal_tolerance

    @property
    def _stop_limits(self) -> StopLimits:
        p = self._driven
        return StopLimits(
            yaw_tolerance=p.yaw_goal_tolerance,
            slowest_turn=p.min_in_place_vel_theta,
            fastest_left=min(p.max_vel_theta, p.max_rotational_vel),
            fastest_right=min(-p.min_vel_theta, p.max_rotational_vel),
            accelerations=self._accelerations,
            trans_stopped=p.trans_stopped_velocity,
            rot_stopped=p.rot_stopped_velocity,
            period=1.0 / p.controller_frequency,
        )

    @property
    def _accelerations(self) -> tuple[float, float, float]:
        p = self._driven
        return p.acc_lim_x, p.acc_lim_y if p.holonomic_robot else 0.0, p.acc_lim_theta

    def _slowed(self, params: TrajectoryPlannerParams, trans: float, rot: float) -> TrajectoryPlannerParams:
        return replace(
            params,
            max_vel_x=min(params.max_vel_x, trans),
            min_vel_x=min(params.min_vel_x, trans),
            max_vel_theta=min(params.max_vel_theta, rot),
            min_vel_theta=max(params.min_vel_theta, -rot),
            max_rotational_vel=min(params.max_rotational_vel, rot),
            min_in_place_vel_theta=min(params.min_in_place_vel_theta, rot),
            y_vels=[min(max(v, -trans), trans) for v in read_speeds(params.y_vels)],
        )

    # ---- following

    def _follow(self, view: LocalView) -> Twist2D:
        """The best sample; if none is free, the best slow one, simulated for a shorter time."""
        p = self._driven
        self._visible = self._track.part_in_view(view, prune=p.prune_plan)
        if p.simple_attractor:
            ground = Ground(view.costmap, self._visible, np.empty((0, 0), np.float32))
        else:
            ground = self._ground(view, p.max_vel_x * p.sim_time + p.heading_lookahead + _BEYOND)
        for tried, horizon in self._attempts(view):
            best = self._best(view, ground, tried, horizon)
            if best is not None:
                return self._chosen(view, best)
        try:
            return self._escape(view)
        except ControlError:
            best = self._squeeze(view, ground)
            if best is None:
                raise
            return self._chosen(view, best)

    def _chosen(self, view: LocalView, best: Twist2D) -> Twist2D:
        p = self._driven
        self._oscillation.remember(view.pose, best, still=1e-3, distance=p.oscillation_reset_dist, angle=math.pi / 2)
        return self._limited(view, best)

    def _squeeze(self, view: LocalView, ground: Ground) -> Twist2D | None:
        """The best slow motion by the bare outline, if the padding touches something; None: it does not."""
        p = self._driven
        if not self._obstacles.is_squeezed(view.costmap, view.pose):
            return None
        ahead = self._ahead(view)
        ahead = ahead[ahead[:, 0] <= max(p.min_vel_x, _SLOW)]
        back = np.array([[p.escape_vel, 0.0, 0.0]])[: p.escape_vel < 0.0]
        slow = np.concatenate((ahead, self._turns(), back))
        if not len(slow):
            return None
        return self._best(view, ground, slow, min(p.sim_time, _SHORT), bare=True)

    def _attempts(self, view: LocalView) -> list[tuple[Array, float]]:
        """Sets of samples (vx, vy, wz) to try in turn, each with the duration of its simulation [s]."""
        p = self._driven
        turns = self._turns()
        if self._is_escaping(view):
            return [(turns, p.sim_time), (turns, min(p.sim_time, _SHORT))]
        ahead = self._ahead(view)
        samples = np.concatenate((ahead, turns))
        slow = np.concatenate((ahead[ahead[:, 0] <= max(p.min_vel_x, _SLOW)], turns))
        attempts = [(samples, p.sim_time), (slow, min(p.sim_time, _SHORT))]
        if p.holonomic_robot:
            sideways = np.zeros((len(read_speeds(p.y_vels)), 3))
            sideways[:, 1] = read_speeds(p.y_vels)
            attempts.insert(1, (sideways, p.sim_time))
        return attempts

    def _ahead(self, view: LocalView) -> Array:
        """Forward velocities, shape (K, 3): all pairs of forward and turning speeds."""
        p = self._driven
        goal = self._track.goal(view)
        to_goal = math.hypot(goal.x - view.pose.x, goal.y - view.pose.y)
        # slow down in time to stop at the goal
        top = min(p.max_vel_x, max(p.min_vel_x, to_goal / p.sim_time, 0.05))
        window = 1.0 / p.controller_frequency if p.dwa else p.sim_time
        fastest = min(top, max(view.velocity.vx, 0.0) + p.acc_lim_x * window)
        fastest = max(fastest, min(top, p.min_vel_x))
        slowest = min(max(p.min_vel_x, view.velocity.vx - p.acc_lim_x * window), fastest)
        vx = np.linspace(slowest, fastest, p.vx_samples)
        vx = vx[vx > 1e-3]
        left, right = p.max_vel_theta, p.min_vel_theta
        if p.dwa:
            left = min(left, max(view.velocity.wz, right) + p.acc_lim_theta * window)
            right = max(right, min(view.velocity.wz, left) - p.acc_lim_theta * window)
        wz = np.linspace(right, left, p.vtheta_samples)
        if right < 0.0 < left:
            wz = np.append(wz, 0.0)
        out = np.zeros((len(vx) * len(wz), 3))
        out[:, 0], out[:, 2] = np.tile(vx, len(wz)), np.repeat(wz, len(vx))
        if p.holonomic_robot:
            strafe = min(_STRAFE, top)
            out = np.concatenate((out, [[strafe, strafe, 0.0], [strafe, -strafe, 0.0]]))
        return out

    def _turns(self) -> Array:
        """Turns on the spot (0, 0, wz), shape (K, 3), none slower than the base can turn."""
        p = self._driven
        wz = np.linspace(p.min_vel_theta, p.max_vel_theta, p.vtheta_samples)
        least = p.min_in_place_vel_theta
        wz = np.concatenate((wz[np.abs(wz) >= least], [-least, least]))
        out = np.zeros((len(wz), 3))
        out[:, 2] = wz
        turning: Array = out[np.abs(wz) > 1e-3]
        return turning

    def _motion(self, horizon: float) -> Motion:
        p = self._driven
        return Motion(
            horizon=horizon,
            accelerations=self._accelerations,
            granularity=p.sim_granularity,
            angular_granularity=p.angular_sim_granularity * p.sim_time,  # upstream's rule: of a second's turn
            scored_at=p.heading_scoring_timestep if p.heading_scoring else None,
            stop_time_buffer=p.stop_time_buffer,
        )

    def _best(
        self, view: LocalView, ground: Ground, samples: Array, horizon: float, *, bare: bool = False
    ) -> Twist2D | None:
        """The cheapest sample, None if none is free.

        Raises:
            ControlError: some are free, but lead nowhere.
        """
        p, motion = self._driven, self._motion(horizon)
        at_once = replace(motion, horizon=min(horizon, _SHORT), accelerations=SUDDEN, scored_at=None)
        danger, ends = self._dangers(view, samples, motion, at_once, bare=bare)
        free = np.isfinite(danger)
        if not free.any():
            return None
        samples, ends = np.ascontiguousarray(samples[free]), np.ascontiguousarray(ends[free])
        situation = ground.situation(view, samples, ends, self._nose(view, ground.plan))
        cost = p.occdist_scale * danger[free] + self._distance_costs(situation, view.costmap.info.resolution)
        leads_on = np.isfinite(cost).any()
        cost[self._oscillation.forbidden(samples)] = np.inf
        best = int(np.argmin(cost))
        if leads_on and not math.isfinite(cost[best]):
            return None  # only turning to and fro is left: back up
        if not math.isfinite(cost[best]):
            raise ControlError("no free trajectory leads on along the plan")
        twist = Twist2D(*samples[best].tolist())
        self._local_plan = self._obstacles.trace(view.pose, view.velocity, twist, motion)
        return twist

    def _nose(self, view: LocalView, plan: Array) -> float:
        to_goal = float(np.hypot(plan[-1, 0] - view.pose.x, plan[-1, 1] - view.pose.y))
        return min(self._driven.heading_lookahead, 0.5 * to_goal)

    def _distance_costs(self, situation: Situation, resolution: float) -> Array:
        """Costs of the distances to plan and goal, shape (K,)."""
        p = self._driven
        if p.simple_attractor:
            return p.goal_distance_bias * self._attraction.score(situation)
        scale = 1.0 if p.meter_scoring else 1.0 / resolution
        to_plan, to_goal = self._path.score(situation), self._goal.score(situation)
        if p.heading_scoring:
            turned = _HEADING_WEIGHT * self._heading.score(situation)
            return scale * (p.path_distance_bias * to_plan + p.goal_distance_bias * to_goal) + turned
        to_plan = 0.5 * (to_plan + self._alignment.score(situation))
        to_goal = 0.5 * (to_goal + self._facing.score(situation))
        return scale * (p.path_distance_bias * to_plan + p.goal_distance_bias * to_goal)

    def _limited(self, view: LocalView, twist: Twist2D) -> Twist2D:
        """Limit the velocity to what the accelerations allow in two cycles (the measured velocity lags)."""
        p = self._driven
        dt = 2.0 / p.controller_frequency
        vx = min(twist.vx, max(view.velocity.vx, 0.0) + p.acc_lim_x * dt)
        vx = max(vx, min(twist.vx, p.min_vel_x))
        least = p.min_in_place_vel_theta if vx == 0.0 else 0.0
        most = max(abs(view.velocity.wz) + p.acc_lim_theta * dt, least)
        return Twist2D(vx, twist.vy, math.copysign(min(abs(twist.wz), most), twist.wz))

    # ---- escape

    def _is_escaping(self, view: LocalView) -> bool:
        """Whether it still backs up: until it has moved or turned enough, or for some time."""
        start, p = self._escape_from, self._driven
        if start is None:
            return False
        gone = math.hypot(view.pose.x - start.x, view.pose.y - start.y)
        turned = abs(angle_difference(view.pose.yaw, start.yaw))
        is_over = not 0.0 <= view.now - self._escape_since <= _ESCAPE_TIME  # a person who came too near may have left
        if gone > p.escape_reset_dist or turned > p.escape_reset_theta or is_over:
            self._escape_from = None
        return self._escape_from is not None

    def _escape(self, view: LocalView) -> Twist2D:
        """Back up a little if the space behind is free."""
        p = self._driven
        if p.escape_vel == 0.0:
            raise ControlError(_NOTHING_FREE)
        twist = Twist2D(p.escape_vel, 0.0, 0.0)
        motion = replace(self._motion(p.sim_time), scored_at=None)
        if not self._can_drive(view, twist, motion):
            self._escape_from = None
            raise ControlError(f"{_NOTHING_FREE}, not even backwards")
        if self._escape_from is None:
            self._escape_from, self._escape_since = view.pose, view.now
        self._local_plan = self._obstacles.trace(view.pose, STOP, twist, motion)
        return twist

    def _can_drive(self, view: LocalView, twist: Twist2D, motion: Motion) -> bool:
        samples = np.array([twist], dtype=np.float64)
        around = self._obstacles.survey(view.costmap, view.pose, motion.reach(samples, view.velocity))
        return bool(np.isfinite(self._obstacles.drive(around, view.velocity, samples, motion)[0]))
