from __future__ import annotations

import math

import numpy as np
import pytest
from floors import DESK, TWO_ROOMS, drawn_floor, points

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.house.floor import Floor
from rosbot_patrol.patrol.house.regions import part_rooms
from rosbot_patrol.patrol.visibility.coverage import Coverage, CoverageParams, Eye, Sight, sight_of_scan, sight_on_map
from rosbot_patrol.scan import LaserScan

WIDTH = 1.047
FLOOR = drawn_floor(*TWO_ROOMS)
ROOMS = part_rooms(FLOOR, points((1.5, 2.0), (8.0, 2.0)))
ONCE = CoverageParams(seen_in=1)


def a_scan(ranges: list[float] | np.ndarray, *, first: float = -math.pi) -> LaserScan:
    lengths = np.asarray(ranges, np.float64)
    return LaserScan(
        stamp=0.0,
        frame_id="laser",
        angle_min=first,
        angle_increment=math.tau / len(lengths),
        range_min=0.2,
        range_max=12.0,
        ranges=lengths,
    )


def turn_at(coverage: Coverage, x: float, y: float, sight: Sight | None = None, pictures: int = 84) -> None:
    sight = sight or sight_on_map(FLOOR, x, y, 8.0)
    for k in range(pictures):
        coverage.look(Eye(pose=Pose2D(x, y, math.tau * k / pictures), width=WIDTH), sight)


def test_sight_on_the_map_ends_at_its_walls() -> None:
    sight = sight_on_map(FLOOR, 2.0, 2.0, 8.0)
    lengths = {deg: sight.lengths[round(math.radians(deg) / sight.step)] for deg in (0, 90, 180)}
    assert lengths[90] == pytest.approx(2.0, abs=0.11)
    assert lengths[180] == pytest.approx(1.5, abs=0.11)
    assert lengths[0] == pytest.approx(7.0, abs=0.11)  # through the door


def test_a_turn_in_the_middle_of_a_room_sees_all_of_it() -> None:
    coverage = Coverage(FLOOR, ROOMS.mask(0))
    assert coverage.share == 0.0
    turn_at(coverage, 2.0, 2.0)
    assert coverage.share > 0.99
    assert not coverage.unseen().any()
    assert coverage.area == pytest.approx(14.25, abs=0.3)


def test_a_look_ahead_sees_what_the_picture_holds() -> None:
    coverage = Coverage(FLOOR, ROOMS.mask(0), CoverageParams(seen_in=1, view_near=0.0, view_edge=0.0))
    coverage.look(Eye(pose=Pose2D(0.6, 2.0, 0.0), width=WIDTH), sight_on_map(FLOOR, 0.6, 2.0, 8.0))
    iy, ix = np.nonzero(coverage.seen())
    xs, ys = FLOOR.centres(ix, iy)
    assert np.abs(np.arctan2(ys - 2.0, xs - 0.6)).max() <= WIDTH / 2
    inside = [(x, y) for x, y in zip(*FLOOR.centres(*np.nonzero(ROOMS.mask(0))[::-1]), strict=True) if x > 0.6]
    expected = sum(abs(math.atan2(y - 2.0, x - 0.6)) <= WIDTH / 2 for x, y in inside)
    assert len(ix) == pytest.approx(expected, rel=0.03)


def test_a_place_counts_once_enough_pictures_had_it_in_view() -> None:
    coverage = Coverage(FLOOR, ROOMS.mask(0), CoverageParams(seen_in=3))
    eye, sight = Eye(pose=Pose2D(0.6, 2.0, 0.0), width=WIDTH), sight_on_map(FLOOR, 0.6, 2.0, 8.0)
    shares = []
    for _ in range(4):
        coverage.look(eye, sight)
        shares.append(coverage.share)
    assert shares[:2] == [0.0, 0.0]
    assert shares[2] == shares[3] > 0.4


def test_what_was_seen_before_a_time_can_be_forgotten() -> None:
    coverage = Coverage(FLOOR, ROOMS.mask(0), ONCE)
    sight = sight_on_map(FLOOR, 1.5, 2.0, 8.0)
    coverage.look(Eye(pose=Pose2D(1.5, 2.0, 0.0), width=WIDTH), sight, 10.0)
    first = coverage.share
    coverage.look(Eye(pose=Pose2D(1.5, 2.0, math.pi), width=WIDTH), sight, 20.0)
    both = coverage.share
    coverage.forget(15.0)
    assert coverage.share == pytest.approx(both - first, abs=0.02)
    coverage.forget(30.0)
    assert coverage.share == 0.0
    coverage.look(Eye(pose=Pose2D(1.5, 2.0, 0.0), width=WIDTH), sight, 40.0)
    assert coverage.share == first


def test_beyond_the_detectors_range_nothing_is_seen() -> None:
    coverage = Coverage(FLOOR, ROOMS.mask(0), CoverageParams(seen_in=1, view_range=1.0, view_near=0.2))
    turn_at(coverage, 2.0, 2.0)
    assert coverage.share == pytest.approx(math.pi / coverage.area, rel=0.05)


