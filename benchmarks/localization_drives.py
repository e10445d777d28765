"""Drives through the three houses, recorded for amcl: truth, encoder odometry and lidar, without ROS.

The robot follows navfn's plan between places by its true pose. So a drive does not depend on the localisation, and one
record serves any number of parameters and seeds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from rosbot_patrol.errors import PlanningError, WorldError
from rosbot_patrol.geometry import Pose2D, Twist2D, angle_difference, compose, invert
from rosbot_patrol.grid import Grid
from rosbot_patrol.maps.distance_kernels import bounded_distances
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.maps.occupancy import FREE
from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.planning.registry import make_global_planner
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.simulation.engine import STEP, Engine, EngineParams
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.scene.floor_plan import floor_plan
from rosbot_patrol.simulation.sdf.world import load_world

ROOT = Path(__file__).resolve().parents[1]
HOUSES = {"house": "rosbot_map", "flat": "flat_map", "office": "office_map"}
ROOMS = {"house": "room_points", "flat": "flat_room_points", "office": "office_room_points"}
HEIGHTS = (0.02, 0.07, 0.12, 0.2)  # heights at which the robot is checked for contact [m]
SCAN_STEPS = 20  # of the engine between scans: 10 Hz
CLEAR_M, WIDE_M = 0.25, 0.6  # distance from walls [m]: no path is closer; farther all paths cost the same
SPEED, TURN = 0.36, 1.0  # [m/s, rad/s]
AHEAD_M, THERE_M = 0.35, 0.1


@dataclass(frozen=True)
class Moment:
    """Truth, odometry and scan at one time."""

    truth: Pose2D
    odometry: Pose2D
    scan: LaserScan


@dataclass(frozen=True)
class Record:
    """A drive, with the laser's pose on the robot."""

    house: str
    moments: list[Moment]
    mount: Pose2D


@lru_cache
def map_of(house: str) -> Grid:
    """The shipped map of a house."""
    return read_map(ROOT / "maps" / f"{HOUSES[house]}.yaml")


@lru_cache
def _costs(house: str) -> Grid:
    """Costs for the planner: high near walls."""
    known = map_of(house)
    reach = math.ceil(WIDE_M / known.info.resolution)
    bodies = load_world(ROOT / "worlds" / f"{house}.world").bodies
    blocked = known.cells != FREE
    for height in HEIGHTS:  # the lidar does not see low obstacles
        blocked |= floor_plan(bodies, known.info, height=height, start=(0.0, 0.0)).cells != FREE
    away = bounded_distances(np.ascontiguousarray(blocked), reach) * known.info.resolution
    fade = np.clip((WIDE_M - away) / (WIDE_M - CLEAR_M), 0.0, 1.0)
    return Grid(known.info, np.where(away < CLEAR_M, 254, np.rint(200.0 * fade)).astype(np.uint8))


def plan(house: str, start: Pose2D, goal: Pose2D) -> np.ndarray:
    """Plan the path between two places, shape (N, 2); raises PlanningError."""
    planner = make_global_planner("navfn/NavfnROS", {"NavfnROS": {"allow_unknown": False}})
    return np.asarray(planner.plan(_costs(house), start, goal))[:, :2]


def random_pose(house: str, rng: np.random.Generator) -> Pose2D:
    """Draw a free place with any heading that can be reached from the base."""
    costs = _costs(house)
    free = np.argwhere(costs.cells < 150)
    while True:
        iy, ix = free[rng.integers(len(free))]
        x, y = costs.info.centre_of(int(ix), int(iy))
        pose = Pose2D(x, y, float(rng.uniform(-math.pi, math.pi)))
        try:
            plan(house, Pose2D(), pose)
        except PlanningError:
            continue
        return pose


def room_goals(house: str) -> list[Pose2D]:
    """The room points in their order, and then the base."""
    poses = [room.pose for room in load_rooms(ROOT / "params" / f"{ROOMS[house]}.yaml")]
    return [*poses[1:], poses[0]]


