"""Every user of scans sees the same room, however the laser is mounted."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mounted_laser import MOUNTS, measure, mounted, on_map

from rosbot_patrol.control.collision_guard import CollisionGuard, GuardParams
from rosbot_patrol.control.movers import MoverWatch
from rosbot_patrol.costmap.costs import LETHAL
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.obstacle import height_problem, observe_level
from rosbot_patrol.costmap.params import SourceParams, read_costmap
from rosbot_patrol.geometry import Pose2D, Transform, Twist2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.patrol.house.floor import floor_of
from rosbot_patrol.patrol.intruder.lidar_motion import LidarMotion
from rosbot_patrol.patrol.senses.health import NoHealth
from rosbot_patrol.patrol.senses.lidar import Lidar
from rosbot_patrol.patrol.senses.params import InputParams
from rosbot_patrol.patrol.visibility.coverage import sight_of_scan
from rosbot_patrol.scan import LevelScan, level_scan
from rosbot_patrol.scan_feed import ScanFeed
from rosbot_patrol.simulation.engine import Engine, EngineParams
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy
from rosbot_patrol.simulation.sdf.world import load_world
from rosbot_patrol.tf.tree import Edge, TransformTree

ROOT = Path(__file__).resolve().parents[2]
# A room without symmetry: 5 x 3 m, with a niche at its left.
ROOM = np.array(
    [
        (-2.0, -1.0, 3.0, -1.0),
        (3.0, -1.0, 3.0, 2.0),
        (3.0, 2.0, 1.0, 2.0),
        (1.0, 2.0, 1.0, 1.2),
        (1.0, 1.2, -2.0, 1.2),
        (-2.0, 1.2, -2.0, -1.0),
    ]
)
LIMITS = [12.0, math.inf, float(np.finfo(np.float32).max)]
every_mount = pytest.mark.parametrize("mount", MOUNTS.values(), ids=MOUNTS)
every_limit = pytest.mark.parametrize("limit", LIMITS, ids=["12 m", "inf", "float32"])


def seen(mount: Transform, pose: Pose2D | None = None, **options: object) -> LevelScan:
    """The room from a pose of the robot in it, level in the room's frame."""
    place = on_map(pose or Pose2D(), mount)
    return level_scan(measure(place, ROOM, **options), place, "map")  # type: ignore[arg-type]


def distance_to_walls(points: np.ndarray) -> np.ndarray:
    a, b = ROOM[None, :, :2], ROOM[None, :, 2:]
    along = (((points[:, None] - a) * (b - a)).sum(2) / ((b - a) ** 2).sum(2)).clip(0.0, 1.0)
    return np.hypot(*np.moveaxis(points[:, None] - a - along[..., None] * (b - a), 2, 0)).min(axis=1)


@every_mount
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_guard_slows_a_turn_towards_a_post_and_lets_the_other_pass(mount: Transform, side: float) -> None:
    guard = CollisionGuard(GuardParams(half_length=0.25))
    scan = measure(mount, ROOM, [(0.19, side * 0.31)])
    level = level_scan(scan, mount, "base_link")
    guard.see(level.scan, level.pose, 10.0)
    towards, away = (guard.limit(Twist2D(0.0, 0.0, wz), 10.0).scale for wz in (1.5 * side, -1.5 * side))
    assert towards < 0.8
    assert away == 1.0


@every_mount
def test_the_guard_stops_before_a_wall_ahead_and_not_for_one_behind(mount: Transform) -> None:
    wall = np.array([(0.22, -1.0, 0.22, 1.0)])
    level = level_scan(measure(mount, wall), mount, "base_link")
    guard = CollisionGuard(GuardParams())
    guard.see(level.scan, level.pose, 10.0)
    assert guard.limit(Twist2D(0.5), 10.0).scale < 0.4
    assert guard.limit(Twist2D(-0.5), 10.0).scale == 1.0


def costmap_of(**source: object) -> LayeredCostmap:
    tree = {
        "plugins": [{"name": "obstacles", "type": "costmap_2d::ObstacleLayer"}],
        "obstacles": {
            "observation_sources": "scan",
            "scan": {
                "data_type": "LaserScan",
                "clearing": True,
                "obstacle_range": 8.0,
                "raytrace_range": 9.0,
                **source,
            },
        },
        "rolling_window": True,
        "width": 8.0,
        "height": 8.0,
        "resolution": 0.05,
        "footprint": [[0.1, 0.1], [0.1, -0.1], [-0.1, -0.1], [-0.1, 0.1]],
    }
    return LayeredCostmap(read_costmap(tree))


