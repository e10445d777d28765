"""Marks of what has gone are forgotten, those of what is there never (ros-planning/navigation #808 and #643)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.obstacle import observe
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.scan import LaserScan

BEAMS = 360
HERE = Pose2D(0.025, 0.025)
PERIOD = 0.2


def world(person=None, box=None, wall=math.inf):
    """Ranges of a lidar at HERE: a wall all around or open space, a round person and a box, each (x, y, radius)."""
    angles = -math.pi + np.arange(BEAMS) * math.tau / BEAMS
    ranges = np.full(BEAMS, wall)
    for x, y, radius in [thing for thing in (person, box) if thing]:
        dx, dy = x - HERE.x, y - HERE.y
        along = dx * np.cos(angles) + dy * np.sin(angles)
        across2 = dx * dx + dy * dy - along**2
        hit = (along > 0.0) & (across2 < radius**2)
        near = along - np.sqrt(np.clip(radius**2 - across2, 0.0, None))
        ranges = np.where(hit, np.minimum(ranges, near), ranges)
    return ranges


def make(*, rolling=True, static=False, source=None, **ages):
    plugins = [{"name": "obstacles", "type": "costmap_2d::ObstacleLayer"}]
    if static:
        plugins.insert(0, {"name": "static", "type": "costmap_2d::StaticLayer"})
    tree = {
        "plugins": plugins,
        "obstacles": {
            "observation_sources": "scan",
            "scan": {"data_type": "LaserScan", "clearing": True, "obstacle_range": 3.0, "raytrace_range": 3.5}
            | (source or {}),
            **ages,
        },
        "rolling_window": rolling,
        "width": 8.0,
        "height": 8.0,
        "resolution": 0.05,
        "footprint": [[0.1, 0.1], [0.1, -0.1], [-0.1, -0.1], [-0.1, 0.1]],
    }
    return LayeredCostmap(read_costmap(tree))


def look(costmap, ranges, now, pose=HERE):
    scan = LaserScan(
        stamp=now,
        frame_id="laser",
        angle_min=-math.pi,
        angle_increment=math.tau / BEAMS,
        range_min=0.1,
        range_max=10.0,
        ranges=ranges,
    )
    costmap.obstacle_layers[0].buffers["scan"].add(observe(scan, pose))
    return costmap.update(now, pose)


def walk(costmap, *, seconds=4.0, **things):
    """A person crosses in front of open space, 1.5 m away, and is gone; time at the end."""
    steps = int(seconds / PERIOD)
    for i in range(steps):
        look(costmap, world(person=(1.5, -1.5 + 3.0 * i / steps, 0.2), **things), PERIOD * i)
    return PERIOD * steps


def stand(costmap, start, seconds, ranges):
    for i in range(int(seconds / PERIOD)):
        look(costmap, ranges, start + PERIOD * i)
    return start + seconds


def lethal(costmap):
    return int((costmap.cells == 254).sum())


def test_upstreams_defaults_keep_a_person_who_has_gone():
    costmap = make()
    end = walk(costmap)
    stand(costmap, end, 20.0, world())
    assert lethal(costmap) > 20


def test_a_person_who_has_gone_is_forgotten():
    costmap = make(forget_unseen_after=1.0)
    end = walk(costmap)
    assert lethal(costmap) > 0
    stand(costmap, end, 1.6, world())
    assert lethal(costmap) == 0


def test_someone_who_walks_trails_no_more_than_the_time_given():
    costmap = make(forget_unseen_after=1.0)
    walk(costmap)
    ys = (np.argwhere(costmap.cells == 254)[:, 0] + 0.5) * 0.05 + costmap.info.origin_y
    assert ys.min() > 1.5 - 0.75 * (1.0 + 2 * PERIOD) - 0.2 - 0.1  # 0.75 m/s


def test_what_is_seen_is_never_forgotten():
    costmap = make(forget_unseen_after=0.3, forget_out_of_view_after=0.3)
    still = world(box=(1.2, 0.4, 0.15), wall=2.5)
    stand(costmap, 0.0, 1.0, still)
    marks = costmap.cells.copy()
    stand(costmap, 1.0, 30.0, still)
    assert np.array_equal(costmap.cells, marks)


def test_what_is_hidden_is_kept():
    """A wall behind somebody who came to stand before it is not empty because no beam hits it."""
    costmap = make(forget_unseen_after=0.4)
    stand(costmap, 0.0, 1.0, world(box=(2.5, 0.0, 0.3)))
    behind = costmap.cells == 254
    stand(costmap, 1.0, 20.0, world(person=(1.0, 0.0, 0.4)))
    assert (costmap.cells[behind] == 254).all()
    stand(costmap, 21.0, 2.0, world())
    assert lethal(costmap) == 0


def test_what_is_hidden_for_long_is_forgotten_where_asked():
    costmap = make(forget_out_of_view_after=5.0)
    stand(costmap, 0.0, 1.0, world(box=(2.5, 0.0, 0.3)))
    behind = costmap.cells == 254
    person = world(person=(1.0, 0.0, 0.4))
    stand(costmap, 1.0, 4.0, person)
    assert (costmap.cells[behind] == 254).all()
    stand(costmap, 5.0, 2.0, person)
    assert not (costmap.cells[behind] == 254).any()
    assert lethal(costmap) > 0  # the person


def test_what_is_right_beside_the_robot_is_kept_longer():
    """A robot that waits beside something that it cannot see any more would turn into it."""
    costmap = make(forget_out_of_view_after=5.0, forget_beside_after=60.0)
    blind = np.full(BEAMS, np.nan)
    stand(costmap, 0.0, 1.0, world(box=(0.5, 0.0, 0.1)))
    beside = costmap.cells == 254
    assert beside.any()
    stand(costmap, 1.0, 50.0, blind)
    assert np.array_equal(costmap.cells == 254, beside)
    stand(costmap, 51.0, 12.0, blind)
    assert lethal(costmap) == 0


def test_what_the_robot_leaves_behind_is_not_kept_longer():
    costmap = make(forget_out_of_view_after=5.0, forget_beside_after=60.0)
    stand(costmap, 0.0, 1.0, world(box=(0.5, 0.0, 0.1)))
    for i in range(40):
        look(costmap, np.full(BEAMS, np.nan), 1.0 + PERIOD * i, Pose2D(HERE.x - 0.5, HERE.y))
    assert lethal(costmap) == 0


def test_the_time_in_view_counts_and_not_the_time_before():
    """What was hidden long ago is not forgotten at the first glimpse, which may be a lost beam."""
    costmap = make(forget_unseen_after=1.0)
    box = world(box=(2.5, 0.0, 0.3))
    stand(costmap, 0.0, 1.0, box)
    behind = costmap.cells == 254
    stand(costmap, 1.0, 20.0, world(person=(1.0, 0.0, 0.4)))
    look(costmap, world(), 21.0)
    assert (costmap.cells[behind] == 254).all()
    stand(costmap, 21.2, 5.0, box)
    assert (costmap.cells[behind] == 254).all()


@pytest.mark.parametrize("blind", [0.0, np.nan, -np.inf])
def test_beams_that_say_nothing_show_nothing_empty(blind):
    costmap = make(forget_unseen_after=0.4)
    stand(costmap, 0.0, 1.0, world(box=(1.5, 0.0, 0.3)))
    marks = lethal(costmap)
    stand(costmap, 1.0, 5.0, np.full(BEAMS, blind))
    assert lethal(costmap) == marks


def test_marks_beyond_the_raytrace_range_are_out_of_view():
    costmap = make(forget_unseen_after=0.4, source={"obstacle_range": 3.0, "raytrace_range": 2.0})
    stand(costmap, 0.0, 1.0, world(box=(2.8, 0.0, 0.3)))
    marks = lethal(costmap)
    stand(costmap, 1.0, 5.0, world())
    assert lethal(costmap) == marks > 0


def test_marks_keep_their_age_while_the_window_moves():
    costmap = make(forget_unseen_after=1.0)
    end = walk(costmap)
    for i in range(10):
        areas = look(costmap, world(), end + PERIOD * i, Pose2D(HERE.x + 0.1 * i, HERE.y - 0.05 * i))
    assert lethal(costmap) == 0
    assert all(area.size < 160 * 160 for area in areas)


def test_the_map_is_not_forgotten():
    costmap = make(static=True, rolling=False, forget_unseen_after=0.4, forget_out_of_view_after=1.0)
    cells = np.zeros((160, 160), np.int8)
    cells[80, 110] = 100
    info = GridInfo(resolution=0.05, width=160, height=160, origin_x=-4.0, origin_y=-4.0)
    costmap.static_layers[0].set_map(Grid(info, cells))
    end = walk(costmap)
    stand(costmap, end, 5.0, world())
    assert np.argwhere(costmap.cells == 254).tolist() == [[80, 110]]


def test_time_that_goes_back_starts_the_ages_anew():
    costmap = make(forget_out_of_view_after=5.0)
    stand(costmap, 100.0, 1.0, world(box=(2.5, 0.0, 0.3)))
    hidden = world(person=(1.0, 0.0, 0.4))
    stand(costmap, 10.0, 4.0, hidden)
    assert costmap.grid.at(2.2, 0.0) == 254
    stand(costmap, 14.0, 3.0, hidden)
    assert costmap.grid.at(2.2, 0.0) == 0


def test_clearing_the_costmap_clears_the_ages():
    costmap = make(forget_unseen_after=1.0)
    end = walk(costmap)
    costmap.reset()
    costmap.obstacle_layers[0].buffers["scan"].clear()
    costmap.update(end, HERE)
    costmap.update(end + 1.0, HERE)
    assert lethal(costmap) == 0
    assert len(costmap.obstacle_layers[0]._marks) == 0


def test_what_has_stood_is_kept_out_of_view_for_longer_than_what_passed_by():
    costmap = make(forget_out_of_view_after=5.0, remember_standing=3.0)
    end = stand(costmap, 0.0, 10.0, world(box=(2.5, 0.0, 0.3)))
    behind = costmap.cells == 254
    person = world(person=(1.0, 0.0, 0.4))  # hides the box
    end = stand(costmap, end, 28.0, person)
    assert (costmap.cells[behind] == 254).all()
    stand(costmap, end, 4.0, person)
    assert not (costmap.cells[behind] == 254).any()
    assert lethal(costmap) > 0  # the person
