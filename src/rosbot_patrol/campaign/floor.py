"""The floor of a house, by the world itself and not by its map: where somebody can stand, where the robot can drive,
which room a place belongs to, and what is seen from where.

A place belongs to the room whose point is nearest on foot. Cells are of 0.1 m; `cells[iy, ix]` as everywhere.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, angle_difference
from rosbot_patrol.grid import GridInfo
from rosbot_patrol.maps.raster import flood
from rosbot_patrol.patrol.rooms import Rooms
from rosbot_patrol.simulation.floor_plan import floor_plan
from rosbot_patrol.simulation.scene import Body
from rosbot_patrol.simulation.sight import Sight
from rosbot_patrol.simulation.slices import slice_bodies
from rosbot_patrol.simulation.ways import EYE_LEVEL, Ways

Mask = NDArray[np.bool_]

CELL = 0.1
PERSON_RADIUS, ROBOT_RADIUS = 0.30, 0.24  # that each keeps from furniture [m]
BODY_RADIUS = 0.25  # of somebody [m]
PERSON_HEIGHTS = (0.15, 0.45, 0.75, EYE_LEVEL)  # at which somebody meets furniture [m]
ROBOT_HEIGHTS = (0.04, 0.1, 0.16, 0.2)
EYE = 0.22  # height of the robot's camera [m]
HALF_VIEW = 0.50  # of the camera, to the sides [rad]; a little less than its 0.52
VIEW_RANGE = 7.0  # farther off nobody is asked to be recognised [m]
BODY_HEIGHTS = {"": (0.3, 0.6, 0.9, 1.2, 1.5), "sitting": (0.25, 0.5, 0.75, 1.0), "crouching": (0.2, 0.4, 0.6, 0.8)}
SIDE = 0.15  # of a body from its middle [m]

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
        self.info = _info_of(bodies)
        start = (rooms.base.pose.x, rooms.base.pose.y)
        self.ways = Ways(bodies)
        self._sight = Sight(bodies)
        person = [floor_plan(bodies, self.info, height=h, start=start).cells == 0 for h in PERSON_HEIGHTS]
        robot = [floor_plan(bodies, self.info, height=h, start=start).cells == 0 for h in ROBOT_HEIGHTS]
        self.open: Mask = np.logical_and.reduce(robot)
        self.standable = shrunk(np.logical_and.reduce(person), PERSON_RADIUS)
        drivable = shrunk(self.open, ROBOT_RADIUS)
        self.room_of, self._far = self._rooms_by_way(drivable)
        self.drivable: Mask = drivable & (self.room_of >= 0)

    def places(self, room: int, mask: Mask) -> NDArray[np.float64]:
        """Middles of the cells of a room that are in a mask, shape (N, 2) [m]."""
        iy, ix = np.nonzero(mask & (self._spread == room))
        x0, y0 = self.info.origin_x + CELL / 2.0, self.info.origin_y + CELL / 2.0
        return np.column_stack((x0 + ix * CELL, y0 + iy * CELL))

    def room_at(self, x: float, y: float) -> int:
        """Number of the room that a place belongs to, -1 outside of the house."""
        ix, iy = self.info.cell_of(x, y)
        return int(self._spread[iy, ix]) if self.info.contains_cell(ix, iy) else -1

    def can_stand(self, x: float, y: float) -> bool:
        """Whether there is room for somebody."""
        ix, iy = self.info.cell_of(x, y)
        return self.info.contains_cell(ix, iy) and bool(self.standable[iy, ix])

    def way_from_point(self, x: float, y: float) -> float:
        """How far a place is from its room's point as the robot drives [m], inf where it cannot."""
        ix, iy = self.info.cell_of(x, y)
        return float(self._far[iy, ix]) if self.info.contains_cell(ix, iy) else math.inf

    def leaves_way(self, room: int, x: float, y: float) -> bool:
        """Whether the robot still comes from the base to a room's point when somebody stands at a place."""
        iy, ix = np.indices(self.info.shape)
        cx, cy = self.info.cell_of(x, y)
        off = np.hypot(ix - cx, iy - cy) * CELL
        point = self.rooms.find(room)
        assert point is not None
        start, goal = (self.info.cell_of(p.x, p.y) for p in (self.rooms.base.pose, point.pose))
        way = self.drivable & (off > BODY_RADIUS + ROBOT_RADIUS + CELL)
        return bool(flood(way, *start)[goal[1], goal[0]])

    def share_seen(self, eye: Sequence[float], person: Sequence[float], posture: str = "") -> float:
        """How much of somebody's body is in the line of sight from the robot's camera at a place, 0 to 1.

        Args:
            eye: where the robot stands, x, y [m].
            person: where the body stands, x, y [m].
            posture: how it holds itself.
        """
        bearing = math.atan2(person[1] - eye[1], person[0] - eye[0])
        dx, dy = -SIDE * math.sin(bearing), SIDE * math.cos(bearing)
        heights = BODY_HEIGHTS.get(posture, BODY_HEIGHTS[""])
        points = [(person[0] + s * dx, person[1] + s * dy, z) for z in heights for s in (-1.0, 0.0, 1.0)]
        return self._sight.share((eye[0], eye[1], EYE), points, ())

    def in_view(self, robot: Pose2D, person: Sequence[float], posture: str = "") -> float:
        """The same share, 0 where the robot does not look there or it is too far off."""
        away = math.hypot(person[0] - robot.x, person[1] - robot.y)
        bearing = math.atan2(person[1] - robot.y, person[0] - robot.x)
        if not 0.3 < away < VIEW_RANGE or abs(angle_difference(bearing, robot.yaw)) > HALF_VIEW:
            return 0.0
        return self.share_seen((robot.x, robot.y), person, posture)

    def way(self, start: Sequence[float], goal: Sequence[float]) -> list[tuple[float, float]]:
        """Corners of a way on foot from one place to another, both among them, empty where there is none."""
        end = self.info.cell_of(*start)
        far, parents = _distances(self.standable, [self.info.cell_of(*goal)], until=end)
        if not math.isfinite(far[end[1], end[0]]):
            return []
        cells = [end]
        while parents[cells[-1][1], cells[-1][0]] >= 0:
            iy, ix = divmod(int(parents[cells[-1][1], cells[-1][0]]), self.info.width)
            cells.append((ix, iy))
        points = [self.info.centre_of(*cell) for cell in cells]
        return self._straightened([(start[0], start[1]), *points[1:-1], (goal[0], goal[1])])

    def wall_behind(self, x: float, y: float, farthest: float = 1.2) -> Pose2D | None:
        """The nearest wall to a place, as the pose of what hangs on it and faces the room; None where none is near."""
        cut = self.ways.cut(EYE_LEVEL)
        ranges = cut.cast(x, y, -math.pi, math.tau / 72, 72, 9.0)
        best = int(np.argmin(ranges))
        if ranges[best] > farthest:
            return None
        towards = -math.pi + best * math.tau / 72
        off = ranges[best] - 0.02
        flat = [cut.cast(x, y, towards + d, 1.0, 1, 9.0)[0] * math.cos(d) for d in (-0.3, 0.3)]
        if max(abs(f - ranges[best]) for f in flat) > 0.04:
            return None  # a corner, or a post
        yaw = math.atan2(-math.sin(towards), -math.cos(towards))
        return Pose2D(x + off * math.cos(towards), y + off * math.sin(towards), yaw)

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
        """Whether somebody can walk straight from one place to another."""
        count = max(int(math.dist(start, goal) / (CELL / 2.0)), 1)
        return all(
            self.can_stand(start[0] + k / count * (goal[0] - start[0]), start[1] + k / count * (goal[1] - start[1]))
            for k in range(count + 1)
        )

    def _rooms_by_way(self, drivable: Mask) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        seeds = [self.info.cell_of(room.pose.x, room.pose.y) for room in self.rooms]
        near = shrunk(self.open, 0.12)
        for ix, iy in seeds:  # a point may be given a little nearer to furniture than the robot likes
            drivable[iy - 2 : iy + 3, ix - 2 : ix + 3] |= near[iy - 2 : iy + 3, ix - 2 : ix + 3]
        far, parents = _distances(drivable, seeds)
        order = np.argsort(far, axis=None)
        rooms = np.full(far.size, -1)
        for (ix, iy), room in zip(seeds, self.rooms, strict=True):
            rooms[iy * self.info.width + ix] = room.id
        flat_parents, flat_far = parents.ravel(), far.ravel()
        for cell in order:
            if not math.isfinite(flat_far[cell]):
                break
            if rooms[cell] < 0 <= flat_parents[cell]:
                rooms[cell] = rooms[flat_parents[cell]]
        by_way = rooms.reshape(far.shape)
        self._spread = _spread(by_way, self.open)
        return by_way, far


