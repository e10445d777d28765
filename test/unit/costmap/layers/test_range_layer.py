"""The range sensor layer: readings of a cone as probabilities, and what becomes of them in the costmap."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.costmap.costs import FREE, LETHAL
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.range_layer import RangeReading
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.errors import ParamError
from rosbot_patrol.geometry import Pose2D

SENSOR = Pose2D(0.1, 0.0, 0.0)


def make(**params):
    tree = {
        "plugins": [{"name": "ranges", "type": "range_sensor_layer::RangeSensorLayer"}],
        "ranges": {"topics": ["/range/fl", "/range/fr"], **params},
        "rolling_window": True,
        "width": 3.0,
        "height": 3.0,
        "resolution": 0.05,
        "footprint": [[0.12, 0.14], [0.12, -0.14], [-0.12, -0.14], [-0.12, 0.14]],
    }
    return LayeredCostmap(read_costmap(tree))


def reading(distance, *, stamp=0.0, pose=SENSOR, fov=0.1, range_min=0.01, range_max=0.9):
    return RangeReading(stamp, pose, distance, range_min, range_max, fov)


def hear(costmap, distance, times=3, now=0.0, **kwargs):
    for i in range(times):
        stamp = now + 0.2 * i
        costmap.range_layers[0].add(reading(distance, stamp=stamp, **kwargs))
        costmap.update(stamp, Pose2D())
    return costmap


def marked_x(costmap):
    _iy, ix = np.nonzero(costmap.cells == LETHAL)
    return (ix + 0.5) * costmap.info.resolution + costmap.info.origin_x


@pytest.mark.parametrize("distance", [0.1, 0.2, 0.33, 0.5, 0.7, 0.85])
def test_a_reading_that_repeats_marks_where_it_is(distance):
    xs = marked_x(hear(make(), distance))
    assert len(xs) >= 1
    assert abs(xs - (0.1 + distance)).max() <= 0.05
    assert abs(xs - (0.1 + distance)).min() <= 0.03


def test_one_reading_is_not_believed_at_once():
    assert len(marked_x(hear(make(mark_threshold=0.8), 0.5, times=1))) == 0


def test_what_lies_nearer_than_a_reading_becomes_free():
    costmap = hear(make(), 0.7)
    layer = costmap.range_layers[0]
    ix, iy = costmap.info.cell_of(0.4, 0.0)
    assert layer.probabilities[iy, ix] < 0.2
    assert costmap.cells[iy, ix] == FREE


def test_nothing_is_learnt_outside_the_cone():
    layer = hear(make(), 0.7).range_layers[0]
    half = layer.probabilities == 0.5
    iy, _ix = np.nonzero(~half)
    info = layer._info
    y = (iy + 0.5) * info.resolution + info.origin_y
    assert abs(y).max() < 0.7 * 0.05 + 0.05


def test_a_thing_that_has_gone_is_cleared_by_longer_readings():
    costmap = hear(make(), 0.4)
    assert len(marked_x(costmap)) >= 1
    hear(costmap, 0.8, times=6, now=1.0)
    assert abs(marked_x(costmap) - 0.9).max() <= 0.06


def test_a_reading_of_the_end_clears_only_where_that_is_asked_for():
    for clear, left in ((False, True), (True, False)):
        costmap = hear(make(clear_on_max_reading=clear), 0.4)
        hear(costmap, 0.9, times=6, now=1.0)
        assert (len(marked_x(costmap)) > 0) is left


def test_what_was_free_can_be_occupied_again():
    costmap = hear(make(clear_on_max_reading=True), 0.9, times=50)
    hear(costmap, 0.4, times=6, now=20.0)
    assert len(marked_x(costmap)) >= 1


def test_readings_that_are_none_say_nothing():
    for wrong in (math.nan, 0.001, -1.0, -0.03):
        layer = hear(make(clear_on_max_reading=True), wrong).range_layers[0]
        assert (layer.probabilities == 0.5).all()
    for wrong in (math.nan, -1.0):  # from a sensor that only tells nearer or not
        fixed = hear(make(clear_on_max_reading=True), wrong, range_min=0.3, range_max=0.3).range_layers[0]
        assert (fixed.probabilities == 0.5).all()


def test_infinities_of_rep_117():
    assert len(marked_x(hear(make(), -math.inf, range_min=0.1))) >= 1
    assert len(marked_x(hear(make(), math.inf))) == 0


def test_sensors_that_tell_nearer_or_not():
    near = hear(make(), -math.inf, range_min=0.3, range_max=0.3)
    assert abs(marked_x(near) - 0.4).max() <= 0.05
    hear(near, math.inf, times=8, now=2.0, range_min=0.3, range_max=0.3)
    assert len(marked_x(near)) > 0  # clear_on_max_reading is false
    only = make(input_sensor_type="VARIABLE")
    assert len(marked_x(hear(only, -math.inf, range_min=0.3, range_max=0.3))) == 0


def test_marks_decay_by_upstreams_parameters():
    costmap = hear(make(use_decay=True, pixel_decay=3.0), 0.4)
    for now in np.arange(1.0, 3.0, 0.5):
        costmap.update(float(now), Pose2D())
    assert len(marked_x(costmap)) >= 1
    for now in np.arange(3.0, 5.0, 0.5):
        costmap.update(float(now), Pose2D())
    assert len(marked_x(costmap)) == 0


def test_marks_stay_in_their_place_when_the_window_rolls():
    costmap = hear(make(), 0.7)
    before = np.sort(marked_x(costmap))
    costmap.update(1.0, Pose2D(0.3, 0.2))
    np.testing.assert_allclose(np.sort(marked_x(costmap)), before, atol=1e-9)


def test_the_robots_own_cells_say_nothing():
    costmap = hear(make(), 0.1)
    assert len(marked_x(costmap)) >= 1
    costmap.update(1.0, Pose2D(0.15, 0.0))
    assert len(marked_x(costmap)) == 0


def test_silence_is_told_where_that_is_asked_for():
    costmap = hear(make(no_readings_timeout=1.0), 0.5)
    assert costmap.is_current(0.5)
    assert not costmap.is_current(2.0)
    assert hear(make(), 0.5).is_current(100.0)


def test_reset_forgets():
    costmap = hear(make(), 0.5)
    costmap.reset()
    costmap.update(1.0, Pose2D())
    assert len(marked_x(costmap)) == 0


def test_topics_and_names():
    layer = make(ns="/robot", topics=["range/fl", "/range/fr"]).range_layers[0]
    assert layer.topics == ["/robot/range/fl", "/robot/range/fr"]
    with pytest.raises(ParamError, match="ranges/input_sensor_type"):
        make(input_sensor_type="SOME")
