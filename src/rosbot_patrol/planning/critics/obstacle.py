"""Critic: does the trajectory hit something, and how close does it come?"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import INSCRIBED, LETHAL, UNKNOWN
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D
from rosbot_patrol.grid import Grid
from rosbot_patrol.planning.critics import sweep_kernels as kernels
from rosbot_patrol.planning.critics.situation import Array

_SPACING = 0.25  # spacing of the outline's points [cells]: a cell's corner hardly fits between two
SUDDEN = (1e6, 1e6, 1e6)  # accelerations of a base that reaches a velocity at once


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Simulation of velocities: duration, steps, accelerations.

    Attributes:
        horizon: duration [s].
        accelerations: of vx, vy [m/s^2] and wz [rad/s^2].
        granularity: longest step [m]; angular_granularity: the same for turning [rad].
        scored_at: time at which the trajectory is scored [s]; None: at its end.
        stop_time_buffer: time reserve for braking before an obstacle [s].
        growing: speed above which the footprint grows [m/s], its largest growth, and the speed of that growth.
        is_held: the base has the velocity at once, as in a dynamic window; accelerations count for braking only.
    """

    horizon: float
    accelerations: tuple[float, float, float]
    granularity: float = 0.025
    angular_granularity: float = 0.025
    scored_at: float | None = None
    stop_time_buffer: float = 0.0
    growing: tuple[float, float, float] = (math.inf, 0.0, 0.0)
    is_held: bool = False

    def reach(self, samples: Array, velocity: Twist2D) -> float:
        """Longest distance that any of some velocities can lead, including braking [m]."""
        if not len(samples):
            return 0.0
        speeds = np.abs(samples).max(axis=0)
        braking = max(v / (2.0 * a) if a > 1e-3 else 0.0 for v, a in zip(speeds, self.accelerations, strict=True))
        speed = max(float(np.hypot(samples[:, 0], samples[:, 1]).max()), math.hypot(velocity.vx, velocity.vy))
        return speed * 1.05 * max(self.horizon, braking + self.stop_time_buffer)

    def packed(self, reach: float, spacing: float) -> Array:
        """The values as `sweep_kernels.drive` expects them."""
        scored_at = self.horizon if self.scored_at is None else min(self.scored_at, self.horizon)
        steps = self.granularity, self.angular_granularity
        own = (self.horizon, scored_at, *steps, *self.accelerations, self.stop_time_buffer)
        return np.array([*own, reach, spacing, *self.growing, float(self.is_held)])


@dataclass(frozen=True)
class Surroundings:
    """Obstacles around a pose: made once a cycle by `ObstacleCritic.survey`."""

    pose: Pose2D
    costmap: Grid
    near: NDArray[np.float32] = field(repr=False)
    corner: tuple[int, int]
    touching: int
    taken_from: int
    outline: Array = field(repr=False)


