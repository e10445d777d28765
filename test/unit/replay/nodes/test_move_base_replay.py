"""move_base over a bag of a drive to a goal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import made_patrol
import numpy as np
import pytest
from made_bag import Maker, write_bag
from made_drive import BEGIN, LASER, drive, room_map, scan_at

from rosbot_patrol.errors import BagError
from rosbot_patrol.geometry import Pose2D, compose, invert
from rosbot_patrol.planning.local_planners import trajectory_planner
from rosbot_patrol.replay.bags.bag import Bag
from rosbot_patrol.replay.nodes.move_base import FIELDS
from rosbot_patrol.replay.nodes.setup import Setup, build_replay
from rosbot_patrol.replay.results.comparison import compare
from rosbot_patrol.replay.results.tables import Result
from rosbot_patrol.replay.runner import run_replay
from rosbot_patrol.scan import LaserScan

SECONDS, GOAL = 7.0, Pose2D(1.9, 0.0, 0.0)
IMAGE, INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
ODOMETRY, CANCEL = "nav_msgs/msg/Odometry", "actionlib_msgs/msg/GoalID"


def goal_message(maker: Maker, stamp: float, pose: Pose2D, name: str) -> object:
    goal_id = maker.new(CANCEL, maker.stamp(stamp), name)
    place = maker.new("geometry_msgs/msg/PoseStamped", maker.header(stamp, "map"), maker.pose(pose))
    goal = maker.new("move_base_msgs/msg/MoveBaseGoal", place)
    return maker.new(made_patrol.GOAL, maker.header(stamp, ""), goal_id, goal)


def odometry_message(maker: Maker, stamp: float, pose: Pose2D, speed: float) -> object:
    zero = np.zeros(36)
    vector = "geometry_msgs/msg/Vector3"
    twist = maker.new("geometry_msgs/msg/Twist", maker.new(vector, speed, 0.0, 0.0), maker.new(vector, 0.0, 0.0, 0.0))
    return maker.new(
        ODOMETRY,
        maker.header(stamp, "odom"),
        "base_link",
        maker.new("geometry_msgs/msg/PoseWithCovariance", maker.pose(pose), zero),
        maker.new("geometry_msgs/msg/TwistWithCovariance", twist, zero),
    )


def as_measured(scan: LaserScan) -> LaserScan:
    return scan


def upside_down(scan: LaserScan) -> LaserScan:
    """The same room by a laser that was pitched over: its beam at -a looks where the other's at a did."""
    return replace(scan, ranges=np.roll(scan.ranges[::-1], 1))


def drive_bag(
    folder: Path,
    *more: tuple[float, str, object],
    laser: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 0.0),
    measured: Callable[[LaserScan], LaserScan] = as_measured,
) -> Path:
    maker, rng = Maker(), np.random.default_rng(1)
    mount = maker.transform("base_link", "laser", BEGIN, (LASER.x, LASER.y, 0.1), laser)
    found = [(BEGIN, "/tf_static", maker.tf(mount)), (BEGIN, "/map", maker.map(room_map())), *more]
    found.append((BEGIN + 0.55, "/move_base/goal", goal_message(maker, BEGIN + 0.55, GOAL, "goal-1")))
    moments = list(drive(SECONDS))
    there = next(moment for moment in moments if moment.truth.x > GOAL.x - 0.03)
    for i, each in enumerate(moments):
        stamp, is_there = BEGIN + each.time, each.time >= there.time
        moment = there if is_there else each  # it stands at the goal from then on
        correction = compose(moment.truth, invert(moment.odometry))
        moves = (
            maker.planar("odom", "base_link", stamp, moment.odometry),
            maker.planar("map", "odom", stamp, correction),
        )
        found.append((stamp + 0.01, "/tf", maker.tf(*moves)))
        found.append((stamp + 0.011, "/odom", odometry_message(maker, stamp, moment.odometry, 0.4 * (not is_there))))
        if i % 2 == 1:
            found.append((stamp + 0.005, "/scan", maker.scan(measured(scan_at(moment.truth, stamp, rng)))))
    return write_bag(folder / "drive.bag", sorted(found, key=lambda each: each[0]))


def replayed(path: Path) -> Result:
    with Bag(path) as bag:
        return run_replay(bag, build_replay(Setup(node="move_base")))


def test_it_plans_drives_and_arrives_as_the_bags_robot_did(tmp_path: Path) -> None:
    result = replayed(drive_bag(tmp_path))
    commands, plans, outcomes = (result.tables[name] for name in ("commands", "plans", "outcomes"))
    assert result.counts["goals"] == 1
    assert plans["length"][0] == pytest.approx(1.9, abs=0.35)
    assert outcomes["succeeded"].tolist() == [True]
    assert outcomes["text"].tolist() == ["Goal reached."]
    on_the_way = (commands["stamp"] > BEGIN + 1.5) & (commands["stamp"] < BEGIN + 3.5)
    assert commands["vx"][on_the_way].min() > 0.15
    assert np.abs(commands["wz"][on_the_way]).max() < 0.6
    assert result.tables["states"]["state"].tolist() == ["planning", "controlling", "idle"]


