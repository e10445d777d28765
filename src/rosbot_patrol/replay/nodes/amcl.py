"""amcl over a bag: its node's core, fed with the bag's records.

Scans wait for the odometry of their stamp; a pose of /initialpose is moved by the motion since its stamp. The map is
the given one, else the first of /map (each one if `use_map_topic` is set and `first_map_only` is not).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from rosbot_patrol.amcl.core import AmclCore, Step
from rosbot_patrol.amcl.initial_pose import PoseRecord
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.errors import MapError
from rosbot_patrol.grid import Grid
from rosbot_patrol.replay.bags.records import KINDS, MapRecord, Refused
from rosbot_patrol.replay.results.comparison import Field
from rosbot_patrol.replay.results.tables import STAMP, Result, Rows
from rosbot_patrol.replay.runner import TF_TYPES, Input
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.tf.tree import Edge, TransformTree

INPUTS = (
    Input(name="scan", types=("sensor_msgs/LaserScan",)),
    Input(name="tf", types=TF_TYPES),
    Input(name="tf_static", types=TF_TYPES, is_needed=False),
    Input(name="initialpose", types=("geometry_msgs/PoseWithCovarianceStamped",), is_needed=False),
    Input(name="map", types=("nav_msgs/OccupancyGrid",), instead="the map's yaml: --map FILE"),
)
HEALTH_S = 1.0  # period of the rows of `health`, as in the node

FIELDS = {
    "poses.x": Field(tolerance=0.05, unit="m"),
    "poses.y": Field(tolerance=0.05, unit="m"),
    "poses.yaw": Field(tolerance=math.radians(2.0), unit="rad", is_angle=True),
    "poses.std_x": Field(tolerance=0.05, unit="m"),
    "poses.std_y": Field(tolerance=0.05, unit="m"),
    "poses.std_yaw": Field(tolerance=math.radians(3.0), unit="rad"),
    "poses.cluster_weight": Field(tolerance=0.3),
    "poses.particles": Field(tolerance=300),
    "health.x": Field(tolerance=0.05, unit="m"),
    "health.y": Field(tolerance=0.05, unit="m"),
    "health.yaw": Field(tolerance=math.radians(2.0), unit="rad", is_angle=True),
    "health.belief": Field(tolerance=0.3),
    "health.agreement": Field(tolerance=0.1),
}


class AmclReplay:
    """An AmclCore on the bag's clock.

    Args:
        params: amcl's parameters.
        grid: the map; None: the bag's.
        seed: seed of all random numbers.
        static: transforms that the bag lacks.

    Raises:
        MapError: the map cannot be used.
    """

    kinds = KINDS

    def __init__(
        self, params: AmclParams, *, grid: Grid | None = None, seed: int = 0, static: Iterable[Edge] = ()
    ) -> None:
        self._params = params
        self._tree = TransformTree()
        self._tree.add_all(static, is_static=True)
        self._core = AmclCore(params, self._tree, np.random.default_rng(seed))
        self._has_own_map = grid is not None
        self._next_health = -math.inf
        self._counts = dict.fromkeys(("maps", "initial_poses", "ignored", "updates", "resampled", "late", "found"), 0)
        self._poses = Rows(
            STAMP, "x", "y", "yaw", "std_x", "std_y", "std_yaw", "cluster_weight", "particles", "is_found"
        )
        self._health = Rows(STAMP, "x", "y", "yaw", "state", "belief", "agreement", "is_seeking", "dropped")
        if grid is not None:
            self._take_map(grid)

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Inputs of the node."""
        return (*INPUTS[:-1], replace(INPUTS[-1], is_needed=False)) if self._has_own_map else INPUTS

    def begin(self, names: Collection[str]) -> None:
        """Ignore the list of inputs: the core asks for what it needs."""

    def hear(self, name: str, now: float, content: Any) -> None:
        """Process a record of the named input, recorded at a time [s]."""
        self._tell_health(now)
        match content:
            case Refused():
                self._counts["ignored"] += 1
            case MapRecord():
                self._hear_map(content)
            case PoseRecord():
                self._counts["initial_poses" if self._core.hear_initial_pose(content, now) else "ignored"] += 1
            case LaserScan():
                self._core.feed.hear(content, now)
            case _:
                self._tree.add_all(content, is_static=name == "tf_static")
        for placed in self._core.feed.placed(now):
            self._note(self._core.step(placed))

    def finish(self) -> Result:
        """The published poses, health each second, counts."""
        tables = {"poses": self._poses.table(), "health": self._health.table()}
        feed = self._core.feed
        return Result("amcl", feed.facts(), counts=feed.counts() | self._counts, tables=tables)

    def _hear_map(self, record: MapRecord) -> None:
        is_wanted = self._params.use_map_topic and not self._params.first_map_only
        if self._has_own_map or (self._counts["maps"] and not is_wanted):
            return
        try:
            self._take_map(record.grid)
        except MapError:
            self._counts["ignored"] += 1

    def _take_map(self, grid: Grid) -> None:
        self._core.hear_map(grid)
        self._counts["maps"] += 1

    def _note(self, step: Step) -> None:
        outcome = step.outcome
        for name, happened in (
            ("updates", outcome.updated),
            ("resampled", outcome.resampled),
            ("late", outcome.is_late),
            ("found", outcome.is_found),
        ):
            self._counts[name] += happened
        estimate = outcome.estimate
        if estimate is not None:
            spread = np.sqrt(np.maximum(np.diag(estimate.covariance), 0.0)).tolist()
            weight, count = float(estimate.cluster_weight), estimate.particles
            self._poses.add(step.stamp, *estimate.pose, *spread, weight, count, outcome.is_found)

    def _tell_health(self, now: float) -> None:
        if now < self._next_health:
            return
        stamp = now if math.isinf(self._next_health) else self._next_health
        self._next_health = stamp + HEALTH_S * (1.0 + math.floor((now - stamp) / HEALTH_S))
        pose = self._core.pose or (math.nan, math.nan, math.nan)
        trust = self._core.localizer.trust
        state, seeking = trust.state.name.lower(), self._core.localizer.is_seeking
        self._health.add(now, *pose, state, trust.belief, trust.agreement, seeking, self._core.feed.dropped)
