"""The whole of slam_gmapping without ROS, on drives through a made-up room."""

from __future__ import annotations

import itertools
import logging
import math
from dataclasses import replace

import numpy as np
import pytest
from mapped_room import ROOM, scan_at, small

from rosbot_patrol.geometry import Pose2D, Transform, compose, invert
from rosbot_patrol.gmapping.slam import Slam
from rosbot_patrol.gmapping.trajectories import Trajectories
from rosbot_patrol.scan import level_scan

WAY = [Pose2D(0.1 * i, 0.3 * math.sin(0.2 * i), 0.06 * math.cos(0.2 * i)) for i in range(20)]
SLIP = Pose2D(0.004, -0.003, 0.01)  # what each move of the odometry is off
BACKWARDS, PITCHED_OVER = (0.0, 0.0, 1.0, 0.0), (0.0, 1.0, 0.0, 0.0)


def odometry_of(way: list[Pose2D], slip: Pose2D = SLIP) -> list[Pose2D]:
    rows = [way[0]]
    for before, after in itertools.pairwise(way):
        rows.append(compose(compose(rows[-1], compose(invert(before), after)), slip))
    return rows


def driven(slam: Slam, way: list[Pose2D] = WAY, *, mount: Transform | None = None, beams: int = 180) -> np.ndarray:
    """Errors in place and heading at each scan, shape (N, 2)."""
    mount, rows = mount or Transform(), []
    for i, (pose, odometry) in enumerate(zip(way, odometry_of(way), strict=True)):
        level = level_scan(scan_at(pose, stamp=0.1 * i, beams=beams, mount=mount), mount, "base_link")
        slam.update(level.scan, odometry, level.pose)
        assert slam.map_from_odom is not None
        found = compose(slam.map_from_odom, odometry)
        rows.append((math.hypot(found.x - pose.x, found.y - pose.y), abs(found.yaw - pose.yaw)))
    return np.array(rows)


def test_a_drive_is_followed_better_than_by_the_wheels() -> None:
    slam = Slam(small())
    errors = driven(slam)
    assert errors[:, 0].max() < 0.04
    assert errors[:, 1].max() < math.radians(1.0)
    last = odometry_of(WAY)[-1]
    assert math.hypot(last.x - WAY[-1].x, last.y - WAY[-1].y) > 0.15


@pytest.mark.parametrize("seed", range(3))
def test_a_good_lidar_is_followed_as_exactly_as_it_measures(seed: int) -> None:
    errors = driven(Slam(small(seed=seed)), beams=720)
    assert np.median(errors[:, 0]) < 0.012  # a quarter of a cell
    assert np.median(errors[:, 1]) < math.radians(0.2)
    assert errors[:, 0].max() < 0.03
    assert errors[:, 1].max() < math.radians(1.0)


def test_the_map_has_the_rooms_walls() -> None:
    slam = Slam(small())
    driven(slam, beams=720)
    grid = slam.grid()
    steps = np.linspace(0.02, 0.98, 60)
    on_walls = np.concatenate([w[:2] + steps[:, None] * (w[2:] - w[:2]) for w in ROOM[[0, 1, 4]]])
    near = [max(grid.at(x + dx, y + dy) for dx in (-0.05, 0.0, 0.05) for dy in (-0.05, 0.0, 0.05)) for x, y in on_walls]
    assert np.mean(np.array(near) == 100) > 0.97
    assert grid.at(0.5, 0.5) == 0
    assert grid.at(6.0, 6.0) == -1


@pytest.mark.parametrize(
    "mount",
    [
        Transform(0.05, 0.0, 0.2, *BACKWARDS),
        Transform(0.1, -0.02, 0.2, math.cos(0.2), math.sin(0.2), 0.0, 0.0),  # roll pi, then yaw 0.4
        Transform(-0.1, 0.0, 0.2, *PITCHED_OVER),
    ],
)
def test_lasers_may_hang_upside_down_and_look_backwards(mount: Transform) -> None:
    errors = driven(Slam(small()), WAY[:10], mount=mount)
    assert errors[:, 0].max() < 0.03
    assert errors[:, 1].max() < math.radians(1.5)


def test_the_same_inputs_and_seed_give_the_same_result_bit_for_bit() -> None:
    first, second, other = Slam(small(seed=3)), Slam(small(seed=3)), Slam(small(seed=4))
    for slam in (first, second, other):
        driven(slam, WAY[:12])
    assert (first.poses == second.poses).all()
    assert (first.trajectory == second.trajectory).all()
    assert (first.grid().cells == second.grid().cells).all()
    assert first.entropy == second.entropy
    assert (first.poses != other.poses).any()


