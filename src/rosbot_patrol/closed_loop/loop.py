"""Closed loop: the robot's own programs (amcl, costmaps, move_base, guard) in one process with the simulator.

The programs of several nodes run here step by step, with the same objects and parameters. So a drive is repeatable bit
for bit and many times faster than real time. `Delays` stands for the times that messages and threads take.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rosbot_patrol.amcl.core import AmclCore
from rosbot_patrol.amcl.initial_pose import PoseRecord
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.closed_loop.delayed_plans import DelayedPlans
from rosbot_patrol.closed_loop.frames import BASE, MAP, ODOM, add_pose, tree_of
from rosbot_patrol.closed_loop.low_sight import LowSight
from rosbot_patrol.control.collision_guard import CollisionGuard, GuardParams
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D, compose
from rosbot_patrol.grid import Grid
from rosbot_patrol.navigation.interfaces import Command, Outcome, PlanSource, Reason
from rosbot_patrol.navigation.stack import NavigationStack
from rosbot_patrol.package_files import read_move_base
from rosbot_patrol.params import load
from rosbot_patrol.planning.interfaces import Array
from rosbot_patrol.simulation.engine import STEP, Engine
from rosbot_patrol.yaml_files import read_mapping

_START_VARIANCE = (0.01, 0.01, 0.005)  # of x, y [m^2] and yaw [rad^2]
_GLOBAL_EVERY = 5  # number of cycles between updates of the global costmap


@dataclass(frozen=True, kw_only=True)
class Delays:
    """Delays of messages and threads [s]: from a scan to its command, and from a request to its plan."""

    command: float = 0.05
    plan: float = 0.2


@dataclass(frozen=True, kw_only=True)
class StackParams:
    """Parameters of the programs, as read by their nodes.

    Attributes:
        move_base: move_base's private namespace.
    """

    move_base: Mapping[str, Any]
    amcl: AmclParams = field(default_factory=AmclParams)
    guard: GuardParams = field(default_factory=GuardParams)


def read_profile(folder: Path) -> StackParams:
    """Read a profile's yaml files, such as those of `config/tuned`; raises ParamError."""
    tree = read_move_base(folder)
    known = read_mapping(folder / "amcl.yaml", keys="of amcl")
    amcl = {k: v for k, v in known.items() if not k.endswith("_frame_id")}
    return StackParams(move_base=tree, amcl=load(AmclParams, amcl, name="amcl/"))


@dataclass
class Drive:
    """Result of a drive to one goal.

    Attributes:
        outcome: move_base's, None after the time limit.
        seconds: simulated time.
        planned: length of the first plan [m].
        contacts: touched objects, with the time of each first touch.
        waited: time of waiting for people [s].
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
        delays: between them.
        seed: of amcl.
    """

    def __init__(
        self, engine: Engine, known: Grid, params: StackParams, *, delays: Delays | None = None, seed: int = 0
    ) -> None:
        self.engine = engine
        self._delays = delays or Delays()
        self._tree = tree_of(engine.robot.description)
        self.stack = NavigationStack(params.move_base, self._tree, self._make_plans, name="move_base/", now=engine.now)
        self._amcl = AmclCore(params.amcl, self._tree, np.random.default_rng(seed))
        self._guard = CollisionGuard(params.guard)
        self._low_sight = LowSight(engine, self.stack.costmaps, self._guard)
        for layer in self.stack.global_costmap.map_layers:
            self.stack.global_costmap.hear_map(layer, known, MAP)
        self._start_amcl(known)
        self._commands: deque[tuple[float, Twist2D]] = deque()
        self._map_from_odom = engine.pose
        self._every = round(1.0 / self.stack.params.controller_frequency / STEP)
        self._ticks = 0
        self._moved_at = -math.inf
        self._touching: set[str] = set()
        self.drive = Drive()

    def _make_plans(self, stack: NavigationStack) -> PlanSource:
        return DelayedPlans(lambda goal: stack.plan_from_robot(goal, self.now), lambda: self.now, self._delays.plan)

    def _start_amcl(self, known: Grid) -> None:
        covariance = np.zeros((6, 6))
        covariance[[0, 1, 5], [0, 1, 5]] = _START_VARIANCE
        self._amcl.hear_map(known)
        self._amcl.hear_initial_pose(PoseRecord(MAP, 0.0, self.engine.pose, covariance), self.now)

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
        """map_from_base, as estimated by amcl."""
        return compose(self._map_from_odom, self.odom_pose)

    @property
    def global_costmap(self) -> LayeredCostmap:
        """Costmap on which plans are made."""
        return self.stack.global_costmap.costmap

    def drive_to(self, goal: Pose2D, timeout: float, *, each_step: Callable[[], None] = lambda: None) -> Drive:
        """Drive to a goal in the map frame, with a time limit [s]; `each_step` is called after each step."""
        self.drive = Drive()
        begin = self.now
        self._tick()
        self.stack.navigator.set_goal(goal, self.now)
        while self.now < begin + timeout and self.drive.outcome is None:
            self._step()
            each_step()
        if self.drive.outcome is None:
            self.stack.navigator.cancel()
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
        """Process one scan with all its consequences."""
        now, odom = self.now, self.odom_pose
        add_pose(self._tree, ODOM, BASE, odom, now)
        self._see(now)
        add_pose(self._tree, MAP, ODOM, self._map_from_odom, now)
        self._low_sight.look(now, odom)
        self.stack.hear_velocity(self.engine.robot.odometry.twist, now)
        self.stack.local_costmap.update(now)
        if self._ticks % (_GLOBAL_EVERY * self._every) == 0:
            self.stack.global_costmap.update(now)
        command = self.stack.step(now).command
        self._note(command)
        if command.twist is not None:
            verdict = self._guard.limit(command.twist, now, odom)
            self._commands.append((now + self._delays.command, verdict.twist))

    def _see(self, now: float) -> None:
        """Pass a scan to all programs; amcl and the guard take it level."""
        scan = self.engine.scan()
        for costmap in self.stack.costmaps:
            for each in costmap.scan_inputs:
                each.hear(scan, now)
        self.stack.people.hear(scan)
        self._amcl.feed.hear(scan, now)
        for placed in self._amcl.feed.placed(now):
            step = self._amcl.step(placed)
            if step.outcome.estimate is not None and step.map_from_odom is not None:
                self._map_from_odom = step.map_from_odom
            self._guard.see(placed.scan, placed.base_from_laser, now, placed.odom_from_base)

    def _note(self, command: Command) -> None:
        drive = self.drive
        if command.outcome is not None:
            drive.outcome = command.outcome
        if command.recovery is not None:
            drive.recoveries.append(command.recovery[2])
        if command.text not in drive.reasons[-1:]:
            drive.reasons.append(command.text)
        if command.plan is not None and not drive.planned:
            drive.planned = float(np.hypot(*np.diff(command.plan[:, :2], axis=0).T).sum())
        if command.twist is not None and command.reason is Reason.WAITING:
            drive.waited += self._every * STEP

    @property
    def plan(self) -> Array:
        """Plan being followed, in the local costmap's frame."""
        return self.stack.controller.visible_plan
