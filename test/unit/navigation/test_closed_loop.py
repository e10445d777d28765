"""The tuned profile drives a unicycle with a lidar through a small flat: no contact, every goal reached."""

from __future__ import annotations

import math

import numpy as np
from loop import Loop, tuned

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo

INFO = GridInfo(resolution=0.05, width=120, height=80, origin_x=-1.0, origin_y=-2.0)


def flat(*boxes, door=True):
    """Two rooms of 3 x 4 m with a door of 0.9 m, and boxes (x0, y0, x1, y1) in them."""
    cells = np.zeros(INFO.shape, np.int8)
    cells[:2] = cells[-2:] = 100
    cells[:, :2] = cells[:, -2:] = 100
    cells[:, 59:62] = 100
    if door:
        cells[31:49, 59:62] = 0
    for x0, y0, x1, y1 in boxes:
        a, b = INFO.cell_of(x0, y0), INFO.cell_of(x1, y1)
        cells[a[1] : b[1], a[0] : b[0]] = 100
    return Grid(INFO, cells)


def test_through_a_door():
    grid = flat()
    loop = Loop(known=grid, world=grid, tree=tuned())
    goal = Pose2D(3.2, 0.8, 2.5)
    outcome = loop.drive(goal, 40.0)
    assert outcome is not None
    assert outcome.text == "Goal reached."
    assert math.dist(loop.pose[:2], goal[:2]) <= 0.12
    assert (loop.contacts, loop.recoveries) == (0, [])


def test_around_what_the_map_does_not_know():
    loop = Loop(known=flat(), world=flat((0.9, -0.4, 1.2, 0.3), (3.0, -0.1, 3.3, 0.6)), tree=tuned())
    outcome = loop.drive(Pose2D(4.2, 0.2, 0.0), 60.0)
    assert outcome is not None
    assert outcome.succeeded
    assert loop.contacts == 0


def test_a_goal_in_a_wall_is_given_up_with_upstreams_text():
    tree = {**tuned(), "planner_patience": 0.5, "clearing_rotation_allowed": False}
    loop = Loop(known=flat(), world=flat(), tree=tree)
    outcome = loop.drive(Pose2D(2.0, -1.8, 0.0), 60.0)
    assert outcome is not None
    assert outcome.text.startswith("Failed to find a valid plan.")