@every_mount
@every_limit
@pytest.mark.parametrize("pose", [Pose2D(), Pose2D(0.5, 0.3, 2.0)])
def test_a_costmaps_marks_lie_on_true_walls(mount: Transform, limit: float, pose: Pose2D) -> None:
    costmap = costmap_of(inf_is_valid=True)
    (buffer,) = costmap.obstacle_layers[0].buffers.values()
    observation = observe_level(seen(mount, pose, range_max=limit), buffer.params)
    buffer.add(observation)
    costmap.update(10.0, pose)
    iy, ix = np.nonzero(costmap.cells == LETHAL)
    info = costmap.info
    marks = np.column_stack((info.origin_x + (ix + 0.5) * 0.05, info.origin_y + (iy + 0.5) * 0.05))
    assert len(marks) > 250
    assert distance_to_walls(marks).max() < 0.05
    assert np.isfinite(observation.ends).all()


@every_limit
def test_beams_that_met_nothing_clear_as_far_as_the_source_lets_them(limit: float) -> None:
    costmap = costmap_of(inf_is_valid=True, raytrace_range=3.0)
    (buffer,) = costmap.obstacle_layers[0].buffers.values()
    wall = np.array([(1.0, -1.0, 1.0, 1.0)])
    for stamp, walls in ((10.0, wall), (10.1, np.empty((0, 4)))):
        buffer.add(
            observe_level(LevelScan(measure(Transform(), walls, stamp=stamp, range_max=limit), Pose2D()), buffer.params)
        )
        costmap.update(stamp, Pose2D())
        assert (costmap.grid.at(1.0, 0.0) == LETHAL) == (stamp == 10.0)


def test_points_of_a_tilted_laser_count_between_the_sources_heights_as_upstream() -> None:
    """Tilted down by 5 deg at 0.2 m: the floor is 2.3 m ahead, what is farther would be under it."""
    mount = mounted(pitch=0.087)
    level = level_scan(measure(mount, ROOM), mount, "map")
    observation = observe_level(level, SourceParams(data_type="LaserScan", min_obstacle_height=0.0))
    assert observation.hits[:, 0].max() < 2.5
    assert observation.hits[:, 0].min() == pytest.approx(-2.0, abs=0.01)  # behind it looks up
    high = observe_level(level, SourceParams(data_type="LaserScan"), top=0.25)
    assert len(high.hits) < len(high.ends)


@pytest.mark.parametrize(("z", "is_named"), [(0.2, False), (0.0, False), (-1e-9, False), (-0.05, True), (2.5, True)])
def test_a_laser_outside_the_sources_heights_is_named(z: float, is_named: bool) -> None:
    mount = Transform(0.0, 0.0, z, 1.0, 0.0, 0.0, 0.0)
    level = level_scan(measure(mount, ROOM), mount, "odom")
    problem = height_problem(level, SourceParams(data_type="LaserScan"))
    assert ("min_obstacle_height" in problem) == is_named
    buffer = costmap_of().obstacle_layers[0].buffers["scan"]
    buffer.add(observe_level(level, buffer.params))
    assert bool(buffer.all()) != is_named


@every_mount
@every_limit
def test_somebody_who_walks_is_followed_on_the_right_side(mount: Transform, limit: float) -> None:
    watch = MoverWatch()
    with np.errstate(all="raise"):
        for i in range(20):
            level = seen(mount, stamp=10.0 + 0.1 * i, posts=[(0.6 + 0.05 * i, 0.7)], range_max=limit)
            movers = watch.see(level.scan, level.pose)
    assert movers
    nearest = min(movers, key=lambda mover: math.dist(mover[:2], (1.55, 0.7)))
    assert math.dist(nearest[:2], (1.55, 0.7)) < 0.2
    assert nearest.vx == pytest.approx(0.5, abs=0.2)


