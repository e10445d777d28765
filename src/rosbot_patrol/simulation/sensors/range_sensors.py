"""Short-range distance sensors: the nearest of a few beams in a narrow cone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.params import param
from rosbot_patrol.simulation.scene.slices import Slice

_BEAMS = 5


@dataclass(frozen=True, kw_only=True)
class RangeParams:
    """Parameters of the four range sensors at the robot's corners."""

    range_min: float = param(0.01, unit="m", lo=0.0, doc="minimum range; the sensor reports it for anything nearer")
    range_max: float = param(0.9, unit="m", lo=0.01, doc="maximum range; the sensor reports it if nothing is nearer")
    field_of_view: float = param(0.1, unit="rad", lo=0.001, doc="opening angle of the cone")
    noise: float = param(0.005, unit="m", lo=0.0, doc="standard deviation of a range")


def measure_range(
    params: RangeParams, scene: Slice, world_from_sensor: Pose2D, rng: np.random.Generator | None
) -> float:
    """Distance to the nearest obstacle in the cone [m], within the sensor's limits."""
    x, y, yaw = world_from_sensor
    step = params.field_of_view / (_BEAMS - 1)
    beams = scene.cast(x, y, yaw - params.field_of_view / 2.0, step, _BEAMS, longest=params.range_max)
    nearest = float(beams.min())
    if rng is not None and nearest < params.range_max:
        nearest += params.noise * float(rng.standard_normal())
    return min(max(nearest, params.range_min), params.range_max)