def test_the_same_bit_for_bit_and_a_planted_fault_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = drive_bag(tmp_path)
    stored = replayed(path)
    assert replayed(path).digest == stored.digest
    real = trajectory_planner.TrajectoryPlanner.compute

    def slow(self: object, *args: object) -> object:
        found = real(self, *args)
        return found._replace(vx=0.3 * found.vx)

    monkeypatch.setattr(trajectory_planner.TrajectoryPlanner, "compute", slow)
    names = [each.name for each in compare(stored, replayed(path), FIELDS)]
    assert "commands.vx" in names


def test_a_laser_that_is_pitched_over_drives_as_an_upright_one(tmp_path: Path) -> None:
    stored = replayed(drive_bag(tmp_path))
    (tmp_path / "drive.bag").unlink()
    turned = replayed(drive_bag(tmp_path, laser=(0.0, 1.0, 0.0, 0.0), measured=upside_down))
    assert compare(stored, turned, FIELDS) == []


def test_a_lidar_that_goes_blind_on_the_way_stops_the_robot(tmp_path: Path) -> None:
    def blinded(scan: LaserScan) -> LaserScan:
        return replace(scan, ranges=np.zeros(len(scan.ranges))) if scan.stamp > BEGIN + 2.0 else scan

    result = replayed(drive_bag(tmp_path, measured=blinded))
    commands = result.tables["commands"]
    later = commands["stamp"] > BEGIN + 3.5
    assert later.any()
    assert commands["vx"][later].max() == 0.0
    assert result.counts["refused"] > 10


def test_a_cancelled_goal_ends(tmp_path: Path) -> None:
    maker = Maker()
    cancel = maker.new(CANCEL, maker.stamp(BEGIN + 2.0), "goal-1")
    result = replayed(drive_bag(tmp_path, (BEGIN + 2.0, "/move_base/cancel", cancel)))
    assert result.counts["cancelled"] == 1
    assert len(result.tables["outcomes"]["stamp"]) == 0
    last = {name: values[-1] for name, values in result.tables["commands"].items()}
    assert (last["vx"], last["wz"], last["reason"]) == (0.0, 0.0, "cancelled")


def low_bar(maker: Maker) -> list[tuple[float, str, object]]:
    """A camera on the robot that sees a bar on the floor, 0.6 m ahead, under the lidar's plane, from 1.5 s on."""
    wide, high, focal, camera = 160, 120, 100.0, 0.2
    mount = maker.transform("base_link", "camera", BEGIN, (0.0, 0.0, camera), (-0.5, 0.5, -0.5, 0.5))
    k = np.array([focal, 0, wide / 2, 0, focal, high / 2, 0, 0, 1])
    region = maker.new("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
    rest = k, np.eye(3).ravel(), np.zeros(12), 0, 0, region
    info = maker.new(INFO, maker.header(BEGIN, "camera"), high, wide, "plumb_bob", np.zeros(5), *rest)
    depth = np.full((high, wide), np.nan, np.float32)
    rows = [round(high / 2 + focal * (camera + 0.04 - z) / 0.6) for z in (0.1, 0.03)]
    depth[rows[0] : rows[1], 20:140] = 0.6
    found = [(BEGIN, "/tf_static", maker.tf(mount)), (BEGIN, "/camera/depth/camera_info", info)]
    for i in range(15, round(10 * SECONDS)):
        stamp = BEGIN + 0.1 * i
        data = depth.view(np.uint8).ravel()
        image = maker.new(IMAGE, maker.header(stamp, "camera"), high, wide, "32FC1", 0, 4 * wide, data)
        found.append((stamp + 0.02, "/camera/depth/image_raw", image))
    return found


def test_a_low_thing_that_the_camera_saw_stops_the_robot(tmp_path: Path) -> None:
    commands = replayed(drive_bag(tmp_path, *low_bar(Maker()))).tables["commands"]
    later = commands["stamp"] > BEGIN + 2.5
    assert later.any()
    assert commands["vx"][later].mean() < 0.05


def test_a_depth_topic_of_another_type_is_named(tmp_path: Path) -> None:
    maker = Maker()
    wrong = (BEGIN + 0.1, "/camera/depth/image_raw", maker.initial_pose(BEGIN, Pose2D()))
    path = drive_bag(tmp_path, wrong)
    with pytest.raises(
        BagError, match="'/camera/depth/image_raw' is geometry_msgs/PoseWithCovarianceStamped, expected"
    ):
        replayed(path)