def test_an_update_waits_for_a_way_a_turn_or_a_time() -> None:
    slam = Slam(small(linearUpdate=0.2, angularUpdate=0.3, temporalUpdate=1.0))

    def updated(pose: Pose2D, stamp: float) -> bool:
        return slam.update(scan_at(pose, stamp=stamp), pose, Pose2D()).updated

    assert updated(Pose2D(), 0.0)
    assert not updated(Pose2D(0.15, 0.0, 0.0), 0.1)
    assert updated(Pose2D(0.05, 0.0, 0.0), 0.2)  # there and back is a way, too
    assert not updated(Pose2D(0.05, 0.0, 0.2), 0.3)
    assert updated(Pose2D(0.05, 0.0, 0.35), 0.4)
    assert not updated(Pose2D(0.05, 0.0, 0.35), 1.3)
    assert updated(Pose2D(0.05, 0.0, 0.35), 1.5)
    assert len(slam.trajectory) == len(slam.stamps) == 4


def test_the_map_begins_where_the_odometry_is() -> None:
    slam = Slam(small())
    start = Pose2D(2.0, 1.0, 0.5)
    slam.update(scan_at(start), start, Pose2D())
    assert slam.map_from_odom == pytest.approx((0.0, 0.0, 0.0))


def test_a_scan_that_sees_nothing_leaves_the_map_alone() -> None:
    slam = Slam(small())
    empty = replace(scan_at(Pose2D()), ranges=np.full(180, np.inf))
    assert slam.update(empty, Pose2D(), Pose2D()).is_blind
    assert slam.map_from_odom is None
    driven(slam, WAY[:3])
    before = slam.grid().cells
    blind = slam.update(replace(empty, stamp=1.0), compose(WAY[2], Pose2D(0.5, 0.0, 0.0)), Pose2D())
    assert blind.updated
    assert blind.is_blind
    assert (slam.grid().cells == before).all()
    assert abs(slam.poses[:, 0].mean() - WAY[2].x - 0.5) < 0.1


def test_another_number_of_beams_is_no_matter() -> None:
    slam = Slam(small())
    driven(slam, WAY[:5])
    for i, (pose, odometry) in enumerate(zip(WAY[5:10], odometry_of(WAY)[5:10], strict=True)):
        slam.update(scan_at(pose, stamp=1.0 + i, beams=100 + 60 * i), odometry, Pose2D())
    assert math.hypot(slam.poses[0, 0] - WAY[9].x, slam.poses[0, 1] - WAY[9].y) < 0.03


@pytest.mark.parametrize(
    ("stamp", "odometry", "said"),
    [(-50.0, Pose2D(), "time went back"), (2.1, Pose2D(7.0, 7.0, 1.0), "the odometry jumped")],
)
def test_a_restart_of_time_or_wheels_is_no_motion(
    stamp: float, odometry: Pose2D, said: str, caplog: pytest.LogCaptureFixture
) -> None:
    slam = Slam(small())
    driven(slam)
    with caplog.at_level(logging.WARNING):
        slam.update(scan_at(WAY[-1], stamp=stamp), odometry, Pose2D())
    assert said in caplog.text
    assert slam.map_from_odom is not None
    at = compose(slam.map_from_odom, odometry)
    assert math.hypot(at.x - WAY[-1].x, at.y - WAY[-1].y) < 0.05
    found = compose(slam.map_from_odom, odometry)
    assert math.hypot(found.x - WAY[-1].x, found.y - WAY[-1].y) < 0.03
    ahead = compose(odometry, Pose2D(0.1, 0.0, 0.0))
    slam.update(scan_at(compose(WAY[-1], Pose2D(0.1, 0.0, 0.0)), stamp=stamp + 0.1), ahead, Pose2D())
    assert abs(slam.poses[0, 0] - WAY[-1].x - 0.1) < 0.03


def test_scans_out_of_order_are_followed(caplog: pytest.LogCaptureFixture) -> None:
    slam = Slam(small())
    driven(slam, WAY[:5])
    with caplog.at_level(logging.WARNING):
        slam.update(scan_at(WAY[6], stamp=0.35), odometry_of(WAY)[6], Pose2D())
    assert not caplog.records
    assert abs(slam.poses[0, 0] - WAY[6].x) < 0.03


def test_without_times_every_step_counts(caplog: pytest.LogCaptureFixture) -> None:
    slam = Slam(small())
    steps = [Pose2D(1.5 * (i % 2), 0.1 * i, 0.0) for i in range(8)]
    for pose in steps:
        slam.update(scan_at(pose), pose, Pose2D())
    assert not caplog.records
    assert slam.trajectory == pytest.approx(np.array(steps), abs=0.03)
    slam.update(scan_at(steps[-1]), Pose2D(30.0, 0.0, 0.0), Pose2D())
    assert "the odometry jumped by 28" in caplog.text


