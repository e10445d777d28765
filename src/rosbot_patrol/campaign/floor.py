"""Floor of a house from the world's own shapes: where people can stand, where the robot can drive, what is in view.

Rooms are separated as in the patrol (`patrol.house.regions`), but on the true floor. Cells are 0.1 m wide.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, angle_difference
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.raster import flood, grown
from rosbot_patrol.patrol.house.floor import floor_of
from rosbot_patrol.patrol.house.regions import NOBODYS, part_rooms
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.simulation.scene.floor_plan import floor_plan
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.scene.sight import Sight
from rosbot_patrol.simulation.scene.slices import slice_bodies
from rosbot_patrol.simulation.scene.ways import EYE_LEVEL, Ways

Mask = NDArray[np.bool_]

CELL = 0.1
_MARGIN = 0.3  # around what stands in the world [m]; outdoors, where a door leads there: no floor of a room
PERSON_RADIUS, ROBOT_RADIUS = 0.30, 0.24  # distance that each keeps from furniture [m]
BODY_RADIUS = 0.25  # of a person [m]
PERSON_HEIGHTS = (0.16, 0.45, 0.75, EYE_LEVEL)  # heights at which a person collides with furniture [m]
ROBOT_HEIGHTS = (0.04, 0.1, 0.16, 0.2)
EYE = 0.22  # height of the robot's camera [m]
VIEW_WIDTH = 1.047  # of the camera [rad]
HALF_VIEW = 0.50  # half of it, with a margin [rad]
RECOGNISED = 0.3  # visible share of a body above which it should be recognised
VIEW_RANGE = 7.0  # maximum range at which a person should be recognised [m]
BODY_HEIGHTS = {"": (0.3, 0.6, 0.9, 1.2, 1.5), "sitting": (0.25, 0.5, 0.75, 1.0), "crouching": (0.2, 0.4, 0.6, 0.8)}
SIDE = 0.15  # distance of a body's side from its centre [m]

_TIGHT = 0.12  # distance that the robot keeps from furniture if a room's point requires less [m]

_STEPS = [(dx, dy, math.hypot(dx, dy)) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]


class Floor:
    """One house's floor.

    Args:
        bodies: what stands there.
        rooms: points of the rooms; room 0 is where the robot waits.
    """

    def __init__(self, bodies: Sequence[Body], rooms: Rooms) -> None:
        self.rooms = rooms
        self.bodies = tuple(bodies)
        self.info = floor_info(bodies)
        start = (rooms.base.pose.x, rooms.base.pose.y)
        self.ways = Ways(bodies)
        self._sight = Sight(bodies)
        heights = sorted({*PERSON_HEIGHTS, *ROBOT_HEIGHTS})
        free = {h: floor_plan(bodies, self.info, height=h, start=start).cells == 0 for h in heights}
        inside, edge = np.zeros(self.info.shape, bool), round(_MARGIN / CELL)
        inside[edge:-edge, edge:-edge] = True
        self.open: Mask = np.logical_and.reduce([inside, *(free[h] for h in ROBOT_HEIGHTS)])
        self.standable = shrunk(np.logical_and.reduce([inside, *(free[h] for h in PERSON_HEIGHTS)]), PERSON_RADIUS)
        drivable = shrunk(self.open, ROBOT_RADIUS)
        self.drivable: Mask = self._reached(drivable)
        self.plan = floor_of(Grid(self.info, np.where(self.open, 0, 100).astype(np.int8)))
        self.regions = part_rooms(self.plan, rooms)
        self._room_of = self._room_cells()
        self._drives: dict[int, NDArray[np.int64]] = {}

    def places(self, room: int, mask: Mask) -> NDArray[np.float64]:
        """Centres of a room's cells that are in a mask, shape (N, 2) [m]."""
        iy, ix = np.nonzero(mask & (self._room_of == room))
        x0, y0 = self.info.origin_x + CELL / 2.0, self.info.origin_y + CELL / 2.0
        return np.column_stack((x0 + ix * CELL, y0 + iy * CELL))

    def room_at(self, x: float, y: float) -> int:
        """Number of the room at a place, -1 outside the house."""
        ix, iy = self.info.cell_of(x, y)
        return int(self._room_of[iy, ix]) if self.info.contains_cell(ix, iy) else -1

    def can_stand(self, x: float, y: float) -> bool:
        """Whether a person has room to stand there."""
        ix, iy = self.info.cell_of(x, y)
        return self.info.contains_cell(ix, iy) and bool(self.standable[iy, ix])

    def leaves_way(self, room: int, x: float, y: float) -> bool:
        """Whether the robot still gets from the base to a room's point when a person stands at a place."""
        apart = BODY_RADIUS + ROBOT_RADIUS + CELL
        cx, cy = self.info.cell_of(x, y)
        drive = self._cells_to(room)
        if not len(drive) or np.hypot(drive[:, 0] - cx, drive[:, 1] - cy).min() > apart / CELL:
            return bool(len(drive))
        return not self.is_barred(room, np.array([[x, y]]), apart)

    def is_barred(self, room: int, points: NDArray[np.float64], apart: float = ROBOT_RADIUS) -> bool:
        """Whether something at some points keeps the robot from a room that it could get to.

        Args:
            room: number of the room.
            points: where it stands, x, y, shape (N, 2) [m].
            apart: distance that the robot's centre keeps from them [m].
        """
        drive = self._cells_to(room)
        if not len(drive):
            return False
        mask = np.zeros(self.info.shape, bool)
        for x, y in points:
            ix, iy = self.info.cell_of(float(x), float(y))
            if self.info.contains_cell(ix, iy):
                mask[iy, ix] = True
        way = self.drivable & ~grown(mask, apart / CELL)
        return not bool(flood(way, *map(int, drive[0]))[drive[-1][1], drive[-1][0]])

    def share_seen(self, eye: Sequence[float], person: Sequence[float], posture: str = "") -> float:
        """Share of a person's body in the line of sight from the robot's camera at a place, 0 to 1.

        Args:
            eye: position of the robot, x, y [m].
            person: position of the body, x, y [m].
            posture: of the body.
        """
        bearing = math.atan2(person[1] - eye[1], person[0] - eye[0])
        dx, dy = -SIDE * math.sin(bearing), SIDE * math.cos(bearing)
        heights = BODY_HEIGHTS.get(posture, BODY_HEIGHTS[""])
        points = [(person[0] + s * dx, person[1] + s * dy, z) for z in heights for s in (-1.0, 0.0, 1.0)]
        return self._sight.share((eye[0], eye[1], EYE), points, ())

    def in_view(self, robot: Pose2D, person: Sequence[float], posture: str = "") -> float:
        """The same share, 0 if the robot does not look there or the person is too far away."""
        away = math.hypot(person[0] - robot.x, person[1] - robot.y)
        bearing = math.atan2(person[1] - robot.y, person[0] - robot.x)
        if not 0.3 < away < VIEW_RANGE or abs(angle_difference(bearing, robot.yaw)) > HALF_VIEW:
            return 0.0
        return self.share_seen((robot.x, robot.y), person, posture)

    def way(self, start: Sequence[float], goal: Sequence[float]) -> list[tuple[float, float]]:
        """Corners of a walk from one place to another, including both; empty if there is no path."""
        cells = _cells_between(self.standable, self.info.cell_of(*start), self.info.cell_of(*goal))
        if not cells:
            return []
        points = [self.info.centre_of(*cell) for cell in cells]
        return self._straightened([(start[0], start[1]), *points[1:-1], (goal[0], goal[1])])

    def wall_behind(self, x: float, y: float, farthest: float = 1.2) -> Pose2D | None:
        """Pose of something on the nearest wall to a place, facing the room; None if no wall is near."""
        cut = self.ways.cut(EYE_LEVEL)
        ranges = cut.cast(x, y, -math.pi, math.tau / 72, 72, longest=9.0)
        best = int(np.argmin(ranges))
        if ranges[best] > farthest:
            return None
        towards = -math.pi + best * math.tau / 72
        off = ranges[best] - 0.02
        flat = [cut.cast(x, y, towards + d, 1.0, 1, longest=9.0)[0] * math.cos(d) for d in (-0.3, 0.3)]
        if max(abs(f - ranges[best]) for f in flat) > 0.04:
            return None  # a corner, or a post
        yaw = math.atan2(-math.sin(towards), -math.cos(towards))
        return Pose2D(x + off * math.cos(towards), y + off * math.sin(towards), yaw)

    def drive_to(self, room: int) -> NDArray[np.float64]:
        """The robot's shortest path from the base to a room's point, x, y, shape (N, 2) [m]."""
        origin = np.array([self.info.origin_x, self.info.origin_y])
        found: NDArray[np.float64] = origin + (self._cells_to(room) + 0.5) * CELL
        return found

    def _cells_to(self, room: int) -> NDArray[np.int64]:
        """Cells of the shortest path from the base to a room's point, ix, iy, shape (N, 2)."""
        if room not in self._drives:
            known = self.rooms.find(room)
            assert known is not None
            base, point = (self.info.cell_of(p.x, p.y) for p in (self.rooms.base.pose, known.pose))
            self._drives[room] = np.array(_cells_between(self.drivable, base, point), np.int64).reshape(-1, 2)
        return self._drives[room]

    def _straightened(self, points: list[tuple[float, float]]) -> list[tuple[float, float]]:
        kept, at = [points[0]], 0
        while at + 1 < len(points):
            ahead = len(points) - 1
            while ahead > at + 1 and not self.is_straight(points[at], points[ahead]):
                ahead -= max((ahead - at) // 8, 1)
            at = max(ahead, at + 1)
            kept.append(points[at])
        return kept

    def is_straight(self, start: Sequence[float], goal: Sequence[float]) -> bool:
        """Whether a person can walk straight from one place to another."""
        count = max(int(math.dist(start, goal) / (CELL / 2.0)), 1)
        return all(
            self.can_stand(start[0] + k / count * (goal[0] - start[0]), start[1] + k / count * (goal[1] - start[1]))
            for k in range(count + 1)
        )

    def _reached(self, drivable: Mask) -> Mask:
        """Cells that the robot can reach from its base."""
        base = self.rooms.base.pose
        near = shrunk(self.open, _TIGHT)
        for room in self.rooms:  # a room's point may be slightly closer to furniture than the robot's own margin
            ix, iy = self.info.cell_of(room.pose.x, room.pose.y)
            about = (slice(iy - 2, iy + 3), slice(ix - 2, ix + 3))
            drivable[about] |= near[about]
        return flood(drivable, *self.info.cell_of(base.x, base.y))

    def _room_cells(self) -> NDArray[np.int16]:
        """Room of each cell, -1 if there is none."""
        iy, ix = np.indices(self.info.shape).reshape(2, -1)
        x, y = self.info.origin_x + (ix + 0.5) * CELL, self.info.origin_y + (iy + 0.5) * CELL
        px, py, inside = self.plan.indices(x, y)
        found: NDArray[np.int16] = np.where(inside, self.regions.labels[py, px], NOBODYS).reshape(self.info.shape)
        return found


def shrunk(mask: Mask, radius: float) -> Mask:
    """Cells of a mask farther than a radius [m] from all cells outside it."""
    reach = math.ceil(radius / CELL)
    kept: Mask = ~grown(~np.pad(mask, reach), radius / CELL)[reach:-reach, reach:-reach]
    return kept


def floor_info(bodies: Sequence[Body], source: str | Path = "the world") -> GridInfo:
    """Grid that holds what stands in a world, be it as low as the walls of a maze, with a margin.

    Raises:
        WorldError: nothing in it is as high as the robot's camera.
    """
    ends = np.vstack([slice_bodies(bodies, height).segments.reshape(-1, 2) for height in (EYE, EYE_LEVEL)])
    if not len(ends):
        raise WorldError(source, f"has no walls: nothing in it is {EYE:g} m high, so there are no rooms to guard")
    low, high = ends.min(axis=0) - _MARGIN, ends.max(axis=0) + _MARGIN
    width, height = (math.ceil(v / CELL) for v in high - low)
    return GridInfo(resolution=CELL, width=width, height=height, origin_x=float(low[0]), origin_y=float(low[1]))


def _cells_between(mask: Mask, start: tuple[int, int], goal: tuple[int, int]) -> list[tuple[int, int]]:
    """Cells of the shortest path over a mask, empty if there is none (Dijkstra 1959)."""
    far = np.full(mask.shape, math.inf)
    parents: dict[tuple[int, int], tuple[int, int]] = {}
    far[goal[1], goal[0]] = 0.0
    heap = [(0.0, goal)]
    height, width = mask.shape
    while heap:
        here, (ix, iy) = heapq.heappop(heap)
        if (ix, iy) == start:
            break
        if here > far[iy, ix]:
            continue
        for dx, dy, step in _STEPS:
            x, y = ix + dx, iy + dy
            if 0 <= x < width and 0 <= y < height and mask[y, x] and here + step < far[y, x]:
                far[y, x] = here + step
                parents[x, y] = (ix, iy)
                heapq.heappush(heap, (here + step, (x, y)))
    if not math.isfinite(far[start[1], start[0]]):
        return []
    cells = [start]
    while cells[-1] != goal:
        cells.append(parents[cells[-1]])
    return cells
