"""Rounds through a corridor that ends where it began."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from mapped_room import scan_at, small

from rosbot_patrol.geometry import Pose2D, compose, compose_poses, invert
from rosbot_patrol.gmapping.back_end.kept_scans import KeptScans
from rosbot_patrol.gmapping.back_end.loop_closer import LoopCloser, aligned
from rosbot_patrol.gmapping.back_end.pose_graph import relative_moves
from rosbot_patrol.gmapping.back_end.visit import Visit
from rosbot_patrol.gmapping.beams import pick_beams
from rosbot_patrol.gmapping.particle_map import ParticleMaps
from rosbot_patrol.gmapping.slam import Slam

# A corridor, 2 m wide, around a block of 12 m x 8 m, with a niche and two pillars that tell its sides apart.
CORNERS = {
    "outer": [(-8, -6), (-1, -6), (-1, -7), (1, -7), (1, -6), (8, -6), (8, 6), (-8, 6)],
    "inner": [(-6, -4), (6, -4), (6, 4), (-6, 4)],
    "pillar": [(7.4, 1), (8, 1), (8, 1.6), (7.4, 1.6)],
    "other pillar": [(-3, 5.5), (-2, 5.5), (-2, 6), (-3, 6)],
}
RING = np.array(
    [(*a, *b) for corners in CORNERS.values() for a, b in itertools.pairwise([*corners, corners[0]])], dtype=np.float64
)
PARAMS = small()
STEP = 0.4  # [m]


def rounds(length: float) -> list[Pose2D]:
    """A way through the middle of the corridor, with round corners."""
    poses = [Pose2D(-5.0, -5.0, 0.0)]
    corners = itertools.cycle([(7.0, -5.0), (7.0, 5.0), (-7.0, 5.0), (-7.0, -5.0)])
    corner = next(corners)
    while STEP * len(poses) < length:
        x, y, yaw = poses[-1]
        if math.hypot(corner[0] - x, corner[1] - y) < 1.0:
            corner = next(corners)
        turn = math.remainder(math.atan2(corner[1] - y, corner[0] - x) - yaw, 2.0 * math.pi)
        yaw += min(max(turn, -0.4), 0.4)
        poses.append(Pose2D(x + STEP * math.cos(yaw), y + STEP * math.sin(yaw), yaw))
    return poses


def drifted(way: list[Pose2D], error: Pose2D) -> np.ndarray:
    """The way, with an error in each step, shape (N, 3)."""
    poses = [way[0]]
    for before, after in itertools.pairwise(way):
        poses.append(compose(compose(poses[-1], compose(invert(before), after)), error))
    return np.array(poses)


def beams_at(pose: Pose2D):
    return pick_beams(scan_at(pose, walls=RING, range_max=6.0), Pose2D(), PARAMS)


def worst(poses: np.ndarray, way: list[Pose2D]) -> float:
    """Largest error of a relation between two visits of a place [m]."""
    truth = np.array(way)
    gaps = np.hypot(*(truth[:, None, :2] - truth[None, :, :2]).transpose(2, 0, 1))
    first, second = np.nonzero(np.triu(gaps < 1.0, 60))
    moves = [relative_moves(rows, first, second) for rows in (poses, truth)]
    return float(np.hypot(*(moves[0] - moves[1])[:, :2].T).max())


@pytest.mark.parametrize("error", [Pose2D(0.0, 0.0, 0.002), Pose2D(0.01, 0.0, -0.0015)])
def test_a_second_round_lies_on_the_first(error: Pose2D) -> None:
    way = rounds(62.0)
    steps, closer = drifted(way, error), LoopCloser(0.05)
    poses = steps[:1]
    for i, pose in enumerate(way):
        if i:
            last = compose(Pose2D(*poses[-1]), Pose2D(*relative_moves(steps, np.array([i - 1]), np.array([i]))[0]))
            poses = np.vstack((poses, last))
        better = closer.add(poses, beams_at(pose))
        poses = poses if better is None else better
    assert worst(steps, way) > 0.8
    assert worst(poses, way) < 0.15  # far apart along the corridor, hardly anything tells where it is
    assert len(closer.loops.first) > 10


def test_the_map_is_drawn_anew_where_a_loop_closes() -> None:
    way = rounds(56.0)
    slam = Slam(small(loop_closure=True, particles=2, linearUpdate=0.3, angularUpdate=0.3))
    for i, (pose, odometry) in enumerate(zip(way, drifted(way, Pose2D(0.01, 0.0, 0.01)), strict=True)):
        slam.update(scan_at(pose, stamp=0.5 * i, walls=RING, range_max=6.0), Pose2D(*odometry), Pose2D())
    assert slam.trajectory.shape == (len(way), 3)
    assert worst(slam.trajectory, way) < 0.1


def test_a_map_drawn_anew_is_the_one_that_was_written() -> None:
    poses = np.array([Pose2D(-5.0, -5.0, 0.0), Pose2D(-4.0, -5.0, 0.1)])
    scans = [beams_at(Pose2D(*pose)) for pose in poses]
    written = ParticleMaps((-8.0, -8.0), (8.0, 8.0), 0.05, 3)
    for pose, beams in zip(poses, scans, strict=True):
        written.register(np.tile(pose, (3, 1)), beams)
    before = written.grid(1, 0.25).cells
    written.register(np.tile(poses[0] + (3.0, 2.0, 1.0), (3, 1)), scans[0])
    assert np.any(written.grid(1, 0.25).cells != before)
    written.draw_anew(poses, scans)
    assert [np.array_equal(written.grid(index, 0.25).cells, before) for index in range(3)] == [True] * 3


def test_scans_are_kept_as_they_were() -> None:
    kept, beams = KeptScans(), beams_at(Pose2D(-5.0, -5.0, 0.3))
    kept.add(beams)
    (again,) = kept
    assert again.ends == pytest.approx(beams.ends, abs=1e-6)
    assert again.directions == pytest.approx(beams.directions, abs=1e-6)
    assert again.hits[:, 4:] == pytest.approx(beams.hits[:, 4:], abs=1e-3)


def test_what_a_visit_did_not_see_is_not_found_in_it() -> None:
    kept, poses = KeptScans(), np.array([(-5.0, -5.0, 0.0), (-4.8, -5.1, 0.1), (5.0, 5.0, 2.0)])
    for pose in poses:
        kept.add(beams_at(Pose2D(*pose)))
    visit, near, elsewhere = (Visit(kept, poses, range(i, i + 1), i, 0.05) for i in range(3))
    found = visit.find(near, Pose2D(0.4, 0.1, 0.05), 0.5, 0.1)
    assert found is not None
    assert found.pose == pytest.approx((0.2, -0.1, 0.1), abs=0.015)
    assert np.linalg.eigvalsh(found.covariance).min() > 0.0
    assert visit.find(elsewhere, Pose2D(), 0.5, 0.1) is None
    for far in (Pose2D(60.0, 50.0, 0.0), Pose2D(-60.0, -50.0, 0.0)):
        assert visit.find(near, far, 0.5, 0.1) is None


def test_a_solution_is_laid_onto_the_poses_as_they_were() -> None:
    poses = np.array(rounds(20.0))
    moved = compose_poses(Pose2D(3.0, -2.0, 0.5), poses)
    assert aligned(moved, poses)[:, :2] == pytest.approx(poses[:, :2])
    assert np.cos(aligned(moved, poses)[:, 2] - poses[:, 2]) == pytest.approx(1.0)
