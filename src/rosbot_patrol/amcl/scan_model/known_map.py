"""A map prepared for amcl: sensor models, free floor, and distances to obstacles."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.amcl.scan_model.floor import Floor
from rosbot_patrol.amcl.scan_model.likelihood_field import Field
from rosbot_patrol.amcl.scan_model.sensor_model import MODELS, LikelihoodFieldModel, SensorModel
from rosbot_patrol.errors import MapError
from rosbot_patrol.grid import Grid

WIDE_M = 0.4  # spread of hits for weighing random poses: few of them are close to the right one


class KnownMap:
    """A map for localisation.

    Args:
        grid: the map.
        params: of amcl.
        rng: source of random numbers.

    Raises:
        MapError: the map is turned or empty, or its place is invalid.
    """

    def __init__(self, grid: Grid, params: AmclParams, rng: np.random.Generator) -> None:
        _require_sense(grid)
        self.grid = grid
        self._params = params
        made = MODELS[params.laser_model_type](grid, params)
        self.model: SensorModel = made
        self.obstacles: Field = made.distances
        self.floor = Floor(grid, rng)

    @cached_property
    def wide(self) -> SensorModel:
        """A more tolerant sensor model; made when first needed."""
        forgiving = replace(
            self._params, laser_sigma_hit=WIDE_M, laser_likelihood_max_dist=3.0 * WIDE_M, laser_z_hit=0.95
        )
        return LikelihoodFieldModel(self.grid, forgiving)


def _require_sense(grid: Grid) -> None:
    grid.info.require_aligned("amcl")
    info = grid.info
    if not (0.0 < info.resolution < math.inf and math.isfinite(info.origin_x + info.origin_y) and grid.cells.size):
        raise MapError("amcl", f"a map of {info.width} x {info.height} cells of {info.resolution} m is invalid")