def shrunk(mask: Mask, radius: float) -> Mask:
    """The cells of a mask that are farther than a radius [m] from all that is not in it."""
    reach = math.ceil(radius / CELL)
    padded = np.pad(mask, reach)
    kept = mask.copy()
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            if math.hypot(dx, dy) * CELL <= radius:
                kept &= padded[reach + dy : reach + dy + mask.shape[0], reach + dx : reach + dx + mask.shape[1]]
    return kept


def _spread(rooms: NDArray[np.int64], is_open: Mask) -> NDArray[np.int64]:
    """Rooms of all open cells: from those that the robot reaches on to their neighbours."""
    spread = rooms.copy()
    for _ in range(12):
        before = spread.copy()
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            moved = np.roll(before, (dy, dx), axis=(0, 1))
            take = is_open & (spread < 0) & (moved >= 0)
            spread[take] = moved[take]
    return spread


def _info_of(bodies: Sequence[Body]) -> GridInfo:
    ends = np.vstack([slice_bodies(bodies, EYE_LEVEL).segments.reshape(-1, 2)])
    low, high = ends.min(axis=0) - 0.3, ends.max(axis=0) + 0.3
    width, height = (math.ceil(v / CELL) for v in high - low)
    return GridInfo(resolution=CELL, width=width, height=height, origin_x=float(low[0]), origin_y=float(low[1]))


def _distances(
    mask: Mask, seeds: Sequence[tuple[int, int]], *, until: tuple[int, int] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Way from the nearest of some cells over a mask [m], and each cell's parent as an index, -1 for none."""
    far = np.full(mask.shape, math.inf)
    parents = np.full(mask.shape, -1)
    heap = []
    for ix, iy in seeds:
        far[iy, ix] = 0.0
        heap.append((0.0, ix, iy))
    heapq.heapify(heap)
    height, width = mask.shape
    while heap:
        here, ix, iy = heapq.heappop(heap)
        if here > far[iy, ix]:
            continue
        if (ix, iy) == until:
            break
        for dx, dy, step in _STEPS:
            x, y = ix + dx, iy + dy
            if 0 <= x < width and 0 <= y < height and mask[y, x] and here + step * CELL < far[y, x]:
                far[y, x] = here + step * CELL
                parents[y, x] = iy * width + ix
                heapq.heappush(heap, (float(far[y, x]), x, y))
    return far, parents
