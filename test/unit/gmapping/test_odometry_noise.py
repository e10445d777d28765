"""The real size of the odometry's errors."""

from __future__ import annotations

import numpy as np
import pytest

from rosbot_patrol.gmapping.odometry_noise import OdometryNoise


def test_it_is_learned_whatever_a_few_slips_say() -> None:
    rng, noise = np.random.default_rng(1), OdometryNoise()
    assert (noise.scale == 1.0).all()
    for i in range(200):
        noise.learn(rng.standard_normal(3) * (0.5, 0.2, 0.05) if i % 10 else np.full(3, 20.0))
    assert noise.scale == pytest.approx([0.5, 0.2, 0.05], rel=0.35)


def test_a_few_matches_do_not_outvote_the_parameters_and_none_widens_them() -> None:
    noise = OdometryNoise()
    for _ in range(10):
        noise.learn(np.zeros(3))
    assert (noise.scale == 1.0).all()
    for _ in range(100):
        noise.learn(np.full(3, 9.0))
    assert (noise.scale == 1.0).all()
    for _ in range(100):
        noise.learn(np.zeros(3))
    assert (noise.scale == 0.01).all()