class Driver:
    """Driver of a simulated robot from place to place.

    Args:
        house: name of the house.
        start: initial pose.
        seed: seed of all noise.
    """

    def __init__(self, house: str, start: Pose2D, seed: int) -> None:
        self.house = house
        self.engine = Engine(load_world(ROOT / "worlds" / f"{house}.world"), EngineParams(seed=seed))
        self.engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"), start)
        self.touched = 0

    def go(self, goal: Pose2D) -> Iterator[Moment]:
        """Drive to a goal and turn to its heading; yields a moment for each scan."""
        way = plan(self.house, self.engine.pose, goal)
        nearest = 0
        while math.dist(self.engine.pose[:2], way[-1]) > THERE_M:
            pose = self.engine.pose
            nearest += int(np.hypot(*(way[nearest : nearest + 40] - pose[:2]).T).argmin())
            off = np.hypot(*(way[nearest:] - pose[:2]).T)
            beyond = np.flatnonzero(off > AHEAD_M)
            ahead = way[nearest + int(beyond[0])] if len(beyond) else way[-1]
            bearing = angle_difference(math.atan2(ahead[1] - pose.y, ahead[0] - pose.x), pose.yaw)
            yield self._act(SPEED * max(math.cos(bearing), 0.0) if abs(bearing) < 0.8 else 0.0, 2.0 * bearing)
        while abs(turn := angle_difference(goal.yaw, self.engine.pose.yaw)) > 0.1:
            yield self._act(0.0, 2.0 * turn)

    def spin(self) -> Iterator[Moment]:
        """Make a full turn, as a patrol does in each room."""
        for _ in range(round(math.tau / TURN / (SCAN_STEPS * STEP))):
            yield self._act(0.0, TURN)

    def _act(self, forward: float, turn: float) -> Moment:
        self.engine.command(Twist2D(forward, 0.0, max(-TURN, min(TURN, turn))))
        for _ in range(SCAN_STEPS):
            self.engine.step()
        self.touched += bool(self.engine.touches())
        return Moment(self.engine.pose, self.engine.robot.odometry.pose, self.engine.level_scan().scan)

    def record(self, moments: list[Moment]) -> Record:
        """Make the record of a drive."""
        return Record(self.house, moments, self.engine.level_scan().pose)


def patrol(house: str, seed: int, rooms: int | None = None) -> Record:
    """Drive from the base to the rooms, with a full turn in each, and home."""
    driver = Driver(house, Pose2D(), seed)
    goals = room_goals(house)
    if rooms is not None:
        goals = goals[:rooms]
    moments = [moment for goal in goals for way in (driver.go(goal), driver.spin()) for moment in way]
    driver.engine.close()
    return driver.record(moments)


def wandering(house: str, seed: int, seconds: float) -> Record:
    """Drive from a random place to random places, for a time."""
    rng = np.random.default_rng([seed, sum(map(ord, house))])
    while True:
        try:
            driver = Driver(house, random_pose(house, rng), seed)
        except WorldError:  # an obstacle that the lidar does not see
            continue
        break
    moments: list[Moment] = []
    wanted = round(seconds / (SCAN_STEPS * STEP))
    while len(moments) < wanted:
        moments += list(driver.go(random_pose(house, rng)))
    driver.engine.close()
    return driver.record(moments[:wanted])


def carried(before: Record, after: Record) -> Record:
    """Join two drives as if the robot had been lifted in between: clock and odometry do not show it."""
    last, first = before.moments[-1], after.moments[0]
    shift = compose(last.odometry, invert(first.odometry))
    later = last.scan.stamp + 0.1 - first.scan.stamp
    moved = [
        Moment(m.truth, compose(shift, m.odometry), replace(m.scan, stamp=m.scan.stamp + later)) for m in after.moments
    ]
    return Record(before.house, [*before.moments, *moved], before.mount)
