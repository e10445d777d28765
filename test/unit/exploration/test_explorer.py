"""Exploring: a robot that glides from goal to goal over a drawn house, of which the map shows what was seen."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from floors import drawn_map

from rosbot_patrol.amcl.scan_model.field_kernels import cast_ray
from rosbot_patrol.amcl.scan_model.likelihood_field import blocked_distances
from rosbot_patrol.exploration.explorer import Explorer, ExplorerParams
from rosbot_patrol.exploration.frontiers import Borders, FrontierParams
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.goal import Goal, GoalLink, GoalState
from rosbot_patrol.grid import Grid

HOUSE = drawn_map(
    "##################",
    "#......#.........#",
    "#......#.........#",
    "#......#.........#",
    "#................#",
    "#................#",
    "#......#.........#",
    "####..############",
    "####..############",
    "#................#",
    "#................#",
    "#................#",
    "##################",
)
FIELD = blocked_distances(HOUSE, 3.0)
START = Pose2D(2.0, 4.0, 0.0)


class House:
    """Glides 0.5 m a step; the map comes each fifth step, and shows what 3 m of lidar have met."""

    def __init__(self, explorer: Explorer, refused: Callable[[Goal], bool] = lambda goal: False) -> None:
        self.explorer, self.refused = explorer, refused
        self.cells = np.full(HOUSE.cells.shape, -1, np.int8)
        self.pose, self.now, self.maps, self.grid = START, 0.0, 0, None
        self.link, self.goal = GoalLink(is_up=True), None
        self.goals: list[Goal] = []
        self.texts: list[str] = []

    def see(self) -> None:
        res = HOUSE.info.resolution
        for angle in np.linspace(-math.pi, math.pi, 1200):
            f = FIELD
            reach = cast_ray(self.pose.x, self.pose.y, angle, f.values, f.origin_x, f.origin_y, f.resolution, 3.0)
            for gone in np.arange(0.0, min(reach + 2 * res, 3.0), 0.5 * res):
                ix, iy = HOUSE.info.cell_of(self.pose.x + gone * math.cos(angle), self.pose.y + gone * math.sin(angle))
                self.cells[iy, ix] = HOUSE.cells[iy, ix]
                if HOUSE.cells[iy, ix]:
                    break

    def step(self) -> bool:
        if round(self.now * 10) % 5 == 0:
            self.see()
            self.maps += 1
            self.grid = Grid(HOUSE.info, self.cells.copy())
        out = self.explorer.step(self.now, self.grid, self.maps, self.pose, self.link)
        self.texts.append(out.text)
        if out.goal is not None:
            self.goals.append(out.goal)
            self.goal, state = out.goal, GoalState.FAILED if self.refused(out.goal) else GoalState.ACTIVE
            self.link = GoalLink(is_up=True, tag=out.goal.tag, state=state)
        if self.goal is not None and self.link.state is GoalState.ACTIVE:
            gap = math.dist(self.pose[:2], self.goal.pose[:2])
            share = min(0.5 / gap, 1.0) if gap else 1.0
            x, y = (a + share * (b - a) for a, b in zip(self.pose[:2], self.goal.pose[:2], strict=True))
            self.pose = Pose2D(x, y, 0.0)
            if share == 1.0:
                self.link = GoalLink(is_up=True, tag=self.goal.tag, state=GoalState.SUCCEEDED)
        self.now += 0.1
        return out.is_done

    def run(self) -> None:
        while not self.step():
            assert self.now < 300.0, self.texts[-1]


def test_all_of_a_house_is_seen_and_the_robot_comes_home() -> None:
    house = House(Explorer())
    house.run()
    known = house.cells[HOUSE.cells == 0]
    assert (known == 0).mean() > 0.98
    assert house.pose[:2] == START[:2]
    assert len(house.goals) < 20
    assert not house.explorer.left_out
    assert house.explorer.area == pytest.approx((HOUSE.cells == 0).sum() * 0.0025, rel=0.03)
    assert house.step()  # over is over


def test_a_border_that_cannot_be_reached_is_left_out_and_the_rest_explored() -> None:
    house = House(Explorer(), refused=lambda goal: goal.pose.y < 2.0)
    house.run()
    assert house.explorer.left_out
    assert (house.cells[80:][HOUSE.cells[80:] == 0] == 0).mean() > 0.98


def test_a_robot_that_comes_no_nearer_tries_other_goals_and_gives_the_border_up(
    caplog: pytest.LogCaptureFixture,
) -> None:
    house = House(Explorer(ExplorerParams(progress_timeout=5.0)))
    house.step()
    stuck = house.pose
    while not house.explorer.left_out:
        house.step()
        house.pose = stuck
        assert house.now < 100.0
    assert 5.0 * (len(house.goals) - 1) <= house.now < 6.5 * (len(house.goals) - 1)
    assert "no progress for 5 s" in caplog.text
    for k, goal in enumerate(house.goals):
        assert all(math.dist(goal.pose[:2], other.pose[:2]) >= 0.4 for other in house.goals[:k])


def test_a_robot_that_is_held_up_near_its_goal_looks_from_there(caplog: pytest.LogCaptureFixture) -> None:
    house = House(Explorer(ExplorerParams(progress_timeout=5.0)))
    house.step()
    x, y, _ = house.goals[0].pose
    far = math.dist((x, y), START[:2])
    near = Pose2D(x + 0.3 * (START.x - x) / far, y + 0.3 * (START.y - y) / far, 0.0)
    while len(house.goals) < 2:
        house.step()
        house.pose = near
        assert house.now < 30.0
    assert "no way" not in caplog.text


def test_a_goal_has_room_where_there_is_some_and_sees_its_border() -> None:
    cells = HOUSE.cells.copy()
    cells[1:40, 36:40] = -1  # along the wall of a room's corner
    grid = Grid(HOUSE.info, cells)
    walls = np.argwhere(cells == 100)[:, ::-1] * 0.05 + 0.025
    for start in (START, Pose2D(6.0, 4.0, 0.0)):
        found = Borders(grid, start, FrontierParams()).frontiers()
        assert found
        for frontier in found:
            assert np.hypot(*(walls - frontier.goal[:2]).T).min() >= 0.3
            between = np.linspace(0.0, 1.0, 50)[:, None]
            seen = np.array(frontier.goal[:2]) * (1 - between) + np.array([frontier.x, frontier.y]) * between
            assert all(cells[iy, ix] != 100 for ix, iy in (HOUSE.info.cell_of(*at) for at in seen.tolist()))


def test_what_is_missing_is_told() -> None:
    explorer = Explorer()
    said = explorer.step(0.0, None, 0, None, GoalLink())
    assert (said.is_waiting, said.text) == (True, "waiting for a map and the robot's pose and move_base")
    assert explorer.step(0.0, None, 0, START, GoalLink(is_up=True)).text == "waiting for a map"


def test_borders_that_are_short_or_out_of_reach_are_left_alone() -> None:
    cells = HOUSE.cells.copy()
    cells[20:22, 15:17] = -1  # a speck of the unknown
    assert Borders(Grid(HOUSE.info, cells), START, FrontierParams()).frontiers() == []
    cells[:] = HOUSE.cells
    cells[90:, 90:] = -1
    (one,) = Borders(Grid(HOUSE.info, cells), START, FrontierParams()).frontiers()
    assert 3.5 < one.length < 4.5
    assert math.dist(one.goal[:2], (one.x, one.y)) < 0.4
    shut = Borders(Grid(HOUSE.info, cells), START, FrontierParams(robot_radius=0.6))
    assert shut.frontiers() == []  # the door is too narrow for it


@pytest.mark.parametrize(("cells_wide", "is_way"), [(8, False), (9, True), (12, True)])
def test_a_gap_that_move_base_refuses_once_in_a_while_is_no_way(cells_wide: int, is_way: bool) -> None:
    cells = HOUSE.cells.copy()
    cells[70:90, 70:75] = 100  # the gap between the upper rooms, made narrower
    cells[75 : 75 + cells_wide, 70:75] = 0
    cells[70:-1, 110:-1] = -1  # of the room beyond, only the floor behind the gap is known
    found = Borders(Grid(HOUSE.info, cells), START, FrontierParams()).frontiers()
    assert bool(found) == is_way


def test_what_lies_behind_a_gap_that_the_robot_came_through_is_within_its_reach() -> None:
    cells = HOUSE.cells.copy()
    cells[70:90, 70:75] = 100
    cells[75:83, 70:75] = 0
    cells[95:-1, 1:30] = -1  # of the room from which it came
    track = [(0.05 * k, 3.95) for k in range(60, 90)]
    assert Borders(Grid(HOUSE.info, cells), Pose2D(4.5, 3.95, 0.0), FrontierParams()).frontiers() == []
    (found,) = Borders(Grid(HOUSE.info, cells), Pose2D(4.5, 3.95, 0.0), FrontierParams(), passed=track).frontiers()
    assert found.goal.x < 3.0


def test_a_track_has_no_holes_however_fast_the_robot_is() -> None:
    explorer = Explorer()
    grid = Grid(HOUSE.info, HOUSE.cells)
    for k in range(5):
        explorer.step(0.1 * k, grid, k, Pose2D(2.0 + 0.33 * k, 4.0, 0.0), GoalLink(is_up=True))
    track = np.array(explorer._passed)
    assert track[[0, -1], 0] == pytest.approx([2.0, 3.32])
    assert np.hypot(*np.diff(track, axis=0).T).max() < 0.06


def test_a_robot_off_the_map_reaches_nothing() -> None:
    assert Borders(HOUSE, Pose2D(50.0, 50.0, 0.0), FrontierParams()).frontiers() == []
    assert Borders(HOUSE, Pose2D(-50.0, 2.0, 0.0), FrontierParams()).frontiers() == []
