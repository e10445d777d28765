"""Posters: a person for the eye, a board for the depth, nothing for lidar and motion sensors."""

from __future__ import annotations

import numpy as np
import pytest

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.actors.looks import LOOKS
from rosbot_patrol.simulation.actors.posters import BOTTOM, poster_body
from rosbot_patrol.simulation.actors.walkers import Walker
from rosbot_patrol.simulation.scene.shapes import triangles_of


def test_a_poster_is_flat_and_in_a_persons_colours() -> None:
    look = LOOKS["visitor"]
    body = poster_body("poster", look)
    picture = body.visuals[1:]
    points = np.vstack([triangles_of(visual.shape)[0] for visual in picture])
    assert np.ptp(points[:, 0]) < 0.02
    assert np.ptp(points[:, 2]) == pytest.approx(0.7 * look.height, rel=0.05)
    assert points[:, 2].min() > BOTTOM
    assert look.top in [visual.material.rgba[:3] for visual in picture]


def test_lidar_and_motion_sensors_do_not_notice_it() -> None:
    walker = Walker("poster", "poster", "visitor", Pose2D(1.0, 2.0, 0.0), np.random.default_rng(0))
    assert not walker.is_warm
    assert not len(walker.cut(0.16).segments)
    assert len(walker.cut(1.0).segments) == 4
