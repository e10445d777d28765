"""What amcl's node does with scans and given poses, without ROS."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from house_run import MOUNT, START, Moment, drive, error, house_map

from rosbot_patrol.amcl.core import AmclCore, Step
from rosbot_patrol.amcl.initial_pose import PoseRecord
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.geometry import Pose2D, quaternion_from_yaw
from rosbot_patrol.tf.tree import Edge, TransformTree

WAY = [(-0.6, 2.5)]
PARAMS = AmclParams(odom_model_type="diff-corrected", update_min_d=0.1, update_min_a=0.1, resample_interval=1)


class Run:
    """A core with the tf of a drive."""

    def __init__(self, params: AmclParams = PARAMS) -> None:
        self.frames = TransformTree(cache_s=1e3)
        self.add("base_link", "laser", 0.0, MOUNT, is_static=True)
        self.core = AmclCore(params, self.frames, np.random.default_rng(0))
        self.core.hear_map(house_map())

    def add(self, parent: str, child: str, stamp: float, pose: Pose2D, *, is_static: bool = False) -> None:
        edge = Edge(parent, child, stamp, pose.x, pose.y, 0.0, *quaternion_from_yaw(pose.yaw))
        self.frames.add(edge, is_static=is_static)

    def see(self, moment: Moment) -> list[Step]:
        stamp = moment.scan.stamp
        self.add("odom", "base_link", stamp, moment.odometry)
        assert self.core.feed.hear(moment.scan, stamp)
        return [self.core.step(placed) for placed in self.core.feed.placed(stamp)]


def moments() -> Iterator[Moment]:
    return drive(WAY)


def given(pose: Pose2D, frame: str = "map", stamp: float = 0.0) -> PoseRecord:
    return PoseRecord(frame, stamp, pose, np.diag([0.04, 0.04, 0.0, 0.0, 0.0, 0.02]))


def test_it_follows_the_robot_and_tells_each_correction() -> None:
    run = Run()
    for moment in moments():
        (step,) = run.see(moment)
        assert step.map_from_odom is not None
        assert run.core.pose is not None
        off = error(run.core.pose, moment.truth)
        assert off[0] < 0.3
        assert math.degrees(off[1]) < 15.0
    fix = run.core.fix()
    assert fix is not None
    assert (fix.pose, fix.stamp) == (run.core.pose, moment.scan.stamp)
    assert fix.odom_from_base == pytest.approx(moment.odometry)


def test_a_late_scan_tells_no_correction_and_moves_nothing() -> None:
    run, seen = Run(), list(moments())[:5]
    for moment in (seen[0], seen[1], seen[3]):
        run.see(moment)
    before = run.core.fix()
    (step,) = run.see(seen[2])
    assert step.outcome.is_late
    assert (step.map_from_odom, run.core.late) == (None, 1)
    assert run.core.fix() == before


def test_a_pose_in_another_frame_is_ignored(caplog: pytest.LogCaptureFixture) -> None:
    run = Run()
    assert not run.core.hear_initial_pose(given(Pose2D(1.0, 0.0), frame="odom"), 0.0)
    assert "it is in frame 'odom', expected 'map'" in caplog.text
    assert run.core.hear_initial_pose(given(START), 0.0)


def test_a_saved_pose_counts_only_if_none_was_given() -> None:
    elsewhere = replace(PARAMS, initial_pose_x=5.0, initial_pose_y=9.0)
    first = next(moments())
    for is_given in (True, False):
        run = Run()
        if is_given:
            run.core.hear_initial_pose(given(START), 0.0)
        run.core.resume(elsewhere, None)
        run.see(first)
        assert run.core.pose is not None
        assert (error(run.core.pose, START)[0] < 1.0) == is_given


def test_without_a_map_there_is_nothing_to_search_on() -> None:
    core = AmclCore(PARAMS, TransformTree(), np.random.default_rng(0))
    assert not core.localizer.has_map
    assert not core.seek()
    assert not core.localize_globally()
    assert core.fix() is None