class ObstacleCritic:
    """Highest cost along a trajectory; inf if the footprint hits something, unknown space or the map's edge.

    The swept outline is checked cell by cell, whatever the steps of the simulation. A velocity is also refused if the
    robot could not stop before an obstacle. A robot that already touches something may only move so that it touches
    less. If only its padding touches, it can be checked without the padding.

    Args:
        footprint: the robot's padded outline.
        resolution: of the local costmap [m].
    """

    def __init__(self, footprint: Footprint, *, resolution: float) -> None:
        self._padded = footprint.outline(resolution * _SPACING)
        self._bare = Footprint(footprint.body, footprint.body).outline(resolution * _SPACING)
        self._disc = _disc(float(np.hypot(*footprint.body.T).max()), 0.5 * resolution)
        self._spacing = max(_widest_gap(self._padded), _widest_gap(self._bare))
        self._reach = footprint.circumscribed_radius

    def survey(
        self, costmap: Grid, pose: Pose2D, distance: float, *, growth: float = 0.0, bare: bool = False
    ) -> Surroundings:
        """Collect the obstacles around a pose.

        Args:
            costmap: the local costs.
            pose: of the robot.
            distance: longest distance that it may move [m].
            growth: largest relative growth of the footprint.
            bare: check the robot's own outline, without the padding.
        """
        outline = self._bare if bare else self._padded
        info, cells = costmap.info, costmap.cells
        reach = self._reach * (1.0 + growth)
        side = math.ceil((distance + reach) / info.resolution) + 3
        ix, iy = info.cell_of_clamped(pose.x, pose.y)
        x0, y0 = max(ix - side, 0), max(iy - side, 0)
        x1, y1 = min(ix + side + 1, info.width), min(iy + side + 1, info.height)
        cap = math.ceil(2.0 * reach / info.resolution) + 4
        # cells are coarse: the centre may lie in an inscribed cell although the outline is free
        here = int(costmap.at(pose.x, pose.y)) if info.contains(pose.x, pose.y) else UNKNOWN
        return Surroundings(
            pose=pose,
            costmap=costmap,
            near=kernels.clearances(cells, x0, y0, x1, y1, cap),
            corner=(x0, y0),
            touching=kernels.count_touching(cells, info.resolution, info.origin_x, info.origin_y, outline, *pose),
            taken_from=LETHAL if here == INSCRIBED or bare else INSCRIBED,
            outline=outline,
        )

    def drive(
        self,
        around: Surroundings,
        velocity: Twist2D,
        samples: Array,
        motion: Motion,
        *,
        ends: Array | None = None,
        failed: Array | None = None,
    ) -> Array:
        """Costs of velocities driven from the surveyed pose, shape (K,); inf if something is hit.

        Args:
            around: survey of that pose, wide enough for the motion.
            velocity: the robot's now.
            samples: velocities (vx, vy, wz), shape (K, 3).
            motion: how they are simulated.
            ends: filled with the final poses, shape (K, 3).
            failed: costs from an earlier check, shape (K,); samples with inf are skipped.
        """
        info = around.costmap.info
        worst = np.zeros(len(samples)) if failed is None else np.where(np.isfinite(failed), 0.0, -1.0)
        kernels.drive(
            np.array([*around.pose, *velocity], dtype=np.float64),
            samples,
            motion.packed(self._reach, self._spacing),
            around.costmap.cells,
            np.array([info.resolution, info.origin_x, info.origin_y]),
            around.near,
            *around.corner,
            around.taken_from,
            around.touching,
            around.outline,
            np.empty((len(samples), 3)) if ends is None else ends,
            worst,
        )
        return np.where(worst < 0.0, np.inf, worst)

    def is_squeezed(self, costmap: Grid, pose: Pose2D) -> bool:
        """Whether the padded outline touches something at a pose, or almost does."""
        info = costmap.info
        outline = self._padded * (1.0 + self._spacing / self._reach)
        place = (info.resolution, info.origin_x, info.origin_y)
        return bool(kernels.count_touching(costmap.cells, *place, outline, *pose) > 0)

    def has_room_to_turn(self, costmap: Grid, pose: Pose2D) -> bool:
        """Whether the robot without its padding can turn right round at a pose."""
        info = costmap.info
        place = (info.resolution, info.origin_x, info.origin_y)
        return bool(kernels.count_touching(costmap.cells, *place, self._disc, *pose) == 0)

    def is_free(self, costmap: Grid, pose: Pose2D, twist: Twist2D, motion: Motion) -> bool:
        """Whether one velocity can be driven from a pose: a turn without padding where there is room to turn."""
        samples = np.array([twist], dtype=np.float64)
        bare = not any(twist[:2]) and self.has_room_to_turn(costmap, pose)
        around = self.survey(costmap, pose, motion.reach(samples, STOP), bare=bare)
        return bool(np.isfinite(self.drive(around, twist, samples, motion)[0]))

    def trace(self, pose: Pose2D, velocity: Twist2D, twist: Twist2D, motion: Motion) -> Array:
        """Poses along a velocity, shape (N, 3)."""
        start = np.array([*pose, *velocity], dtype=np.float64)
        return kernels.trace(start, np.array([twist], dtype=np.float64), 0, motion.packed(self._reach, self._spacing))


def _disc(radius: float, spacing: float) -> Array:
    """Points on circles around the origin, the largest of a radius [m], at most `spacing` apart [m]; shape (M, 2)."""
    rings = []
    for r in np.linspace(0.0, radius, math.ceil(radius / spacing) + 1):
        angles = np.linspace(0.0, math.tau, max(math.ceil(math.tau * r / spacing), 1), endpoint=False)
        rings.append(r * np.column_stack((np.cos(angles), np.sin(angles))))
    return np.concatenate(rings)


def _widest_gap(outline: Array) -> float:
    return float(np.hypot(*(np.roll(outline, -1, axis=0) - outline).T).max())
