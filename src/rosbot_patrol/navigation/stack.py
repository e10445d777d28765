"""Navigation stack of move_base without ROS: costmaps, planners, recoveries, people and navigator, wired.

move_base, its replay over a bag and the closed loop all run it.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rosbot_patrol.costmap.fed import FedCostmap
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.errors import ParamError, TransformError
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D
from rosbot_patrol.navigation.interfaces import Command, NavigatorView, PlanSource, Reason, State
from rosbot_patrol.navigation.navigator import Navigator
from rosbot_patrol.navigation.params import MoveBaseParams
from rosbot_patrol.navigation.people import People
from rosbot_patrol.params import load
from rosbot_patrol.planning.interfaces import Array, LocalView, Recovery, RecoveryView
from rosbot_patrol.planning.registry import make_global_planner, make_local_planner, make_recoveries, short_name
from rosbot_patrol.tf.frames import Frames

_OLD_SENSORS = "Sensor data is out of date, we're not going to allow commanding of the base for safety"  # upstream's


@dataclass(frozen=True)
class Cycle:
    """Result of one control cycle.

    Attributes:
        command: of the navigator.
        reason: reason for the robot's behaviour; a fault of the inputs takes precedence over the navigator's reason.
        text: the same in a sentence.
        pose: of the robot in the global costmap's frame, None if unknown.
    """

    command: Command
    reason: Reason
    text: str
    pose: Pose2D | None


class NavigationStack:
    """Costmaps, planners, recovery behaviours and the navigator of a move_base. Times [s] are of one clock.

    Args:
        tree: move_base's private namespace.
        frames: transforms.
        make_plans: makes the navigator's source of plans; called once, with this stack, when it has its planner.
        name: of the parameters in messages.
        now: time at the start.
        zones: file of the owner's keep-out zones, which may be missing and may change; None: none.

    Raises:
        ParamError: a parameter is invalid.
        MapError: the mask file of a keep-out layer cannot be used.

    Attributes:
        params: of move_base itself.
        global_costmap, local_costmap: fed and updated from outside.
        planner, controller: the global and the local planner.
        people: people around the robot; fed from outside.
        navigator: the state machine.
        departed: function that names a required program that has gone, "" for none.
    """

    def __init__(
        self,
        tree: Mapping[str, Any],
        frames: Frames,
        make_plans: Callable[[NavigationStack], PlanSource],
        *,
        name: str = "~",
        now: float = 0.0,
        zones: Path | None = None,
    ) -> None:
        groups = [key for key, value in tree.items() if isinstance(value, dict)]
        p = self.params = load(MoveBaseParams, tree, name=name, ignore=[*groups, "recovery_behaviors"])
        self._tree, self._name, self._frames, self._zones = tree, name, frames, zones
        self.global_costmap = self._make_costmap("global_costmap", now)
        self.local_costmap = self._make_costmap("local_costmap", now, keeps_last=True)
        self.planner = make_global_planner(p.base_global_planner, tree, name=name)
        self._planner_lock = threading.Lock()
        self.controller = make_local_planner(
            p.base_local_planner,
            tree,
            self.local_costmap.costmap,
            controller_frequency=p.controller_frequency,
            name=name,
        )
        self.navigator = Navigator(
            p, plans=make_plans(self), controller=self.controller, recoveries=self._make_recoveries(p)
        )
        self.people = People(frames, self.local_costmap.frame, p.movers, p.give_way)
        self.departed: Callable[[], str] = str
        self._velocity: tuple[Twist2D, float] | None = None

    def _make_costmap(self, key: str, now: float, *, keeps_last: bool = False) -> FedCostmap:
        config = read_costmap(self._group(key), name=f"{self._name}{key}/")
        return FedCostmap(config, self._frames, key, now=now, keeps_last=keeps_last, zones=self._zones)

    def _make_recoveries(self, p: MoveBaseParams) -> list[Recovery]:
        return make_recoveries(
            self._tree,
            conservative=p.conservative_reset_dist,
            clearing_radius=p.aggressive_radius,
            clearing_rotation=p.clearing_rotation_allowed,
            name=self._name,
            planner=self.controller,
        )

    def _group(self, key: str) -> dict[str, Any]:
        group = self._tree.get(key, {})
        if not isinstance(group, Mapping):
            raise ParamError(f"{self._name}{key}", f"expected a group of parameters, got {group!r}")
        return dict(group)

    # Parameters

    @property
    def costmaps(self) -> tuple[FedCostmap, FedCostmap]:
        """The global and the local costmap."""
        return self.global_costmap, self.local_costmap

    @property
    def scan_topic(self) -> str:
        """Topic of the local costmap's first scans, used to track people; "" if it uses none."""
        scans = self.local_costmap.scan_inputs
        return scans[0].topic if scans else ""

    def configure(self, params: MoveBaseParams) -> None:
        """Use other parameters from the next step on."""
        self.params = params
        self.navigator.configure(params, self._make_recoveries(params))
        if "controller_frequency" not in self._group(short_name(params.base_local_planner)):
            own = replace(self.controller.params, controller_frequency=params.controller_frequency)
            self.controller.set_params(own)

    def fit_controller(self) -> None:
        """Tell the local planner that its costmap's footprint or resolution has changed."""
        costmap = self.local_costmap.costmap
        self.controller.fit(costmap.footprint, resolution=costmap.info.resolution)

    # Inputs

    def hear_velocity(self, twist: Twist2D, now: float) -> None:
        """Store the robot's velocity, received at a time [s]."""
        self._velocity = twist, now

    def plan(self, start: Pose2D, goal: Pose2D, *, tolerance: float | None = None) -> Array:
        """Plan over a copy of the global costmap; raises PlanningError."""
        with self._planner_lock:
            return self.planner.plan(self.global_costmap.copy(), start, goal, tolerance=tolerance)

    def plan_from_robot(self, goal: Pose2D, now: float) -> Array:
        """Plan from the robot's pose; raises PlanningError, or TransformError if the pose is unknown."""
        return self.plan(self.global_costmap.robot_pose(now), goal)

    # Steps

    def step(self, now: float) -> Cycle:
        """Run one control cycle."""
        self.people.look(now)
        view, reason, text = self.view(now)
        if self.navigator.state is State.CLEARING:
            with self.global_costmap.lock, self.local_costmap.lock:
                command = self.navigator.step(now, view)
        else:
            command = self.navigator.step(now, view)
        pose = None if view is None else view.recovery.pose_global
        return Cycle(command, reason or command.reason, text or command.text, pose)

    def view(self, now: float) -> tuple[NavigatorView | None, Reason | None, str]:
        """Input of the navigator, None if it must not drive; and the fault and its sentence, if there is one."""
        gone = self.departed()
        if gone:
            return None, Reason.DEPARTED, gone
        try:
            pose_global, pose_local = (costmap.robot_pose(now) for costmap in self.costmaps)
            local_from_plan = self._local_from_plan()
        except TransformError as err:
            return None, Reason.POSE_UNKNOWN, str(err)
        reason, text = self._input_fault(now)
        view = NavigatorView(
            local=LocalView(
                now=now,
                pose=pose_local,
                velocity=STOP if self._velocity is None else self._velocity[0],
                costmap=self.local_costmap.last,
                local_from_plan=local_from_plan,
            ),
            recovery=RecoveryView(
                now=now,
                pose_global=pose_global,
                pose_local=pose_local,
                global_costmap=self.global_costmap.costmap,
                local_costmap=self.local_costmap.costmap,
            ),
            is_current=reason is None,
            must_wait=lambda wish: self.people.waits(wish, pose_local, now),
        )
        return view, reason, text

    def _local_from_plan(self) -> Pose2D:
        frames = self.local_costmap.frame, self.global_costmap.frame
        return Pose2D() if frames[0] == frames[1] else self._frames.lookup(*frames)

    def _input_fault(self, now: float) -> tuple[Reason | None, str]:
        """The input that is too old to drive by."""
        timeout = self.params.odom_timeout
        heard = -math.inf if self._velocity is None else self._velocity[1]
        no_odometry = ""
        if timeout > 0.0 and not abs(now - heard) <= timeout:
            no_odometry = f"no odometry on {self.params.odom_topic} for {timeout} s"
        if not self.local_costmap.is_current(now):
            return Reason.SENSORS_OLD, ": ".join([_OLD_SENSORS, *self.local_costmap.troubles(now)])
        return (Reason.NO_ODOMETRY, no_odometry) if no_odometry else (None, "")
