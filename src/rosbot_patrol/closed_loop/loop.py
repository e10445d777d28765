"""The robot's own programs in one process with the simulator, on its clock: amcl, costmaps, move_base, guard.

What runs in several nodes on a robot runs here step by step, with the same objects and parameters, so that a drive is
repeatable bit for bit and many times faster than real time. Times that messages and threads take are stood in for by
`Delays`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rosbot_patrol.amcl.localizer import Localizer
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.closed_loop.delayed_plans import DelayedPlans
from rosbot_patrol.closed_loop.low_sight import LowSight
from rosbot_patrol.control.collision_guard import CollisionGuard, GuardParams
from rosbot_patrol.control.give_way import GiveWay, GiveWayParams
from rosbot_patrol.control.movers import MoverParams, MoverWatch
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.obstacle import observe_level
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D, compose, invert
from rosbot_patrol.grid import Grid
from rosbot_patrol.navigation.interfaces import NavigatorView, Outcome, Reason
from rosbot_patrol.navigation.navigator import Navigator
from rosbot_patrol.navigation.params import MoveBaseParams
from rosbot_patrol.package_files import read_move_base
from rosbot_patrol.params import load
from rosbot_patrol.planning.interfaces import Array, LocalView, RecoveryView
from rosbot_patrol.planning.registry import make_global_planner, make_local_planner, make_recoveries
from rosbot_patrol.scan import LevelScan
from rosbot_patrol.simulation.engine import STEP, Engine
from rosbot_patrol.yaml_files import read_mapping


@dataclass(frozen=True, kw_only=True)
class Delays:
    """What messages and threads take [s]: from a scan to the command that it leads to, and from a request to a plan."""

    command: float = 0.05
    plan: float = 0.2


@dataclass(frozen=True, kw_only=True)
class StackParams:
    """Parameters of the programs, as their nodes read them.

    Attributes:
        move_base: move_base's private namespace.
    """

    move_base: Mapping[str, Any]
    amcl: AmclParams = field(default_factory=AmclParams)
    guard: GuardParams = field(default_factory=GuardParams)
    movers: MoverParams = field(default_factory=MoverParams)
    give_way: GiveWayParams = field(default_factory=GiveWayParams)


def read_profile(folder: Path) -> StackParams:
    """A profile's yaml files, such as those of `config/tuned`; raises ParamError."""
    tree = read_move_base(folder)
    known = read_mapping(folder / "amcl.yaml", keys="of amcl")
    amcl = {k: v for k, v in known.items() if not k.endswith("_frame_id")}
    return StackParams(move_base=tree, amcl=load(AmclParams, amcl, name="amcl/"))


@dataclass
class Drive:
    """What a drive to one goal gave.

    Attributes:
        outcome: move_base's, None where it took longer than it was given.
        seconds: simulated time.
        planned: length of the first plan [m].
        contacts: what was touched, with the time of the first touch of each bout.
        waited: time in which it stood for someone [s].
        recoveries: names of the behaviours run.
        error: from the goal, by ground truth [m].
    """

    outcome: Outcome | None = None
    seconds: float = 0.0
    planned: float = 0.0
    contacts: list[tuple[float, str, str]] = field(default_factory=list)
    waited: float = 0.0
    recoveries: list[str] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    error: float = math.inf


