"""move_base over a bag: its navigator, costmaps and planners, stepped at the controller's rate on the bag's clock.

The robot goes where the bag's went. So a replay shows what this move_base would command there: near the commands of the
bag where it drives as that one did. Plans are made at once and come 0.2 s later; depth pictures and range sensors are
not replayed.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np

from rosbot_patrol.closed_loop.delayed_plans import DelayedPlans
from rosbot_patrol.control.give_way import GiveWay
from rosbot_patrol.control.movers import MoverWatch
from rosbot_patrol.errors import MapError, TransformError
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D
from rosbot_patrol.grid import Grid
from rosbot_patrol.navigation.interfaces import Command, NavigatorView, State
from rosbot_patrol.navigation.navigator import Navigator
from rosbot_patrol.navigation.params import MoveBaseParams
from rosbot_patrol.params import load
from rosbot_patrol.planning.interfaces import Array, LocalView, RecoveryView
from rosbot_patrol.planning.registry import make_global_planner, make_local_planner, make_recoveries
from rosbot_patrol.replay.bags.records import MapRecord
from rosbot_patrol.replay.nodes import move_base_records as heard
from rosbot_patrol.replay.nodes.bag_costmap import BagCostmap
from rosbot_patrol.replay.results.comparison import Field
from rosbot_patrol.replay.results.tables import STAMP, Result, Rows
from rosbot_patrol.replay.runner import TF_TYPES, Input
from rosbot_patrol.scan import LaserScan, level_scan, scan_problem
from rosbot_patrol.tf.tree import Edge, TransformTree

PLAN_S = 0.2  # from a request to its plan
LATEST_S = 1.0  # a scan older than that tells of nobody

INPUTS = (
    Input(name="move_base/goal", types=("move_base_msgs/MoveBaseActionGoal",)),
    Input(name="scan", types=("sensor_msgs/LaserScan",)),
    Input(name="odom", types=("nav_msgs/Odometry",)),
    Input(name="tf", types=TF_TYPES),
    Input(name="tf_static", types=TF_TYPES, is_needed=False),
    Input(name="move_base/cancel", types=("actionlib_msgs/GoalID",), is_needed=False),
    Input(name="map", types=("nav_msgs/OccupancyGrid",), is_needed=False),
)
FIELDS = {
    "commands.vx": Field(tolerance=0.1, unit="m/s"),
    "commands.vy": Field(tolerance=0.1, unit="m/s"),
    "commands.wz": Field(tolerance=0.3, unit="rad/s"),
    **{f"{table}.rows": Field(is_by_order=True) for table in ("plans", "outcomes", "recoveries", "states")},
    **{f"{table}.{STAMP}": Field(tolerance=0.5, unit="s") for table in ("plans", "outcomes", "recoveries", "states")},
    "plans.length": Field(tolerance=0.2, unit="m"),
    "commands.reason": Field(tolerance=math.inf),  # holds figures; shown where velocities differ
}


class MoveBaseReplay:
    """A Navigator and what its node does around it.

    Args:
        tree: move_base's private namespace.
        name: of the parameters in messages.
        grid: the map, None for the bag's.
        static: transforms that the bag lacks.

    Raises:
        ParamError: a parameter makes no sense.
        MapError: the map cannot be used.
    """

    inputs = INPUTS
    kinds = heard.KINDS

    def __init__(
        self, tree: Mapping[str, Any], name: str, *, grid: Grid | None = None, static: Iterable[Edge] = ()
    ) -> None:
        own = {key: value for key, value in tree.items() if not isinstance(value, dict)}
        p = self._params = load(MoveBaseParams, own, name=name, ignore=["recovery_behaviors"])
        self._tree = TransformTree()
        for edge in static:
            self._tree.add(edge, is_static=True)
        self._global = BagCostmap(tree.get("global_costmap", {}), "global_costmap", self._tree)
        self._local = BagCostmap(tree.get("local_costmap", {}), "local_costmap", self._tree)
        self._has_own_map = grid is not None
        if grid is not None:
            self._take_map(grid)
        self._now = 0.0
        self._planner = make_global_planner(p.base_global_planner, dict(tree))
        self._plans = DelayedPlans(self._plan, lambda: self._now, PLAN_S)
        controller = make_local_planner(
            p.base_local_planner, dict(tree), self._local.costmap, controller_frequency=p.controller_frequency
        )
        recoveries = make_recoveries(
            dict(tree),
            conservative=p.conservative_reset_dist,
            clearing_radius=p.aggressive_radius,
            clearing_rotation=p.clearing_rotation_allowed,
            planner=controller,
        )
        self._navigator = Navigator(p, plans=self._plans, controller=controller, recoveries=recoveries)
        self._watch, self._give_way = MoverWatch(p.movers), GiveWay(p.give_way)
        self._unseen: LaserScan | None = None  # scan that the watch has not taken yet
        self._velocity: tuple[Twist2D, float] = STOP, -math.inf
        self._goal = ""
        self._next: float | None = None
        self._state = State.IDLE
        self._counts = dict.fromkeys(("goals", "refused", "cancelled", "cycles"), 0)
        self._commands = Rows(STAMP, "vx", "vy", "wz", "reason")
        self._new_plans = Rows(STAMP, "length", "poses")
        self._outcomes = Rows(STAMP, "succeeded", "text")
        self._recoveries = Rows(STAMP, "name")
        self._states = Rows(STAMP, "state")

    def begin(self, names: Collection[str]) -> None:
        """Which of the inputs will be heard: it asks for what it needs itself."""

    def hear(self, name: str, now: float, content: Any) -> None:
        """Take in a record of the input of that name, recorded at a time [s]."""
        self._step_until(now)
        match content:
            case LaserScan():
                self._hear_scan(content, now)
            case heard.VelocityRecord():
                self._velocity = content.twist, now
            case heard.GoalPoseRecord():
                self._hear_goal(content, now)
            case heard.CancelRecord():
                self._hear_cancel(content, now)
            case MapRecord():
                self._hear_map(content)
            case list():
                for edge in content:
                    self._tree.add(edge, is_static=name == "tf_static")
            case _:
                self._counts["refused"] += 1

    def finish(self) -> Result:
        """Commands of each cycle, plans, how the goals ended."""
        rows = {
            "commands": self._commands,
            "plans": self._new_plans,
            "outcomes": self._outcomes,
            "recoveries": self._recoveries,
            "states": self._states,
        }
        tables = {name: each.table() for name, each in rows.items()}
        return Result("move_base", counts=self._counts, tables=tables)

    # -- what it hears

    def _hear_scan(self, scan: LaserScan, now: float) -> None:
        self._global.hear_scan(scan, now)
        self._local.hear_scan(scan, now)
        if scan_problem(scan):
            self._counts["refused"] += 1
            return
        self._unseen = scan

    def _hear_map(self, record: MapRecord) -> None:
        if self._has_own_map:
            return
        try:
            self._take_map(record.grid)
        except MapError:
            self._counts["refused"] += 1

    def _take_map(self, grid: Grid) -> None:
        self._global.hear_map(grid)
        self._local.hear_map(grid)

    def _hear_goal(self, record: heard.GoalPoseRecord, now: float) -> None:
        try:
            pose = record.pose
            if record.frame != self._global.frame:
                pose = self._tree.lookup(self._global.frame, record.frame) @ pose
        except TransformError:
            self._counts["refused"] += 1
            return
        self._counts["goals"] += 1
        self._goal, self._now = record.goal, now
        self._navigator.set_goal(pose, now)
        self._step(now)  # the node is waked, too

    def _hear_cancel(self, record: heard.CancelRecord, now: float) -> None:
        if self._navigator.state is State.IDLE or record.goal not in ("", self._goal):
            return
        self._counts["cancelled"] += 1
        self._note(now, self._navigator.cancel())

    # -- steps

    def _step_until(self, now: float) -> None:
        period = 1.0 / self._params.controller_frequency
        due = now if self._next is None else self._next
        while due <= now:
            self._local.update_when_due(due)
            self._global.update_when_due(due)
            self._step(due)
            due += period
        self._next = due

    def _step(self, now: float) -> None:
        self._look()
        self._now = now
        if self._navigator.state is State.IDLE:
            return
        self._counts["cycles"] += 1
        self._note(now, self._navigator.step(now, self._view(now)))

    def _plan(self, goal: Pose2D) -> Array:
        return self._planner.plan(self._global.last, self._global.robot_pose(self._now), goal)

    def _look(self) -> None:
        """Show the newest scan to the watch for people, once its place is known."""
        if self._unseen is None:
            return
        frame, scan = self._local.frame, self._unseen
        try:
            level = level_scan(scan, self._tree.transform(frame, scan.frame_id, scan.stamp), frame)
        except TransformError:
            return
        self._watch.see(level.scan, level.pose)
        self._unseen = None

    def _view(self, now: float) -> NavigatorView | None:
        """What the navigator sees, None where the robot's pose is not known."""
        try:
            pose_global, pose_local = self._global.robot_pose(now), self._local.robot_pose(now)
            local_from_plan = self._tree.lookup(self._local.frame, self._global.frame)
        except TransformError:
            return None
        twist, heard_at = self._velocity
        is_known = self._params.odom_timeout == 0.0 or now - heard_at <= self._params.odom_timeout
        return NavigatorView(
            local=LocalView(
                now=now, pose=pose_local, velocity=twist, costmap=self._local.last, local_from_plan=local_from_plan
            ),
            recovery=RecoveryView(
                now=now,
                pose_global=pose_global,
                pose_local=pose_local,
                global_costmap=self._global.costmap,
                local_costmap=self._local.costmap,
            ),
            is_current=is_known and self._local.is_current(now),
            must_wait=lambda wish: self._waits(wish, pose_local, now),
        )

    def _waits(self, wish: Twist2D, pose: Pose2D, now: float) -> str:
        movers = self._watch.movers(now) if abs(now - self._watch.stamp) <= LATEST_S else []
        return self._give_way.waits(wish, movers, pose, now)

    def _note(self, now: float, command: Command) -> None:
        if command.twist is not None:
            self._commands.add(now, *command.twist, command.reason)
        if command.plan is not None:
            length = float(np.hypot(*np.diff(command.plan[:, :2], axis=0).T).sum()) if len(command.plan) else 0.0
            self._new_plans.add(now, length, len(command.plan))
        if command.recovery is not None:
            self._recoveries.add(now, command.recovery[2])
        if command.outcome is not None:
            self._outcomes.add(now, command.outcome.succeeded, command.outcome.text)
        if self._navigator.state is not self._state:
            self._state = self._navigator.state
            self._states.add(now, self._state.name.lower())
