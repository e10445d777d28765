from __future__ import annotations

import math

import numpy as np
import pytest
from floors import TWO_ROOMS, drawn_floor, points

from rosbot_patrol.geometry import Pose2D, wrap_angle
from rosbot_patrol.patrol.house.regions import part_rooms
from rosbot_patrol.patrol.visibility.coverage import Coverage, CoverageParams, Eye, sight_on_map
from rosbot_patrol.patrol.visibility.viewpoints import ViewpointParams, ViewpointPlanner

WIDTH = 1.047
L_ROOM = (
    "##############",
    "#....#########",
    "#....#########",
    "#....#########",
    "#....#########",
    "#............#",
    "#............#",
    "#............#",
    "##############",
)
FLOOR = drawn_floor(*L_ROOM)
ROOM = part_rooms(FLOOR, points((5.5, 1.3))).mask(0)
PLANNER = ViewpointPlanner(FLOOR)


def looked(x: float, y: float, first: float = 0.0, turn: float = math.tau) -> Coverage:
    coverage = Coverage(FLOOR, ROOM, CoverageParams(seen_in=1))
    look(coverage, x, y, first, turn)
    return coverage


def look(coverage: Coverage, x: float, y: float, first: float, turn: float) -> None:
    sight = sight_on_map(FLOOR, x, y, 8.0)
    for k in range(60):
        coverage.look(Eye(pose=Pose2D(x, y, first + turn * k / 59), width=WIDTH), sight)


def test_the_other_leg_of_an_l_is_looked_into() -> None:
    coverage = looked(5.5, 1.3)
    assert coverage.share < 0.9
    view = PLANNER.next(Pose2D(5.5, 1.3, 0.0), ROOM, coverage.unseen(), width=WIDTH)
    assert view is not None
    assert view.pose.x < 3.0
    look(coverage, *view.pose, view.turn)
    assert coverage.share > 0.95


def test_only_the_bearings_with_unseen_floor_are_turned_over() -> None:
    coverage = looked(5.5, 1.3)
    view = PLANNER.next(Pose2D(5.5, 1.3, 0.0), ROOM, coverage.unseen(), width=WIDTH)
    assert view is not None
    assert view.turn < math.pi


def test_the_arc_holds_all_unseen_floor_that_shows() -> None:
    mask = np.zeros(FLOOR.info.shape, bool)
    for x, y in ((0.75, 0.75), (2.25, 3.75)):
        ix, iy = FLOOR.info.cell_of(x, y)
        mask[iy, ix] = True
    first, turn = PLANNER.arc(1.5, 1.5, mask, WIDTH)
    bearings = [math.atan2(0.75 - 1.5, 0.75 - 1.5), math.atan2(3.75 - 1.5, 2.25 - 1.5)]
    for bearing in bearings:
        ahead = math.remainder(bearing - first - turn / 2, math.tau)
        assert abs(ahead) <= turn / 2 + WIDTH / 2


def test_one_look_is_enough_for_one_corner() -> None:
    mask = np.zeros(FLOOR.info.shape, bool)
    ix, iy = FLOOR.info.cell_of(2.25, 3.75)
    mask[iy, ix] = True
    first, turn = PLANNER.arc(1.5, 1.5, mask, WIDTH)
    assert turn == 0.0
    assert first == pytest.approx(math.atan2(3.75 - 1.5, 2.25 - 1.5), abs=0.05)


def test_unseen_floor_all_round_asks_for_a_whole_turn() -> None:
    assert PLANNER.arc(2.0, 2.0, ROOM, WIDTH)[1] == math.tau


def test_nothing_is_planned_where_all_is_seen() -> None:
    none = np.zeros(FLOOR.info.shape, bool)
    assert PLANNER.next(Pose2D(5.5, 1.3, 0.0), ROOM, none, width=WIDTH) is None


def test_a_viewpoint_is_where_the_robot_can_stand_and_get_to() -> None:
    coverage = looked(5.5, 1.3)
    view = PLANNER.next(Pose2D(5.5, 1.3, 0.0), ROOM, coverage.unseen(), width=WIDTH)
    assert view is not None
    ix, iy = FLOOR.info.cell_of(view.pose.x, view.pose.y)
    assert FLOOR.clearance[iy, ix] >= 0.35
    assert view.way == pytest.approx(math.hypot(view.pose.x - 5.5, view.pose.y - 1.3), rel=0.15)


