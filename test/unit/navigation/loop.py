"""move_base's stack against a unicycle with a lidar: a closed loop without the simulator."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from house import cast, scan_of

from rosbot_patrol.closed_loop.delayed_plans import DelayedPlans
from rosbot_patrol.closed_loop.frames import BASE, MAP, ODOM, add_pose
from rosbot_patrol.geometry import Pose2D, Twist2D, wrap_angle
from rosbot_patrol.grid import Grid
from rosbot_patrol.navigation.interfaces import Outcome
from rosbot_patrol.navigation.stack import NavigationStack
from rosbot_patrol.package_files import read_move_base
from rosbot_patrol.tf.tree import TransformTree

CONFIG = Path(__file__).resolve().parents[3] / "config" / "tuned"


def tuned() -> dict[str, Any]:
    """The tuned profile as move_base's private namespace."""
    return dict(read_move_base(CONFIG))


@dataclass
class Loop:
    """The world, the robot in it, and the stack that drives it."""

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
        self._frames = TransformTree()
        self.stack = NavigationStack(self.tree, self._frames, self._plans)
        costmap = self.stack.global_costmap
        for layer in costmap.map_layers:
            costmap.hear_map(layer, self.known, MAP)
        self._cycle = 0

    def _plans(self, stack: NavigationStack) -> DelayedPlans:
        return DelayedPlans(lambda goal: stack.plan_from_robot(goal, self.now), lambda: self.now, 0.0)

    def sense(self, ranges: np.ndarray | None = None) -> None:
        """Look around; `ranges` instead of what the lidar would measure."""
        add_pose(self._frames, ODOM, BASE, self.pose, self.now)
        add_pose(self._frames, MAP, ODOM, Pose2D(), self.now)
        if ranges is None:
            ranges = cast(self.world, self.pose.x, self.pose.y, self.pose.yaw)
        scan = scan_of(ranges, self.now, BASE)
        self.stack.hear_velocity(self.velocity, self.now)
        self.stack.people.hear(scan)
        for costmap, every in zip(self.stack.costmaps, (5, 1), strict=True):
            for each in costmap.scan_inputs:
                each.hear(scan, self.now)
            if self._cycle % every == 0:
                costmap.update(self.now)

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
        command = self.stack.step(self.now).command
        if command.recovery:
            self.recoveries.append(command.recovery[2])
        self.move(command.twist or Twist2D())
        self._cycle += 1
        return command.outcome

    def drive(self, goal: Pose2D, timeout: float) -> Outcome | None:
        """To a goal; None where it takes too long."""
        self.sense()
        self.stack.navigator.set_goal(goal, self.now)
        end = self.now + timeout
        while self.now < end:
            outcome = self.step()
            if outcome is not None:
                return outcome
        return None
