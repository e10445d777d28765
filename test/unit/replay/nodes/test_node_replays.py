"""amcl and slam_gmapping over bags of a made-up drive."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from made_bag import Maker, write_bag
from made_drive import BEGIN, LASER, drive_messages, room_map, truth_at

from rosbot_patrol.amcl import localizer
from rosbot_patrol.amcl.motion_model import move_particles
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.errors import BagError, MapError
from rosbot_patrol.geometry import Pose2D, compose, invert
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.replay.bags.bag import Bag
from rosbot_patrol.replay.nodes import amcl as amcl_replay
from rosbot_patrol.replay.nodes.amcl import AmclReplay
from rosbot_patrol.replay.nodes.gmapping import GmappingReplay
from rosbot_patrol.replay.results.comparison import compare
from rosbot_patrol.replay.results.tables import Result
from rosbot_patrol.replay.runner import Replay, run_replay
from rosbot_patrol.tf.tree import Edge

SECONDS = 8.0
AMCL = AmclParams(
    max_particles=600,
    laser_max_beams=30,
    laser_sigma_hit=0.1,
    update_min_d=0.1,
    update_min_a=0.1,
    resample_interval=1,
    recovery_alpha_slow=0.0,
    recovery_alpha_fast=0.0,
)
SLAM = GmappingParams(particles=4, linearUpdate=0.3, angularUpdate=0.3, xmin=-6.0, ymin=-6.0, xmax=6.0, ymax=6.0)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bag(tmp_path_factory.mktemp("bag") / "drive.bag", drive_messages(SECONDS))


def replayed(path: Path, replay: Replay, **remaps: str) -> Result:
    with Bag(path) as opened:
        return run_replay(opened, replay, remaps=remaps)


def without(*topics: str, seconds: float = 3.0) -> list:
    return [each for each in drive_messages(seconds) if each[1] not in topics]


def test_amcl_follows_the_robot_on_the_map_of_the_bag(bag: Path) -> None:
    result = replayed(bag, AmclReplay(AMCL))
    poses = result.tables["poses"]
    assert len(poses["stamp"]) > 10
    for stamp, x, y, yaw in list(zip(*(poses[name] for name in ("stamp", "x", "y", "yaw")), strict=True))[5:]:
        off = compose(invert(truth_at(stamp, SECONDS)), Pose2D(x, y, yaw))
        assert math.hypot(off.x, off.y) < 0.12
        assert abs(off.yaw) < 0.06
    counts = result.counts
    assert (counts["scans"], counts["dropped"], counts["initial_poses"], counts["maps"]) == (40, 0, 1, 1)
    assert counts["updates"] == counts["resampled"] == len(poses["stamp"])
    health = result.tables["health"]
    assert np.diff(health["stamp"]) == pytest.approx(np.ones(len(health["stamp"]) - 1), abs=0.05)
    assert health["state"][0] == "unknown"
    assert set(health["state"][3:]) == {"localised"}


def test_a_replay_gives_the_same_bit_for_bit(bag: Path) -> None:
    assert replayed(bag, AmclReplay(AMCL)).digest == replayed(bag, AmclReplay(AMCL)).digest
    assert replayed(bag, AmclReplay(AMCL, seed=1)).digest != replayed(bag, AmclReplay(AMCL)).digest
    assert replayed(bag, GmappingReplay(SLAM)).digest == replayed(bag, GmappingReplay(SLAM)).digest


def test_a_bag_of_ros_2_gives_the_same_as_one_of_ros_1(tmp_path: Path) -> None:
    one = write_bag(tmp_path / "one.bag", drive_messages(2.0))
    two = write_bag(tmp_path / "two", drive_messages(2.0, is2=True), is2=True)
    assert replayed(one, AmclReplay(AMCL)).digest == replayed(two, AmclReplay(AMCL)).digest


def test_scans_wait_for_the_odometry_of_their_stamp(tmp_path: Path) -> None:
    messages = without("/initialpose", seconds=4.0)
    late = [(when + 0.5 * (topic == "/tf"), topic, each) for when, topic, each in messages]
    late.sort(key=lambda each: each[0])
    in_time = replayed(write_bag(tmp_path / "a.bag", messages), AmclReplay(AMCL))
    too_late = replayed(write_bag(tmp_path / "b.bag", late), AmclReplay(AMCL))
    assert too_late.counts["dropped"] == 0
    for name, values in in_time.tables["poses"].items():
        np.testing.assert_array_equal(too_late.tables["poses"][name], values)


def test_scans_that_tf_never_places_are_dropped_and_counted(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a.bag", without("/tf_static"))
    counts = replayed(path, AmclReplay(AMCL)).counts
    assert counts["updates"] == 0
    assert counts["dropped"] + counts["waiting"] == counts["scans"] == 15
    mount = Edge("base_link", "laser", 0.0, LASER.x, 0.0, 0.1, 0.0, 0.0, 1.0, 0.0)
    assert replayed(path, AmclReplay(AMCL, static=[mount])).counts["updates"] > 3


def test_a_map_that_is_given_goes_before_that_of_the_bag(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a.bag", without("/map"))
    with pytest.raises(BagError, match=r"no topic '/map' \(nav_msgs/OccupancyGrid\).*or give the map's yaml: --map"):
        replayed(path, AmclReplay(AMCL))
    given = replayed(path, AmclReplay(AMCL, grid=room_map()))
    of_bag = replayed(write_bag(tmp_path / "b.bag", without()), AmclReplay(AMCL))
    assert given.counts["updates"] == of_bag.counts["updates"] > 3
    turned = Grid(GridInfo(resolution=0.1, width=2, height=2, yaw=1.0), np.zeros((2, 2), dtype=np.int8))
    with pytest.raises(MapError):
        AmclReplay(AMCL, grid=turned)


def test_only_the_first_map_counts_but_for_use_map_topic(tmp_path: Path) -> None:
    again = (BEGIN + 1.0, "/map", Maker().map(room_map()))
    path = write_bag(tmp_path / "a.bag", sorted([*without(), again], key=lambda each: each[0]))
    assert replayed(path, AmclReplay(AMCL)).counts["maps"] == 1
    each = AmclParams(use_map_topic=True)
    assert replayed(path, AmclReplay(each)).counts["maps"] == 2
    first = AmclParams(use_map_topic=True, first_map_only=True)
    assert replayed(path, AmclReplay(first)).counts["maps"] == 1


def test_poses_that_cannot_be_taken_are_counted_and_left_out(tmp_path: Path) -> None:
    maker = Maker()
    elsewhere = maker.initial_pose(BEGIN, Pose2D(3.0, 0.0, 0.0))
    elsewhere.header.frame_id = "odom"
    broken = maker.initial_pose(BEGIN, Pose2D(3.0, 0.0, 0.0))
    broken.pose.pose.orientation.w = math.nan
    messages = [
        *without("/initialpose"),
        (BEGIN + 1.0, "/initialpose", elsewhere),
        (BEGIN + 1.01, "/initialpose", broken),
    ]
    counts = replayed(write_bag(tmp_path / "a.bag", sorted(messages, key=lambda m: m[0])), AmclReplay(AMCL)).counts
    assert (counts["initial_poses"], counts["ignored"]) == (0, 2)


def test_a_clicked_pose_counts_with_the_motion_since(tmp_path: Path) -> None:
    truth = truth_at(BEGIN + 1.0, 4.0)
    clicked = (BEGIN + 2.51, "/initialpose", Maker().initial_pose(BEGIN + 1.0, truth, 1e-6))
    messages = sorted([*without("/initialpose", seconds=4.0), clicked], key=lambda each: each[0])
    poses = replayed(write_bag(tmp_path / "a.bag", messages), AmclReplay(AMCL)).tables["poses"]
    after = int(np.flatnonzero(poses["stamp"] > BEGIN + 2.5)[0])
    now = truth_at(float(poses["stamp"][after]), 4.0)
    assert math.hypot(poses["x"][after] - now.x, poses["y"][after] - now.y) < 0.08
    assert math.hypot(now.x - truth.x, now.y - truth.y) > 0.4


def test_topics_of_other_names(tmp_path: Path) -> None:
    messages = [(when, topic.replace("/scan", "/front/scan"), each) for when, topic, each in without()]
    path = write_bag(tmp_path / "a.bag", messages)
    with pytest.raises(BagError, match=r"no topic '/scan' .* there is /front/scan: give scan:=/front/scan"):
        replayed(path, AmclReplay(AMCL))
    assert replayed(path, AmclReplay(AMCL), scan="front/scan").counts["scans"] == 15
    with pytest.raises(BagError, match="topic '/tf' is tf2_msgs/TFMessage, expected sensor_msgs/LaserScan"):
        replayed(path, AmclReplay(AMCL), scan="/tf")
    with pytest.raises(BagError, match="nothing is called 'laser' there"):
        replayed(path, AmclReplay(AMCL), laser="/front/scan")


def test_slam_gmapping_maps_the_room(bag: Path) -> None:
    result = replayed(bag, GmappingReplay(SLAM))
    trajectory, poses, maps = (result.tables[name] for name in ("trajectory", "poses", "maps"))
    assert result.counts["updates"] == len(poses["stamp"]) == len(trajectory["stamp"]) > 8
    begin = Pose2D(*(float(trajectory[name][0]) for name in ("x", "y", "yaw")))
    for stamp, x, y, yaw in zip(*(trajectory[name] for name in ("stamp", "x", "y", "yaw")), strict=True):
        moved = compose(invert(begin), Pose2D(x, y, yaw))
        true = compose(invert(truth_at(trajectory["stamp"][0], SECONDS)), truth_at(stamp, SECONDS))
        assert math.hypot(moved.x - true.x, moved.y - true.y) < 0.08
    grid = result.grids["map"]
    width, height = sorted(grid.info.size)
    assert 4.0 < width < 10.0
    assert 7.0 < height < 10.0
    assert maps["known"][-1] <= np.count_nonzero(grid.cells >= 0)
    assert maps["known"][-1] > 8000
    assert np.diff(maps["stamp"]).min() > SLAM.map_update_interval


def test_every_second_scan_with_throttle_scans(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a.bag", without())
    throttled = GmappingParams(particles=2, throttle_scans=2, xmin=-6.0, ymin=-6.0, xmax=6.0, ymax=6.0)
    assert replayed(path, GmappingReplay(throttled)).counts["scans"] == 8


def test_a_planted_fault_in_amcl_is_caught_and_named(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stored = replayed(bag, AmclReplay(AMCL))
    assert compare(stored, replayed(bag, AmclReplay(AMCL)), amcl_replay.FIELDS) == []

    def turned_wrong(poses: np.ndarray, start: Pose2D, end: Pose2D, *more: object, rng: np.random.Generator) -> None:
        back = end._replace(yaw=start.yaw - 0.5 * (end.yaw - start.yaw))
        move_particles(poses, start, back, *more, rng=rng)

    monkeypatch.setattr(localizer, "move_particles", turned_wrong)
    names = [each.name for each in compare(stored, replayed(bag, AmclReplay(AMCL)), amcl_replay.FIELDS)]
    assert "poses.yaw" in names