def test_behind_what_the_lidar_hits_nothing_is_seen() -> None:
    lengths = np.full(720, np.inf)
    lengths[300:420] = 1.0  # something stands ahead, 60 degrees wide
    coverage = Coverage(FLOOR, ROOMS.mask(0), ONCE)
    sight = sight_of_scan(a_scan(lengths), Pose2D(1.0, 2.0, 0.0), FLOOR, 8.0)
    turn_at(coverage, 1.0, 2.0, sight)
    unseen = coverage.unseen()
    assert unseen[FLOOR.info.cell_of(3.0, 2.0)[::-1]]
    assert not unseen[FLOOR.info.cell_of(1.8, 2.0)[::-1]]
    assert not unseen[FLOOR.info.cell_of(1.0, 3.5)[::-1]]


def test_a_beam_without_an_answer_ends_at_the_maps_wall() -> None:
    sight = sight_of_scan(a_scan(np.full(720, np.inf)), Pose2D(2.0, 2.0, 0.3), FLOOR, 8.0)
    bearings = np.array([math.pi / 2, math.pi])
    assert sight.reaches(bearings, np.array([1.85, 1.35])).all()
    assert not sight.reaches(bearings, np.array([2.3, 1.9])).any()


def test_a_scan_may_run_clockwise_and_upside_down() -> None:
    clockwise = LaserScan(
        stamp=0.0,
        frame_id="laser",
        angle_min=math.pi,
        angle_increment=-math.tau / 360,
        range_min=0.1,
        range_max=12.0,
        ranges=np.where(np.arange(360) < 90, 1.0, 0.5),  # 1 m from ahead of the back to the left side
    )
    sight = sight_of_scan(clockwise, Pose2D(2.0, 2.0, 0.0), FLOOR, 8.0)
    assert sight.reaches(np.array([math.radians(135.0)]), np.array([0.9]))[0]
    assert not sight.reaches(np.array([math.radians(-135.0)]), np.array([0.9]))[0]


def test_where_no_beam_looks_nothing_is_seen() -> None:
    front = LaserScan(
        stamp=0.0,
        frame_id="laser",
        angle_min=-1.0,
        angle_increment=0.01,
        range_min=0.1,
        range_max=12.0,
        ranges=np.full(201, 5.0),
    )
    sight = sight_of_scan(front, Pose2D(2.0, 2.0, 0.0), FLOOR, 8.0)
    assert not sight.reaches(np.array([math.pi]), np.array([0.5]))[0]
    assert sight.reaches(np.array([0.9]), np.array([0.5]))[0]


def test_floor_on_which_something_stands_is_no_floor() -> None:
    coverage = Coverage(FLOOR, ROOMS.mask(0), ONCE)
    coverage.stands(np.array([[3.05, 3.05], [3.15, 3.05], [99.0, 0.0]]))
    turn_at(coverage, 2.0, 2.0, pictures=1)
    before = coverage.share
    assert not coverage.unseen()[FLOOR.info.cell_of(3.05, 3.05)[::-1]]
    assert 0.0 < before < 1.0


def test_nothing_is_seen_of_a_room_without_floor() -> None:
    empty: Floor = FLOOR
    coverage = Coverage(empty, np.zeros(empty.info.shape, bool))
    coverage.look(Eye(pose=Pose2D(1.0, 1.0, 0.0), width=WIDTH), sight_on_map(empty, 1.0, 1.0, 8.0))
    assert coverage.share == 0.0


def test_what_the_mapping_drive_passed_by_is_yet_to_be_seen() -> None:
    floor = drawn_floor(*DESK)
    room = part_rooms(floor, points((3.0, 1.0))).mask(0)
    coverage = Coverage(floor, room, ONCE)
    turn_at(coverage, 3.0, 1.0, sight_on_map(floor, 3.0, 1.0, 8.0))
    assert (coverage.unseen() & floor.unmapped).sum() > 0.9 * floor.unmapped.sum()
    turn_at(coverage, 1.0, 2.25, sight_on_map(floor, 1.0, 2.25, 8.0))
    assert not (coverage.unseen() & floor.unmapped).any()


def left_unmapped(stands_at: float) -> tuple[float, bool]:
    """Share of unmapped floor to be seen after a look along it, with something upright in the way, x [m]."""
    floor = drawn_floor(*DESK)
    coverage = Coverage(floor, part_rooms(floor, points((3.0, 1.0))).mask(0), ONCE)
    by_map = sight_on_map(floor, 1.0, 2.25, 8.0)
    lengths = np.roll(by_map.lengths, len(by_map.lengths) // 2)
    bearings = math.tau / len(lengths) * np.arange(len(lengths)) - math.pi
    ahead = np.cos(bearings) > 0.3
    lengths[ahead] = np.minimum(lengths[ahead], (stands_at - 1.0) / np.cos(bearings[ahead]))
    turn_at(coverage, 1.0, 2.25, sight_of_scan(a_scan(lengths), Pose2D(1.0, 2.25, 0.0), floor, 8.0))
    unseen = coverage.unseen()
    return float((unseen & floor.unmapped).sum() / floor.unmapped.sum()), bool((unseen & ~floor.unmapped).any())


@pytest.mark.parametrize("stands_at", [2.44, 2.47, 2.5, 2.53, 3.0])  # the unmapped floor begins at 2.5
def test_unmapped_floor_ends_at_what_the_lidar_shows_there(stands_at: float) -> None:
    left, mapped_left = left_unmapped(stands_at)
    assert left < 0.05
    assert mapped_left  # the floor beyond is mapped, and yet to be seen


def test_what_stands_before_unmapped_floor_is_not_its_end() -> None:
    assert left_unmapped(1.9)[0] > 0.95
