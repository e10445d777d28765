"""move_base over a bag: its node's stack, stepped at the controller's rate on the bag's clock.

The robot's motion is the bag's. So a replay shows the commands of this move_base along that motion; they are close to
the bag's commands if both behave alike. Plans are made at once and delivered 0.2 s later.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np

from rosbot_patrol.closed_loop.delayed_plans import DelayedPlans
from rosbot_patrol.costmap.fed import FedCostmap
from rosbot_patrol.costmap.inputs import CloudInput, DepthInput, RangeInput
from rosbot_patrol.costmap.layers.keepout import KeepoutLayer
from rosbot_patrol.costmap.records import CloudRecord, DepthRecord, OpticsRecord, RangeRecord
from rosbot_patrol.errors import MapError, TransformError
from rosbot_patrol.grid import Grid
from rosbot_patrol.navigation.interfaces import Command, PlanSource, State
from rosbot_patrol.navigation.stack import NavigationStack
from rosbot_patrol.replay.bags.records import MapRecord
from rosbot_patrol.replay.nodes import move_base_records as heard
from rosbot_patrol.replay.results.comparison import Field
from rosbot_patrol.replay.results.tables import STAMP, Result, Rows
from rosbot_patrol.replay.runner import TF_TYPES, Input
from rosbot_patrol.scan import LaserScan, scan_problem
from rosbot_patrol.tf.tree import Edge, TransformTree

PLAN_S = 0.2  # time from a request to its plan

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
    "commands.reason": Field(tolerance=math.inf),  # contains figures; shown where velocities differ
}


class MoveBaseReplay:
    """A NavigationStack on the bag's clock.

    Args:
        tree: move_base's private namespace.
        name: prefix of the parameters in messages.
        grid: the map, None for the bag's.
        static: transforms that the bag lacks.

    Raises:
        ParamError: a parameter is invalid.
        MapError: the map cannot be used.
    """

    kinds = heard.KINDS

    def __init__(
        self, tree: Mapping[str, Any], name: str, *, grid: Grid | None = None, static: Iterable[Edge] = ()
    ) -> None:
        self._now = 0.0
        self._tree = TransformTree()
        self._tree.add_all(static, is_static=True)
        self._stack = NavigationStack(tree, self._tree, self._make_plans, name=name)
        self._navigator = self._stack.navigator
        self._updates = [_Updates(costmap) for costmap in reversed(self._stack.costmaps)]
        self._sensors, self._cameras = _topics_of(self._stack)
        self._has_own_map = grid is not None
        if grid is not None:
            self._take_map(grid, self._stack.global_costmap.frame)
        self._goal = ""
        self._next: float | None = None
        self._state = State.IDLE
        self._counts = dict.fromkeys(("goals", "refused", "cancelled", "cycles"), 0)
        self._commands = Rows(STAMP, "vx", "vy", "wz", "reason")
        self._new_plans = Rows(STAMP, "length", "poses")
        self._outcomes = Rows(STAMP, "succeeded", "text")
        self._recoveries = Rows(STAMP, "name")
        self._states = Rows(STAMP, "state")

    def _make_plans(self, stack: NavigationStack) -> PlanSource:
        return DelayedPlans(lambda goal: stack.plan_from_robot(goal, self._now), lambda: self._now, PLAN_S)

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Inputs of the node: scans and the other sensors of the costmaps."""
        return (
            *INPUTS,
            *(
                Input(name=name, types=(_TYPES[type(heard_by[0])],), is_needed=False)
                for name, heard_by in self._sensors.items()
            ),
            *(Input(name=name, types=("sensor_msgs/CameraInfo",), is_needed=False) for name in self._cameras),
        )

    def begin(self, names: Collection[str]) -> None:
        """Ignore the list of inputs: the core asks for what it needs."""

    def hear(self, name: str, now: float, content: Any) -> None:
        """Process a record of the named input, recorded at a time [s]."""
        self._step_until(now)
        match content:
            case LaserScan():
                self._hear_scan(content, now)
            case heard.VelocityRecord():
                self._stack.hear_velocity(content.twist, now)
            case heard.GoalPoseRecord():
                self._hear_goal(content, now)
            case heard.CancelRecord():
                self._hear_cancel(content, now)
            case MapRecord():
                self._hear_map(content)
            case list():
                self._tree.add_all(content, is_static=name == "tf_static")
            case OpticsRecord():
                for camera in self._cameras[name]:
                    camera.hear_optics(content)
            case CloudRecord() | DepthRecord() | RangeRecord():
                for each in self._sensors[name]:
                    each.hear(content, now)
            case _:
                self._counts["refused"] += 1

    def finish(self) -> Result:
        """Commands of each cycle, plans, results of the goals."""
        rows = {
            "commands": self._commands,
            "plans": self._new_plans,
            "outcomes": self._outcomes,
            "recoveries": self._recoveries,
            "states": self._states,
        }
        tables = {name: each.table() for name, each in rows.items()}
        return Result("move_base", counts=self._counts, tables=tables)

    # -- inputs

    def _hear_scan(self, scan: LaserScan, now: float) -> None:
        self._counts["refused"] += bool(scan_problem(scan))
        for costmap in self._stack.costmaps:
            for each in costmap.scan_inputs:
                each.hear(scan, now)
        self._stack.people.hear(scan)

    def _hear_map(self, record: MapRecord) -> None:
        if self._has_own_map:
            return
        try:
            self._take_map(record.grid, record.frame)
        except MapError:
            self._counts["refused"] += 1

    def _take_map(self, grid: Grid, frame: str) -> None:
        for costmap in self._stack.costmaps:
            for layer in costmap.map_layers:
                if not isinstance(layer, KeepoutLayer):
                    costmap.hear_map(layer, grid, frame)

    def _hear_goal(self, record: heard.GoalPoseRecord, now: float) -> None:
        try:
            pose = record.pose
            frame = self._stack.global_costmap.frame
            if record.frame != frame:
                pose = self._tree.lookup(frame, record.frame) @ pose
        except TransformError:
            self._counts["refused"] += 1
            return
        self._counts["goals"] += 1
        self._goal, self._now = record.goal, now
        self._navigator.set_goal(pose, now)
        self._step(now)  # the node is woken, too

    def _hear_cancel(self, record: heard.CancelRecord, now: float) -> None:
        if self._navigator.state is State.IDLE or record.goal not in ("", self._goal):
            return
        self._counts["cancelled"] += 1
        self._note(now, self._navigator.cancel())

    # -- steps

    def _step_until(self, now: float) -> None:
        period = 1.0 / self._stack.params.controller_frequency
        due = now if self._next is None else self._next
        while due <= now:
            for each in self._updates:
                each.run(due)
            self._step(due)
            due += period
        self._next = due

    def _step(self, now: float) -> None:
        self._now = now
        if self._navigator.state is State.IDLE:
            return
        self._counts["cycles"] += 1
        self._note(now, self._stack.step(now).command)

    def _note(self, now: float, command: Command) -> None:
        if command.twist is not None:
            self._commands.add(now, *command.twist, command.text)
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


