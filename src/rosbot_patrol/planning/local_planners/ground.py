"""Ground of one control cycle: the part of the plan to follow, and the way round obstacles on it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import INSCRIBED
from rosbot_patrol.errors import ControlError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo, cells_of_points
from rosbot_patrol.planning.critics import Situation, distances_from, shrink
from rosbot_patrol.planning.critics import sweep_kernels as kernels
from rosbot_patrol.planning.interfaces import Array, LocalView

_TOO_NEAR = 0.3  # a blocked plan with less than this free ahead is not driven [m]
_NEIGHBOURS = [(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]


@dataclass(frozen=True)
class Ground:
    """Costs in coarse cells, the part of the plan to follow, and distances to its end [cells]."""

    coarse: Grid
    plan: Array
    goal_field: NDArray[np.float32]

    def situation(self, view: LocalView, samples: Array, ends: Array, nose: float) -> Situation:
        """Input of the critics."""
        return Situation(
            pose=view.pose,
            samples=samples,
            ends=ends,
            coarse=self.coarse,
            plan=self.plan,
            nose=nose,
            goal_field=self.goal_field,
        )


def survey_ground(view: LocalView, plan: Array, *, behind: int, lookahead: float, radius: float) -> Ground:
    """Find the plan up to the local goal, and lead it round obstacles.

    The local goal is the first reachable pose at least `lookahead` along the plan; without one, the last reachable pose
    before that. Upstream takes the last pose in view, and so cuts corners or gets stuck in a bend.

    Args:
        view: input of this cycle.
        plan: the part in view, shape (N, 3).
        behind: how many of its poses lie behind the robot.
        lookahead: distance of the local goal along the plan [m].
        radius: circumscribed radius of the robot [m]; a way round keeps that distance from obstacles if it can.

    Raises:
        ControlError: something stands on the plan right ahead, and nothing leads round it.
    """
    coarse = _open_around(shrink(view.costmap), view.pose, radius)
    info = coarse.info
    ix, iy = cells_of_points(info, plan[:, :2]).T
    ix, iy = ix.clip(0, info.width - 1), iy.clip(0, info.height - 1)
    reachable = np.isfinite(distances_from(coarse, np.array([[view.pose.x, view.pose.y]]))[iy, ix])
    last = _local_goal(plan, reachable, behind, lookahead)
    if last < len(plan) - 1 and not reachable[last + 1 :].any():
        gap = math.hypot(plan[last, 0] - view.pose.x, plan[last, 1] - view.pose.y) if last >= behind else 0.0
        if gap < _TOO_NEAR:
            raise ControlError("something stands on the plan and there is no way round it in view")
    followed = plan[: last + 1]
    field = distances_from(coarse, followed[-1:, :2])
    if (coarse.cells[iy, ix][behind : last + 1] >= INSCRIBED).any():
        followed = _way_round(coarse, view.pose, followed, radius)
    return Ground(coarse, followed, field)


def _open_around(coarse: Grid, pose: Pose2D, radius: float) -> Grid:
    """Costs with the robot's surroundings opened; a robot too close to something can leave through inscribed cells."""
    info = coarse.info
    x0, y0 = info.cell_of_clamped(pose.x, pose.y)
    if coarse.cells[y0, x0] < INSCRIBED:
        return coarse
    cells = coarse.cells.copy()
    reach = math.ceil(radius / info.resolution) + 1
    part = cells[max(y0 - reach, 0) : y0 + reach + 1, max(x0 - reach, 0) : x0 + reach + 1]
    part[part == INSCRIBED] = INSCRIBED - 1
    cells[y0, x0] = INSCRIBED - 1
    return Grid(info, cells)


def _local_goal(plan: Array, reachable: NDArray[np.bool_], behind: int, lookahead: float) -> int:
    """Index of the local goal, -1 if no pose can be reached."""
    ahead = plan[behind:]
    along = np.zeros(len(ahead))
    np.cumsum(np.hypot(*np.diff(ahead[:, :2], axis=0).T), out=along[1:])
    far = np.flatnonzero(reachable[behind:] & (along >= lookahead))
    if len(far):
        return behind + int(far[0])
    known = np.flatnonzero(reachable)
    return int(known[-1]) if len(known) else -1


def _way_round(coarse: Grid, pose: Pose2D, plan: Array, radius: float) -> Array:
    """Path to the plan's end that keeps clear of obstacles, shape (M, 3); the plan itself if there is none."""
    info = coarse.info
    cap = math.ceil(radius / info.resolution) + 2
    clear = kernels.clearances(coarse.cells, 0, 0, info.width, info.height, cap) * info.resolution
    cells = coarse.cells.copy()
    cells[clear < radius + 0.5 * info.resolution] = INSCRIBED
    for wide in (_open_around(Grid(info, cells), pose, radius), coarse):
        field = distances_from(wide, plan[-1:, :2])
        way = _descend(info, field, pose)
        if len(way):
            yaw = np.arctan2(*np.diff(way, axis=0, append=plan[-1:, :2]).T[::-1])
            return np.vstack((np.column_stack((way, yaw)), plan[-1:]))
    return plan


def _descend(info: GridInfo, field: NDArray[np.float32], pose: Pose2D) -> Array:
    """Centres of the cells from a pose down to the field's end, shape (M, 2); empty if it does not lead there."""
    ix, iy = info.cell_of_clamped(pose.x, pose.y)
    way = []
    here = float(field[iy, ix])
    if not math.isfinite(here):
        return np.empty((0, 2))
    for _ in range(info.width + info.height + field.size // 8):
        way.append(info.centre_of(ix, iy))
        if here < 1.0:
            break
        around = [(ix + dx, iy + dy) for dx, dy in _NEIGHBOURS if info.contains_cell(ix + dx, iy + dy)]
        steepest = min(around, key=lambda c: (float(field[c[1], c[0]]) - here) / math.hypot(c[0] - ix, c[1] - iy))
        if field[steepest[1], steepest[0]] >= here:
            break
        ix, iy = steepest
        here = float(field[iy, ix])
    return np.array(way)
