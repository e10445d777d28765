"""A closed loop in plain Python: navigator, costmaps and planners of a configuration against a unicycle."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from house import cast, scan_of

from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.obstacle import observe
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.errors import PlanningError
from rosbot_patrol.geometry import Pose2D, Twist2D, wrap_angle
from rosbot_patrol.grid import Grid
from rosbot_patrol.navigation.interfaces import NavigatorView, Outcome, PlanResult
from rosbot_patrol.navigation.navigator import Navigator
from rosbot_patrol.navigation.params import MoveBaseParams
from rosbot_patrol.params import load
from rosbot_patrol.planning.interfaces import LocalView, RecoveryView
from rosbot_patrol.planning.registry import make_global_planner, make_local_planner, make_recoveries

CONFIG = Path(__file__).resolve().parents[3] / "config" / "tuned"


def tuned() -> dict[str, Any]:
    """The tuned profile as move_base's private namespace."""

    def read(name: str) -> dict[str, Any]:
        return yaml.safe_load((CONFIG / name).read_text())

    tree = {**read("move_base.yaml"), **read("trajectory_planner.yaml")}
    common = read("costmap_common_params.yaml")
    for which in ("global_costmap", "local_costmap"):
        tree[which] = {**common, **read(f"{which}_params.yaml")[which]}
    return tree


class ImmediatePlans:
    """A PlanSource that plans when asked."""

    def __init__(self, loop: Loop, planner: Any) -> None:
        self._loop, self._planner = loop, planner
        self._result: PlanResult | None = None
        self.count = 0

    def request(self, goal: Pose2D) -> None:
        self.count += 1
        costmap = self._loop.global_costmap
        try:
            poses = self._planner.plan(Grid(costmap.info, costmap.cells.copy()), self._loop.pose, goal)
            self._result = PlanResult(poses=poses)
        except PlanningError as err:
            self._result = PlanResult(error=err)

    def poll(self) -> PlanResult | None:
        result, self._result = self._result, None
        return result

    @property
    def is_busy(self) -> bool:
        return False

    def drop(self) -> None:
        self._result = None


@dataclass
class Loop:
    """The world, the robot in it, and the navigator that drives it."""

    known: Grid
    world: Grid
    tree: dict[str, Any]
    pose: Pose2D = Pose2D()
    velocity: Twist2D = Twist2D()
    now: float = 0.0
    dt: float = 0.1
    contacts: int = 0
    recoveries: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.global_costmap = LayeredCostmap(read_costmap(self.tree["global_costmap"], name="~global_costmap/"))
        self.local_costmap = LayeredCostmap(read_costmap(self.tree["local_costmap"], name="~local_costmap/"))
        for layer in self.global_costmap.static_layers:
            layer.set_map(self.known)
        own = {k: v for k, v in self.tree.items() if not isinstance(v, dict)}
        self.params = load(MoveBaseParams, own)
        self.controller = make_local_planner(
            self.params.base_local_planner,
            self.tree,
            self.local_costmap,
            controller_frequency=self.params.controller_frequency,
        )
        self.plans = ImmediatePlans(self, make_global_planner(self.params.base_global_planner, self.tree))
        self.navigator = Navigator(
            self.params,
            plans=self.plans,
            controller=self.controller,
            recoveries=make_recoveries(self.tree, conservative=3.0, clearing_radius=0.2, clearing_rotation=True),
        )
        self._cycle = 0

    def sense(self) -> None:
        ranges = cast(self.world, self.pose.x, self.pose.y, self.pose.yaw)
        seen = observe(scan_of(ranges, self.now), self.pose, inf_is_valid=True)
        costmaps = [self.local_costmap] + ([self.global_costmap] if self._cycle % 5 == 0 else [])
        for costmap in costmaps:
            for layer in costmap.obstacle_layers:
                for buffer in layer.buffers.values():
                    buffer.add(seen)
            costmap.update(self.now, self.pose)

    def view(self) -> NavigatorView:
        local = self.local_costmap
        return NavigatorView(
            local=LocalView(
                now=self.now,
                pose=self.pose,
                velocity=self.velocity,
                costmap=Grid(local.info, local.cells.copy()),
            ),
            recovery=RecoveryView(
                now=self.now,
                pose_global=self.pose,
                pose_local=self.pose,
                global_costmap=self.global_costmap,
                local_costmap=local,
            ),
        )

    def move(self, twist: Twist2D) -> None:
        """A base with wheels at 0.4 m/s at most, that follows within its accelerations."""
        half = 0.1
        left, right = (max(-0.4, min(0.4, twist.vx + s * half * twist.wz)) for s in (-1.0, 1.0))
        vx, wz = (left + right) / 2.0, (right - left) / (2.0 * half)
        limit = 1.5 * self.dt
        vx = self.velocity.vx + max(-limit, min(limit, vx - self.velocity.vx))
        wz = self.velocity.wz + max(-4 * limit, min(4 * limit, wz - self.velocity.wz))
        middle = self.pose.yaw + wz * self.dt / 2.0
        self.pose = Pose2D(
            self.pose.x + vx * math.cos(middle) * self.dt,
            self.pose.y + vx * math.sin(middle) * self.dt,
            wrap_angle(self.pose.yaw + wz * self.dt),
        )
        self.velocity = Twist2D(vx, 0.0, wz)
        self.now += self.dt
        if self.touches():
            self.contacts += 1

    def touches(self) -> bool:
        corners = np.array([[0.12, 0.14], [0.12, -0.14], [-0.12, -0.14], [-0.12, 0.14]])
        t = np.linspace(0.0, 1.0, 9)[:, None, None]
        edge = ((1 - t) * corners + t * np.roll(corners, -1, axis=0)).reshape(-1, 2)
        c, s = math.cos(self.pose.yaw), math.sin(self.pose.yaw)
        points = edge @ np.array([[c, s], [-s, c]]) + (self.pose.x, self.pose.y)
        info = self.world.info
        cells = np.floor((points - (info.origin_x, info.origin_y)) / info.resolution).astype(int)
        return bool((self.world.cells[cells[:, 1], cells[:, 0]] == 100).any())

    def step(self) -> Outcome | None:
        self.sense()
        command = self.navigator.step(self.now, self.view())
        if command.recovery:
            self.recoveries.append(command.recovery[2])
        self.move(command.twist or Twist2D())
        self._cycle += 1
        return command.outcome

    def drive(self, goal: Pose2D, timeout: float) -> Outcome | None:
        """To a goal; None where it takes too long."""
        self.sense()
        self.navigator.set_goal(goal, self.now)
        end = self.now + timeout
        while self.now < end:
            outcome = self.step()
            if outcome is not None:
                return outcome
        return None