def room_floor():
    """The room's map, floor inside."""
    info = GridInfo(resolution=0.05, width=140, height=100, origin_x=-3.0, origin_y=-2.0)
    y, x = np.mgrid[0 : info.height, 0 : info.width]
    x, y = info.origin_x + (x + 0.5) * 0.05, info.origin_y + (y + 0.5) * 0.05
    is_floor = (x > -2.0) & (x < 3.0) & (y > -1.0) & ((y < 1.2) | ((x > 1.0) & (y < 2.0)))
    return floor_of(Grid(info, np.where(is_floor, 0, 100).astype(np.int8)))


@every_mount
@every_limit
def test_the_second_witness_sees_who_moved_on_the_right_side(mount: Transform, limit: float) -> None:
    witness, floor = LidarMotion(), room_floor()
    witness.start()
    for i in range(12):
        level = seen(mount, stamp=10.0 + 0.25 * i, posts=[(0.4 + 0.1 * i, 0.5)], range_max=limit)
        witness.see(level.scan, level.pose, floor)
    assert witness.moved is not None
    assert (witness.moved.x, witness.moved.y) == pytest.approx((1.5, 0.5), abs=0.2)


@every_mount
@every_limit
def test_what_stands_before_a_place_hides_it(mount: Transform, limit: float) -> None:
    level = seen(mount, posts=[(1.0, 0.5)], range_max=limit)
    sight = sight_of_scan(level.scan, level.pose, room_floor(), 8.0)
    places = np.array([(1.8, 0.95), (1.8, -0.95)]) - (sight.x, sight.y)  # behind the post, and its mirror image
    assert sight.reaches(np.arctan2(places[:, 1], places[:, 0]), np.hypot(*places.T)).tolist() == [False, True]


def tree_of(mount: Transform) -> TransformTree:
    tree = TransformTree()
    for edge in edges_of(mount):
        tree.add(edge, is_static=True)
    return tree


def edges_of(mount: Transform) -> list[Edge]:
    flat = ("map", "odom"), ("odom", "base_link")
    return [Edge(*pair, 0.0, *Transform()) for pair in flat] + [Edge("base_link", "laser", 0.0, *mount)]


@every_mount
def test_the_patrol_sees_the_same_room(mount: Transform) -> None:
    view = Lidar(InputParams(), tree_of(mount), NoHealth()).place(measure(mount, ROOM), 10.0)
    assert view is not None
    assert distance_to_walls(LevelScan(view.scan, view.map_from_laser).points).max() < 0.02


@every_mount
def test_amcl_and_gmapping_are_fed_with_the_same_room(mount: Transform) -> None:
    feed = ScanFeed(tree_of(mount), "odom", "base_link", lost="nothing is mapped")
    feed.hear(measure(mount, ROOM), 10.0)
    (placed,) = feed.placed(10.0)
    assert distance_to_walls(LevelScan(placed.scan, placed.base_from_laser).points).max() < 0.02


def test_a_laser_that_looks_up_the_wall_is_refused_by_the_replays() -> None:
    mount, scan = mounted(roll=0.8), measure(mounted(), ROOM)
    assert Lidar(InputParams(), tree_of(mount), NoHealth()).place(scan, 10.0) is None
    feed = ScanFeed(tree_of(mount), "odom", "base_link", lost="nothing is mapped")
    feed.hear(scan, 10.0)
    assert list(feed.placed(13.0)) == []
    assert "the laser 'laser' is tilted by 46 deg in 'base_link'" in feed.problem


@pytest.mark.parametrize("rpy", [(0.0, 0.0, 3.14159), (math.pi, 0.0, 0.0), (0.0, math.pi, 0.0), (math.pi, 0.0, 0.7)])
def test_a_simulated_laser_is_levelled_for_the_closed_loop(rpy: tuple[float, float, float]) -> None:
    robot = load_robot(ROOT / "urdf" / "rosbot.urdf")
    assert robot.laser is not None
    engine = Engine(load_world(ROOT / "worlds" / "house.world"), EngineParams(seed=3))
    try:
        laser = replace(robot.laser, pose=from_xyz_rpy((0.02, 0.0, 0.1), rpy))
        engine.spawn_robot(robot)
        engine.step()
        upright = engine.level_scan().points
        engine.remove_robot()
        engine.spawn_robot(replace(robot, laser=laser))
        engine.step()
        found = engine.level_scan().points
    finally:
        engine.close()
    gaps = np.hypot(*np.moveaxis(found[:, None] - upright[None], 2, 0)).min(axis=1)
    assert np.median(gaps) < 0.03