class ClosedLoop:
    """A simulated robot that drives itself.

    Args:
        engine: with the robot in it.
        known: the map.
        params: of the programs.
        delays: of what stands between them.
        seed: of amcl.
    """

    def __init__(
        self, engine: Engine, known: Grid, params: StackParams, *, delays: Delays | None = None, seed: int = 0
    ) -> None:
        self.engine = engine
        self._delays = delays or Delays()
        tree = params.move_base
        own = {k: v for k, v in tree.items() if not isinstance(v, dict)}
        self._params = load(MoveBaseParams, own, name="move_base/", ignore=["recovery_behaviors"])
        self.global_costmap = LayeredCostmap(read_costmap(tree["global_costmap"], name="global_costmap/"))
        self.local_costmap = LayeredCostmap(read_costmap(tree["local_costmap"], name="local_costmap/"))
        for layer in self.global_costmap.static_layers:
            layer.set_map(known)
        self._planner = make_global_planner(self._params.base_global_planner, tree)
        self._plans = DelayedPlans(self._plan, lambda: self.now, self._delays.plan)
        self.controller = make_local_planner(
            self._params.base_local_planner,
            tree,
            self.local_costmap,
            controller_frequency=self._params.controller_frequency,
        )
        p = self._params
        self.navigator = Navigator(
            p,
            plans=self._plans,
            controller=self.controller,
            recoveries=make_recoveries(
                tree,
                conservative=p.conservative_reset_dist,
                clearing_radius=p.aggressive_radius,
                clearing_rotation=p.clearing_rotation_allowed,
            ),
        )
        self._localizer = Localizer(params.amcl, np.random.default_rng(seed))
        self._localizer.set_map(known)
        self._localizer.set_pose(engine.pose, np.diag([0.01, 0.01, 0.005]))
        self._guard = CollisionGuard(params.guard)
        self._low_sight = LowSight(engine, (self.local_costmap, self.global_costmap), self._guard)
        self._movers = MoverWatch(params.movers)
        self._give_way = GiveWay(params.give_way)
        self._commands: deque[tuple[float, Twist2D]] = deque()
        self._map_from_odom = engine.pose
        self._every = round(1.0 / p.controller_frequency / STEP)
        self._ticks = 0
        self._moved_at = -math.inf
        self._touching: set[str] = set()
        self.drive = Drive()

    @property
    def now(self) -> float:
        """Simulated time [s]."""
        return self.engine.now

    @property
    def odom_pose(self) -> Pose2D:
        """odom_from_base."""
        return self.engine.robot.odometry.pose

    @property
    def map_pose(self) -> Pose2D:
        """map_from_base, as amcl believes."""
        return compose(self._map_from_odom, self.odom_pose)

    def _plan(self, goal: Pose2D) -> Array:
        grid = Grid(self.global_costmap.info, self.global_costmap.cells.copy())
        return self._planner.plan(grid, self.map_pose, goal)

    def drive_to(self, goal: Pose2D, timeout: float, *, each_step: Callable[[], None] = lambda: None) -> Drive:
        """Drive to a goal in the frame of the map, for at most a time [s]; `each_step` is called after each."""
        self.drive = Drive()
        begin = self.now
        self._tick()
        self.navigator.set_goal(goal, self.now)
        while self.now < begin + timeout and self.drive.outcome is None:
            self._step()
            each_step()
        if self.drive.outcome is None:
            self.navigator.cancel()
        self._stand()
        self.drive.seconds = self.now - begin
        self.drive.error = math.hypot(self.engine.pose.x - goal.x, self.engine.pose.y - goal.y)
        return self.drive

    def _stand(self) -> None:
        self._commands.clear()
        for _ in range(round(0.5 / STEP)):
            self.engine.command(STOP)
            self.engine.step()

    def _step(self) -> None:
        while self._commands and self._commands[0][0] <= self.now:
            self.engine.command(self._commands.popleft()[1])
        self.engine.step()
        self._watch_contacts()
        self._ticks += 1
        if self._ticks % self._every == 0:
            self._tick()

    def _watch_contacts(self) -> None:
        if max(map(abs, self.engine.robot.wheels[1])) > 0.05:
            self._moved_at = self.now
        touching = {touch.other: touch.kind for touch in self.engine.touches()}
        for name, kind in touching.items():
            stood = self.now - self._moved_at
            if name not in self._touching and not (kind in ("person", "pet") and stood >= 0.5):
                self.drive.contacts.append((self.now, kind, name))
        self._touching = set(touching)

    def _tick(self) -> None:
        """One scan, and everything that follows from it."""
        now, odom = self.now, self.odom_pose
        level = self.engine.level_scan()
        localized = self._localizer.update(level.scan, odom, level.pose)
        if localized.estimate is not None and self._localizer.map_from_odom is not None:
            self._map_from_odom = self._localizer.map_from_odom
        self._guard.see(level.scan, level.pose, now, odom)
        self._low_sight.look(now, odom, (odom, self.map_pose))
        self._movers.see(level.scan, compose(odom, level.pose))
        self._update(self.local_costmap, self.odom_pose, level)
        if self._ticks % (5 * self._every) == 0:
            self._update(self.global_costmap, self.map_pose, level)
        command = self.navigator.step(now, self._view(now))
        if command.outcome is not None:
            self.drive.outcome = command.outcome
        if command.recovery is not None:
            self.drive.recoveries.append(command.recovery[2])
        if command.text not in self.drive.reasons[-1:]:
            self.drive.reasons.append(command.text)
        if command.plan is not None and not self.drive.planned:
            self.drive.planned = float(np.hypot(*np.diff(command.plan[:, :2], axis=0).T).sum())
        if command.twist is None:
            return
        verdict = self._guard.limit(command.twist, now, odom)
        if command.reason is Reason.WAITING:
            self.drive.waited += self._every * STEP
        self._commands.append((now + self._delays.command, verdict.twist))

    def _update(self, costmap: LayeredCostmap, pose: Pose2D, seen: LevelScan) -> None:
        level = replace(seen, pose=compose(pose, seen.pose))
        for layer in costmap.obstacle_layers:
            for buffer in layer.buffers.values():
                if buffer.params.data_type == "LaserScan":
                    buffer.add(observe_level(level, buffer.params, layer.params.max_obstacle_height))
        costmap.update(self.now, pose)

    def _view(self, now: float) -> NavigatorView:
        odom, local = self.odom_pose, self.local_costmap
        return NavigatorView(
            local=LocalView(
                now=now,
                pose=odom,
                velocity=self.engine.robot.odometry.twist,
                costmap=Grid(local.info, local.cells.copy()),
                local_from_plan=invert(self._map_from_odom),
            ),
            recovery=RecoveryView(
                now=now,
                pose_global=self.map_pose,
                pose_local=odom,
                global_costmap=self.global_costmap,
                local_costmap=local,
            ),
            must_wait=lambda wish: self._give_way.waits(wish, self._movers.movers(now), odom, now),
        )

    @property
    def plan(self) -> Array:
        """The plan that is followed, in the local costmap's frame."""
        return self.controller.visible_plan
