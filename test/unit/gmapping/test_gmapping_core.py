"""What slam_gmapping's node does with scans, without ROS."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mapped_room import scan_at, small

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.gmapping.core import GmappingCore, Step
from rosbot_patrol.maps.map_io import write_map
from rosbot_patrol.tf.tree import Edge, TransformTree

AT_LASER = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


class Run:
    """A core with the tf of a straight drive."""

    def __init__(self, **changes: object) -> None:
        self.frames = TransformTree(cache_s=1e3)
        self.frames.add(Edge("base_link", "laser", 0.0, *AT_LASER), is_static=True)
        self.core = GmappingCore(small(**changes), self.frames)

    def see(self, stamp: float, *, is_blind: bool = False) -> list[Step]:
        x = 0.1 * stamp
        self.frames.add(Edge("odom", "base_link", stamp, x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
        if not self.core.is_wanted():
            return []
        scan = scan_at(Pose2D(x), stamp=stamp)
        ranges = np.full(len(scan.ranges), np.inf) if is_blind else scan.ranges
        self.core.feed.hear(replace(scan, ranges=ranges), stamp)
        return [self.core.step(placed) for placed in self.core.feed.placed(stamp)]


def test_a_map_comes_at_once_and_then_every_interval() -> None:
    run = Run(map_update_interval=2.5)
    steps = [step for i in range(1, 9) for step in run.see(float(i))]
    assert all(step.outcome.updated for step in steps)
    assert [step.stamp for step in steps if step.grid is not None] == [1.0, 4.0, 7.0]
    assert steps[0].grid is not None
    assert (steps[0].grid.cells == 100).any()


def test_only_every_nth_scan_is_taken_in() -> None:
    run = Run(throttle_scans=3)
    assert [len(run.see(float(i))) for i in range(1, 8)] == [1, 0, 0, 1, 0, 0, 1]
    assert run.core.feed.heard == 3


def test_scans_without_an_echo_are_told_until_they_are_well(caplog: pytest.LogCaptureFixture) -> None:
    run = Run()
    run.see(1.0)
    assert run.core.problem == ""
    for i in (2.0, 3.0):
        run.see(i, is_blind=True)
        assert "no beam of the scan of frame 'laser' measured anything" in run.core.problem
    assert caplog.text.count("no beam of the scan") == 1
    run.see(4.0)
    assert run.core.problem == ""


@pytest.mark.parametrize(
    ("start", "is_strange"),
    [((0.1, 0.0, 0.0), False), ((0.3, 0.2, 0.15), False), ((0.1, 0.0, 1.5), True), ((2.5, 1.0, 0.0), True)],
)
def test_a_saved_map_that_does_not_fit_is_told_at_the_first_scan(
    tmp_path: Path, start: tuple[float, float, float], is_strange: bool, caplog: pytest.LogCaptureFixture
) -> None:
    first = Run()
    for i in range(1, 9):
        first.see(float(i))
    write_map(str(tmp_path / "room"), first.core.slam.grid())
    x, y, yaw = start
    again = Run(map_file=str(tmp_path / "room.yaml"), initial_pose_x=x, initial_pose_y=y, initial_pose_a=yaw)
    again.see(1.0)
    told = "is it a map of this place, and initial_pose_x, _y and _a where the robot is on it?"
    assert (told in caplog.text) == (told in again.core.problem) == is_strange
    again.see(2.0)
    assert (told in again.core.problem) == is_strange