def test_a_gap_that_is_too_narrow_is_looked_through() -> None:
    floor = drawn_floor(*TWO_ROOMS)
    planner = ViewpointPlanner(floor, ViewpointParams(passage_clearance=0.6))
    rooms = part_rooms(floor, points((1.5, 3.0), (8.0, 3.0)))
    ways = planner.ways(Pose2D(1.5, 3.0, 0.0))
    assert ways[floor.info.cell_of(3.0, 3.0)[::-1]] < 3.0
    assert ways[floor.info.cell_of(8.0, 3.0)[::-1]] > 1e6
    view = planner.next(Pose2D(1.5, 3.6, 0.0), rooms.mask(1), rooms.mask(1), width=WIDTH)
    assert view is not None
    assert view.pose.x < 4.5


def test_places_that_were_tried_and_what_stands_there_are_left_out() -> None:
    coverage = looked(5.5, 1.3)
    start = Pose2D(5.5, 1.3, 0.0)
    first = PLANNER.next(start, ROOM, coverage.unseen(), width=WIDTH)
    assert first is not None
    place = (first.pose.x, first.pose.y)
    second = PLANNER.next(start, ROOM, coverage.unseen(), width=WIDTH, tried=(place,))
    assert second is not None
    assert math.dist((second.pose.x, second.pose.y), place) > 0.35
    stands = FLOOR.mark_near(np.array([place]), 0.5)
    third = PLANNER.next(start, ROOM, coverage.unseen(), width=WIDTH, stands=stands)
    assert third is not None
    assert math.dist((third.pose.x, third.pose.y), place) > 0.45


def test_a_room_whose_point_is_out_of_reach_is_looked_into_from_elsewhere() -> None:
    floor = drawn_floor(*TWO_ROOMS)
    rooms = part_rooms(floor, points((1.5, 3.0), (8.0, 3.0)))
    view = ViewpointPlanner(floor).fallback(Pose2D(1.5, 3.0, 0.0), rooms.mask(1), tried=((8.0, 3.0),), width=WIDTH)
    assert view is not None
    assert view.gain > 8.0


def test_a_robot_off_the_map_plans_nothing() -> None:
    assert PLANNER.next(Pose2D(40.0, 40.0, 0.0), ROOM, ROOM, width=WIDTH) is None


def test_what_no_way_leads_to_is_not_reached() -> None:
    floor = drawn_floor("#######", "#..#..#", "#..#..#", "#..#..#", "#..#..#", "#######")
    planner = ViewpointPlanner(floor, ViewpointParams(viewpoint_clearance=0.3))
    start = Pose2D(1.0, 1.5, 0.0)
    reached = planner.reached(start)
    xs = floor.info.origin_x + (np.nonzero(reached)[1] + 0.5) * floor.info.resolution
    assert reached.any()
    assert xs.max() < 1.5
    assert np.isinf(planner.ways(start)[~reached]).all()
    assert planner.views_of(start, 2.5, 1.5, nearest=0.1, most=1.0) == []  # floor there is, but no way to it


def test_second_looks_are_from_all_around_and_from_where_there_is_room_to_turn() -> None:
    floor = drawn_floor(
        *(
            "#" * 20,
            *["#" + "." * 18 + "#"] * 5,
            "#" + "." * 8 + "#" + "." * 9 + "#",
            *["#" + "." * 18 + "#"] * 5,
            "#" * 20,
        )
    )
    start, place = Pose2D(3.7, 3.2, 0.0), (6.5, 3.2)  # beside the post
    views = ViewpointPlanner(floor).views_of(start, *place)
    bearings = [math.atan2(view.pose.y - place[1], view.pose.x - place[0]) for view in views]
    assert max(bearings) - min(bearings) > 5.0
    assert all(0.8 <= math.dist(view.pose[:2], place) <= 4.7 for view in views)
    turned = [wrap_angle(b + math.pi - v.pose.yaw) for b, v in zip(bearings, views, strict=True)]
    assert np.abs(turned).max() < 1e-6
    cells = [floor.info.cell_of(*view.pose[:2]) for view in views]
    assert np.mean([floor.clearance[iy, ix] >= 0.6 for ix, iy in cells]) > 0.7
    narrow = drawn_floor("#" * 12, "#..........#", "#..........#", "#" * 12)
    assert ViewpointPlanner(narrow).views_of(Pose2D(0.9, 1.0, 0.0), 4.0, 1.0)


def test_a_viewpoint_that_was_tried_or_is_blocked_is_left_out() -> None:
    floor = drawn_floor("#########", "#.......#", "#.......#", "#..######", "#########")
    planner, start, place = ViewpointPlanner(floor), Pose2D(1.0, 1.5, 0.0), (3.6, 1.5)
    tried = [view.pose[:2] for view in planner.views_of(start, *place)]
    again = planner.views_of(start, *place, tried=tried)
    assert all(math.dist(view.pose[:2], at) >= 0.4 - 0.1 for view in again for at in tried)
    assert planner.views_of(start, *place, stands=np.ones(floor.info.shape, bool)) == []
