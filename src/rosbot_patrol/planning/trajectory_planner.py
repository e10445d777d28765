"""Local planner under the name base_local_planner/TrajectoryPlannerROS (matches base_local_planner 1.17).

It samples forward and turning velocities, simulates each for `sim_time`, and takes the one with the least of
path_distance_bias * distance to the plan + goal_distance_bias * distance to the local goal + occdist_scale * cost;
at the goal it stops, turns to the heading and is done. Parameters have upstream's names, and the defaults of its
dynamic_reconfigure file, which win there.

Differs:
    - Distances are Euclidean around obstacles, interpolated, and judged at the trajectory's end and at a point
      `heading_lookahead` ahead of it; upstream counts 4-connected cells.
    - Where nothing is free over `sim_time`, slow motions are tried over 0.6 s before it backs up.
    - It backs up only where the way behind is free; upstream does so blindly.
    - A robot whose footprint touches an obstacle may move so that it touches less; upstream finds no trajectory.
    - Where the plan is blocked in view and nothing leads round, it stops short of the place and says so.
    - `heading_scoring`, `simple_attractor`, `dwa`, `holonomic_robot`, `y_vels` and `acc_lim_y` are accepted and have no
      effect: the base is driven as a differential drive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.errors import ControlError
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D, angle_difference, compose_poses
from rosbot_patrol.grid import Grid, GridInfo, cells_of_points
from rosbot_patrol.params import param
from rosbot_patrol.planning import critic_kernels as kernels
from rosbot_patrol.planning.critics import GoalDistanceCritic, ObstacleCritic, PathDistanceCritic, Situation
from rosbot_patrol.planning.critics.field import distance_field
from rosbot_patrol.planning.interfaces import Array, LocalPlanner, LocalView

_COARSE = 0.05  # edge of the cells of distance fields [m]
_SHORT, _SLOW = 0.6, 0.1  # how far ahead [s] slow motions [m/s] are looked at where it is narrow
_TOO_NEAR = 0.3  # of a plan that is blocked, less than this ahead is not worth driving [m]


@dataclass(frozen=True, kw_only=True)
class TrajectoryPlannerParams:
    """Parameters of TrajectoryPlannerROS; names and defaults as upstream."""

    max_vel_x: float = param(0.55, unit="m/s", lo=0.0, doc="top forward speed")
    min_vel_x: float = param(0.0, unit="m/s", lo=0.0, doc="slowest forward speed that moves the base")
    max_vel_theta: float = param(1.0, unit="rad/s", lo=0.0, doc="top turning speed")
    min_vel_theta: float = param(-1.0, unit="rad/s", hi=0.0, doc="top turning speed to the right")
    min_in_place_vel_theta: float = param(0.4, unit="rad/s", lo=0.0, doc="slowest turn on the spot that moves the base")
    max_rotational_vel: float = param(1.0, unit="rad/s", lo=0.0, doc="top speed when turning to the goal's heading")
    acc_lim_x: float = param(2.5, unit="m/s^2", lo=0.0, doc="forward acceleration")
    acc_lim_y: float = param(2.5, unit="m/s^2", lo=0.0, doc="accepted, has no effect")
    acc_lim_theta: float = param(3.2, unit="rad/s^2", lo=0.0, doc="turning acceleration")
    sim_time: float = param(1.7, unit="s", lo=0.1, hi=10.0, doc="how far ahead is simulated")
    sim_granularity: float = param(0.025, unit="m", lo=0.001, doc="step between poses that are checked")
    angular_sim_granularity: float = param(0.1, unit="rad", lo=0.001, doc="the same for turning")
    vx_samples: int = param(20, lo=1, hi=200, doc="forward speeds tried")
    vtheta_samples: int = param(20, lo=1, hi=200, doc="turning speeds tried")
    path_distance_bias: float = param(0.6, lo=0.0, doc="weight of staying on the plan")
    goal_distance_bias: float = param(0.8, lo=0.0, doc="weight of getting on")
    occdist_scale: float = param(0.01, lo=0.0, doc="weight of staying away from obstacles")
    meter_scoring: bool = param(False, doc="distances in metres instead of cells")
    heading_lookahead: float = param(0.325, unit="m", lo=0.0, doc="point ahead at which alignment is judged")
    oscillation_reset_dist: float = param(0.05, unit="m", lo=0.0, doc="motion after which directions may change again")
    escape_vel: float = param(-0.1, unit="m/s", hi=0.0, doc="speed of backing up")
    escape_reset_dist: float = param(0.1, unit="m", lo=0.0, doc="how far it backs up")
    escape_reset_theta: float = param(math.pi / 2, unit="rad", lo=0.0, doc="or how far it turns meanwhile")
    xy_goal_tolerance: float = param(0.10, unit="m", lo=0.0, doc="how near to the goal is there")
    yaw_goal_tolerance: float = param(0.05, unit="rad", lo=0.0, doc="how near to its heading is right")
    latch_xy_goal_tolerance: bool = param(False, doc="once there, only turn")
    rot_stopped_velocity: float = param(0.01, unit="rad/s", lo=0.0, doc="slower is standing")
    trans_stopped_velocity: float = param(0.01, unit="m/s", lo=0.0, doc="slower is standing")
    prune_plan: bool = param(True, doc="drop the part of the plan that is behind")
    holonomic_robot: bool = param(True, doc="accepted, has no effect")
    dwa: bool = param(False, doc="accepted, has no effect")
    heading_scoring: bool = param(False, doc="accepted, has no effect")
    heading_scoring_timestep: float = param(0.8, doc="accepted, has no effect")
    simple_attractor: bool = param(False, doc="accepted, has no effect")
    stop_time_buffer: float = param(0.2, doc="accepted, has no effect")
    y_vels: Any = param("-0.3,-0.1,0.1,0.3", doc="accepted, has no effect")
    y_samples: int = param(0, doc="accepted, has no effect")
    publish_cost_grid_pc: bool = param(False, doc="accepted, has no effect")
    global_frame_id: str = param("odom", doc="accepted, has no effect")
    sim_period: float = param(0.1, doc="accepted, has no effect")
    controller_frequency: float = param(
        20.0, unit="Hz", lo=0.1, doc="cycles a second, for accelerations; move_base's own where not given"
    )


@dataclass
class _Memory:
    """What is remembered from cycle to cycle."""

    xy_reached: bool = False
    turning_to_goal: bool = False
    escape_from: Pose2D | None = None
    turn_sign: int = 0  # direction of the last turn on the spot, 0 where both are free
    turned_at: Pose2D = field(default_factory=Pose2D)
    passed: int = 0  # index of the plan's pose that the robot is at


class TrajectoryPlanner(LocalPlanner):
    """Samples velocities and drives the best.

    Args:
        params: as upstream.
        footprint: the robot's padded outline.
        circumscribed_cost: see `ObstacleCritic`.
        resolution: of the local costmap [m].
    """

    def __init__(
        self, params: TrajectoryPlannerParams, footprint: Footprint, *, resolution: float, circumscribed_cost: int = 0
    ) -> None:
        self.params = params
        self._obstacles = ObstacleCritic(footprint, resolution=resolution, circumscribed_cost=circumscribed_cost)
        self._path_distance = PathDistanceCritic()
        self._goal_distance = GoalDistanceCritic()
        self._plan: Array = np.empty((0, 3))
        self._memory = _Memory()
        self._local_plan: Array = np.empty((0, 3))
        self._visible: Array = np.empty((0, 3))

    def reset(self) -> None:
        """Forget the goal that was worked on."""
        self._memory = _Memory()

    def set_plan(self, poses: Array) -> None:
        """Follow a new plan."""
        if len(poses) == 0:
            raise ControlError("a plan without poses cannot be followed")
        same_goal = len(self._plan) > 0 and np.allclose(self._plan[-1], poses[-1], atol=1e-6)
        if not same_goal:
            self._memory.xy_reached = self._memory.turning_to_goal = False
        self._memory.passed = 0
        self._plan = np.array(poses, dtype=np.float64)

    @property
    def local_plan(self) -> Array:
        """What the last velocity would drive."""
        return self._local_plan

    @property
    def visible_plan(self) -> Array:
        """The part of the plan that is followed now."""
        return self._visible

    def is_goal_reached(self, view: LocalView) -> bool:
        """Whether the robot stands at the goal, turned as it should."""
        if len(self._plan) == 0 or not self._is_at_goal_xy(view):
            return False
        p, goal = self.params, self._goal(view)
        return abs(angle_difference(goal.yaw, view.pose.yaw)) <= p.yaw_goal_tolerance and self._is_standing(view)

    def _is_standing(self, view: LocalView) -> bool:
        v = view.velocity
        return abs(v.wz) <= self.params.rot_stopped_velocity and abs(v.vx) <= self.params.trans_stopped_velocity

    def _goal(self, view: LocalView) -> Pose2D:
        return view.local_from_plan @ Pose2D(*self._plan[-1].tolist())

    def _is_at_goal_xy(self, view: LocalView) -> bool:
        goal = self._goal(view)
        near = math.hypot(goal.x - view.pose.x, goal.y - view.pose.y) <= self.params.xy_goal_tolerance
        if near and self.params.latch_xy_goal_tolerance:
            self._memory.xy_reached = True
        return near or self._memory.xy_reached

    def compute(self, view: LocalView) -> Twist2D:
        """The velocity for this cycle; raises ControlError."""
        if len(self._plan) == 0:
            raise ControlError("there is no plan to follow")
        if self._is_at_goal_xy(view):
            return self._turn_to_goal(view)
        self._memory.turning_to_goal = False
        plan = self._part_in_view(view)
        self._visible = plan
        return self._follow(view, plan)

    # ---- following

    def _part_in_view(self, view: LocalView) -> Array:
        """The plan in the local frame, from where the robot is to where it leaves the local costmap."""
        memory = self._memory
        poses = compose_poses(view.local_from_plan, self._plan[memory.passed :])
        distances = np.hypot(poses[:, 0] - view.pose.x, poses[:, 1] - view.pose.y)
        # nearest point, but not one of a later leg that only passes by
        along = np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0, prepend=poses[:1, :2]).T))
        window = max(1, int(np.searchsorted(along, 1.0 + distances[0])))
        nearest = int(np.argmin(distances[:window]))
        if self.params.prune_plan:
            memory.passed += nearest
        poses = poses[nearest:]
        info = view.costmap.info
        cells = np.floor((poses[:, :2] - (info.origin_x, info.origin_y)) / info.resolution)
        inside = ((cells >= 1) & (cells < (info.width - 1, info.height - 1))).all(axis=1)
        if not inside[0]:
            raise ControlError("the plan does not pass through the local costmap")
        last = len(inside) if inside.all() else int(np.argmin(inside))
        return poses[:last]

    def _situation(self, view: LocalView, trajectories: Array, plan: Array) -> Situation:
        info = view.costmap.info
        factor = max(1, round(_COARSE / info.resolution))
        cells = kernels.shrink(view.costmap.cells, factor) if factor > 1 else view.costmap.cells
        coarse = GridInfo(
            resolution=info.resolution * factor,
            width=cells.shape[1],
            height=cells.shape[0],
            origin_x=info.origin_x,
            origin_y=info.origin_y,
        )
        plan = self._reachable_part(view, plan, Grid(coarse, cells))
        to_goal = float(np.hypot(plan[-1, 0] - view.pose.x, plan[-1, 1] - view.pose.y))
        nose = min(self.params.heading_lookahead, 0.5 * to_goal)
        return Situation(
            pose=view.pose,
            trajectories=trajectories,
            costmap=view.costmap,
            coarse=coarse,
            coarse_cells=cells,
            plan=plan,
            nose=nose,
        )

    def _reachable_part(self, view: LocalView, plan: Array, grid: Grid) -> Array:
        """The plan up to its last pose in view that the robot can get to.

        Raises:
            ControlError: something stands on the plan right ahead, and nothing leads round it.
        """
        info = grid.info
        here = np.array([info.cell_of_clamped(view.pose.x, view.pose.y)])
        distances = distance_field(info, grid.cells, here)
        ix, iy = cells_of_points(info, plan[:, :2]).T
        reachable = np.isfinite(distances[iy.clip(0, info.height - 1), ix.clip(0, info.width - 1)])
        last = int(np.flatnonzero(reachable)[-1]) if reachable.any() else -1
        if last == len(plan) - 1:
            return plan
        gap = math.hypot(plan[last, 0] - view.pose.x, plan[last, 1] - view.pose.y) if last >= 0 else 0.0
        if gap < _TOO_NEAR:
            raise ControlError("something stands on the plan and there is no way round it in view")
        return plan[: last + 1]

    def _follow(self, view: LocalView, plan: Array) -> Twist2D:
        """The best of all samples; where none is free, of slow ones that are looked at less far ahead."""
        p = self.params
        samples = self._samples(view)
        slow = np.ascontiguousarray(samples[samples[:, 0] <= max(p.min_vel_x, _SLOW)])
        for tried, horizon in ((samples, p.sim_time), (slow, min(p.sim_time, _SHORT))):
            best = self._best(view, plan, tried, horizon)
            if best is not None:
                self._memory.escape_from = None
                self._remember_turn(view, best)
                return self._limited(view, best)
        return self._escape(view)

    def _best(self, view: LocalView, plan: Array, samples: Array, horizon: float) -> Twist2D | None:
        """The cheapest sample, None where none is free.

        Raises:
            ControlError: some are free, but lead nowhere.
        """
        p = self.params
        trajectories = self._simulate(view, samples, horizon)
        situation = self._situation(view, trajectories, plan)
        # the base may follow at once, or as slowly as its accelerations say: both have to be free
        sudden = self._simulate(view, samples, min(horizon, _SHORT), sudden=True)
        danger = 0.5 * self._obstacles.score(situation) + 0.5 * self._obstacles.check(sudden, view.costmap, view.pose)
        if not np.isfinite(danger).any():
            return None
        scale = situation.coarse.resolution
        if not p.meter_scoring:
            scale /= view.costmap.info.resolution
        cost = p.occdist_scale * danger
        cost += p.path_distance_bias * scale * self._path_distance.score(situation)
        cost += p.goal_distance_bias * scale * self._goal_distance.score(situation)
        cost = self._without_reversals(view, samples, cost)
        best = int(np.argmin(cost))
        if not math.isfinite(cost[best]):
            raise ControlError("no free trajectory leads on along the plan")
        self._local_plan = trajectories[best]
        return Twist2D(float(samples[best, 0]), 0.0, float(samples[best, 1]))

    def _samples(self, view: LocalView) -> Array:
        """Velocities to try (vx, wz), shape (K, 2): all pairs, turns on the spot."""
        p = self.params
        goal = self._goal(view)
        to_goal = math.hypot(goal.x - view.pose.x, goal.y - view.pose.y)
        # slow down in time to stand at the goal
        top = min(p.max_vel_x, max(p.min_vel_x, to_goal / p.sim_time, 0.05))
        fastest = min(top, max(view.velocity.vx, 0.0) + p.acc_lim_x * p.sim_time)
        slowest = min(max(p.min_vel_x, view.velocity.vx - p.acc_lim_x * p.sim_time), fastest)
        vx = np.linspace(slowest, fastest, p.vx_samples)
        vx = vx[vx > 1e-3]
        wz = np.linspace(p.min_vel_theta, p.max_vel_theta, p.vtheta_samples)
        wz = np.append(wz, 0.0)
        pairs = np.array(np.meshgrid(vx, wz)).reshape(2, -1).T
        turns = wz[np.abs(wz) >= p.min_in_place_vel_theta]
        slow = np.array([-p.min_in_place_vel_theta, p.min_in_place_vel_theta])
        turns = np.concatenate((turns, slow))
        spot = np.column_stack((np.zeros_like(turns), turns))
        return np.ascontiguousarray(np.concatenate((pairs, spot)))

    def _simulate(self, view: LocalView, samples: Array, horizon: float, *, sudden: bool = False) -> Array:
        p = self.params
        limits = (1e6, 1e6) if sudden else (p.acc_lim_x, p.acc_lim_theta)
        speed, turn = float(np.abs(samples[:, 0]).max()), float(np.abs(samples[:, 1]).max())
        steps = max(speed * horizon / p.sim_granularity, turn * horizon / p.angular_sim_granularity)
        pose = np.array(view.pose, dtype=np.float64)
        velocity = np.array([view.velocity.vx, view.velocity.wz])
        return kernels.simulate(pose, samples, velocity, horizon, max(4, math.ceil(steps)), *limits)

    def _limited(self, view: LocalView, twist: Twist2D) -> Twist2D:
        """Never more than an acceleration allows in two cycles (the measured velocity lags)."""
        p = self.params
        dt = 2.0 / p.controller_frequency
        vx = min(twist.vx, max(view.velocity.vx, 0.0) + p.acc_lim_x * dt)
        return Twist2D(max(vx, min(twist.vx, p.min_vel_x)), 0.0, twist.wz)

    # ---- oscillation, escape

    def _without_reversals(self, view: LocalView, samples: Array, cost: Array) -> Array:
        """Turning on the spot keeps its direction until the robot has moved."""
        memory = self._memory
        moved = math.hypot(view.pose.x - memory.turned_at.x, view.pose.y - memory.turned_at.y)
        turned = abs(angle_difference(view.pose.yaw, memory.turned_at.yaw))
        if memory.turn_sign and (moved > self.params.oscillation_reset_dist or turned > math.pi / 2):
            memory.turn_sign = 0
        if memory.turn_sign:
            against = (np.abs(samples[:, 0]) < 1e-3) & (np.sign(samples[:, 1]) == -memory.turn_sign)
            cost = np.where(against, np.inf, cost)
        return cost

    def _remember_turn(self, view: LocalView, twist: Twist2D) -> None:
        if abs(twist.vx) < 1e-3 and self._memory.turn_sign == 0:
            self._memory.turn_sign = 1 if twist.wz > 0.0 else -1
            self._memory.turned_at = view.pose

    def _escape(self, view: LocalView) -> Twist2D:
        """Back up a little where that is free."""
        p, memory = self.params, self._memory
        if memory.escape_from is None:
            memory.escape_from = view.pose
        start = memory.escape_from
        gone = math.hypot(view.pose.x - start.x, view.pose.y - start.y)
        turned = abs(angle_difference(view.pose.yaw, start.yaw))
        if p.escape_vel == 0.0 or gone > p.escape_reset_dist or turned > p.escape_reset_theta:
            memory.escape_from = None
            raise ControlError("no trajectory is free of obstacles")
        samples = np.array([[p.escape_vel, 0.0]])
        trajectories = self._simulate(view, samples, p.sim_time)
        if not self._is_free(view, trajectories):
            raise ControlError("no trajectory is free of obstacles, not even backwards")
        self._local_plan = trajectories[0]
        return Twist2D(p.escape_vel, 0.0, 0.0)

    def _is_free(self, view: LocalView, trajectories: Array) -> bool:
        return bool(np.isfinite(self._obstacles.check(trajectories, view.costmap, view.pose)).all())

    # ---- at the goal

    def _turn_to_goal(self, view: LocalView) -> Twist2D:
        p, memory = self.params, self._memory
        goal = self._goal(view)
        self._visible = np.array([view.pose, goal])
        self._local_plan = np.empty((0, 3))
        error = angle_difference(goal.yaw, view.pose.yaw)
        if abs(error) <= p.yaw_goal_tolerance:
            memory.turning_to_goal = False
            return STOP
        if not memory.turning_to_goal and not self._is_standing(view) and abs(view.velocity.vx) > 0.05:
            return STOP
        memory.turning_to_goal = True
        # fast enough to arrive, slow enough to stop in time
        speed = min(p.max_rotational_vel, math.sqrt(2.0 * p.acc_lim_theta * abs(error)), 2.0 * abs(error))
        speed = max(speed, p.min_in_place_vel_theta)
        speed = min(speed, p.max_vel_theta if error > 0.0 else -p.min_vel_theta)
        twist = Twist2D(0.0, 0.0, math.copysign(speed, error))
        check = np.array([[0.0, twist.wz]])
        short = kernels.simulate(
            np.array(view.pose), check, np.array([0.0, twist.wz]), min(0.5, abs(error) / max(speed, 1e-3)), 8, 1.0, 10.0
        )
        if not self._is_free(view, short):
            raise ControlError("there is no room to turn to the goal's heading")
        return twist