@pytest.mark.parametrize("slip", [Pose2D(0.0, 0.0, 0.4), Pose2D(0.0, 0.0, -0.45), Pose2D(0.4, -0.3, 0.2)])
def test_a_slip_of_the_wheels_is_found(slip: Pose2D) -> None:
    slam = Slam(small())
    driven(slam)
    slipped = compose(compose(odometry_of(WAY)[-1], Pose2D(0.1)), slip)
    now = compose(WAY[-1], Pose2D(0.1))
    slam.update(scan_at(now, stamp=3.0), slipped, Pose2D())
    found = slam.trajectory[-1]
    assert math.hypot(found[0] - now.x, found[1] - now.y) < 0.05
    assert abs(found[2] - now.yaw) < math.radians(1.0)


def test_weights_entropy_and_resampling() -> None:
    slam = Slam(small(particles=30, ogain=0.5))
    driven(slam, WAY[:1])
    assert slam.entropy == pytest.approx(math.log(30))
    outcomes = []
    for i, (pose, odometry) in enumerate(zip(WAY[1:12], odometry_of(WAY)[1:12], strict=True)):
        outcomes.append(slam.update(scan_at(pose, stamp=0.1 * i), odometry, Pose2D()))
        assert slam.weights.sum() == pytest.approx(1.0)
        assert outcomes[-1].resampled == (outcomes[-1].effective < 15.0)
        assert slam.entropy <= math.log(30) + 1e-9
    assert any(o.resampled for o in outcomes)


def test_a_saved_map_is_gone_on_with_from_a_start() -> None:
    first = Slam(small())
    driven(first)
    saved = first.grid()
    start = Pose2D(WAY[8].x + 0.12, WAY[8].y - 0.1, WAY[8].yaw + 0.05)
    again = Slam(small(), saved=saved, start=start)
    again.update(scan_at(WAY[8]), Pose2D(), Pose2D())
    assert again.map_from_odom is not None
    assert math.hypot(again.map_from_odom.x - WAY[8].x, again.map_from_odom.y - WAY[8].y) < 0.04
    now = again.grid()  # of another size
    walls = [saved.info.centre_of(ix, iy) for iy, ix in zip(*np.nonzero(saved.cells == 100), strict=True)]
    assert len(walls) > 100
    assert sum(now.at(x, y) == 100 for x, y in walls) > 0.9 * len(walls)


def test_a_long_past_is_kept_once() -> None:
    made, rng, rows = Trajectories(), np.random.default_rng(1), []
    for _ in range(600):
        poses = rng.standard_normal((4, 3))
        parents = rng.integers(0, 4, 4)
        rows.append((poses, parents))
        made.add(poses, parents)
    assert len(made._poses) < 300
    for index in range(4):
        wanted, at = [], index
        for poses, parents in reversed(rows):
            wanted.append(poses[at])
            at = parents[at]
        assert (made.of(index) == np.array(wanted[::-1])).all()


def test_what_moved_since_the_saved_map_is_forgotten_and_drawn_where_it_is() -> None:
    box, walls = ROOM[-4:], ROOM[:-4]
    first = Slam(small())
    driven(first)
    saved = first.grid()
    moved = np.vstack((walls, box + np.array([4.5, 0.5, 4.5, 0.5])))
    slam = Slam(small(), saved=saved, start=WAY[0])
    for i, (pose, odometry) in enumerate(zip(WAY, odometry_of(WAY), strict=True)):
        slam.update(scan_at(pose, stamp=0.1 * i, beams=360, walls=moved), odometry, Pose2D())
    occupied = slam.grid().cells == 100

    def share(lines: np.ndarray) -> float:
        """Share of points on walls with an occupied cell at most one cell away."""
        shares = np.linspace(0.0, 1.0, 60)[:, None, None]
        points = (lines[None, :, :2] * (1.0 - shares) + lines[None, :, 2:] * shares).reshape(-1, 2)
        cells = [slam.grid().info.cell_of(x, y) for x, y in points]
        return float(np.mean([occupied[iy - 1 : iy + 2, ix - 1 : ix + 2].any() for ix, iy in cells]))

    seen = [box[1], box[2]]  # the sides that the robot saw: the right one and the upper one
    assert share(np.array(seen)) < 0.1
    assert share(moved[-4:][[2, 3]]) > 0.9
    assert share(walls) > 0.9