_TYPES: dict[type, str] = {
    CloudInput: "sensor_msgs/PointCloud2",
    DepthInput: "sensor_msgs/Image",
    RangeInput: "sensor_msgs/Range",
}


def _topics_of(stack: NavigationStack) -> tuple[dict[str, list[Any]], dict[str, list[DepthInput]]]:
    """The costmaps' inputs by topic, without scans, and the cameras by their camera_info topics."""
    sensors: dict[str, list[Any]] = {}
    cameras: dict[str, list[DepthInput]] = {}
    for each in [each for costmap in stack.costmaps for each in costmap.inputs]:
        if type(each) in _TYPES:
            sensors.setdefault(each.topic.lstrip("/"), []).append(each)
        if isinstance(each, DepthInput):
            cameras.setdefault(each.optics_topic.lstrip("/"), []).append(each)
    return sensors, cameras


class _Updates:
    """Updates of a costmap at its parameters' rate, as in its node's loop."""

    def __init__(self, costmap: FedCostmap) -> None:
        self._costmap = costmap
        self._next = 0.0

    def run(self, now: float) -> None:
        """Update if it is due."""
        frequency = self._costmap.params.update_frequency
        if frequency > 0.0 and now >= self._next - 1e-6:
            self._next = now + 1.0 / frequency
            self._costmap.update(now)
