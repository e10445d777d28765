"""amcl over a bag: its Localizer, fed as its node feeds it.

Scans wait for the odometry of their stamp; a pose of /initialpose counts with the motion since; the map is the one that
is given, else that of /map (the first of them, or each where `use_map_topic` is set and `first_map_only` is not).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from rosbot_patrol.amcl.initial_pose import taken_pose
from rosbot_patrol.amcl.localizer import Localizer, Outcome
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.errors import MapError
from rosbot_patrol.geometry import Pose2D, compose
from rosbot_patrol.grid import Grid
from rosbot_patrol.replay.bags.records import KINDS, MapRecord, PoseRecord, Refused
from rosbot_patrol.replay.nodes.scan_feed import ScanFeed
from rosbot_patrol.replay.results.tables import STAMP, Result, Rows
from rosbot_patrol.replay.runner import TF_TYPES, Field, Input
from rosbot_patrol.scan_line import PlacedScan
from rosbot_patrol.tf.tree import Edge

INPUTS = (
    Input(name="scan", types=("sensor_msgs/LaserScan",)),
    Input(name="tf", types=TF_TYPES),
    Input(name="tf_static", types=TF_TYPES, is_needed=False),
    Input(name="initialpose", types=("geometry_msgs/PoseWithCovarianceStamped",), is_needed=False),
    Input(name="map", types=("nav_msgs/OccupancyGrid",), instead="the map's yaml: --map FILE"),
)
HEALTH_S = 1.0  # between two rows of `health`, as the node tells it

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
    """A Localizer and the decisions of its node.

    Args:
        params: of amcl.
        grid: the map; None: the bag's.
        seed: of all chance.
        static: transforms that the bag lacks.

    Raises:
        MapError: the map cannot be used.
    """

    kinds = KINDS

    def __init__(
        self, params: AmclParams, *, grid: Grid | None = None, seed: int = 0, static: Iterable[Edge] = ()
    ) -> None:
        self._params = params
        self._localizer = Localizer(params, np.random.default_rng(seed))
        self._feed = ScanFeed(params.odom_frame_id, params.base_frame_id)
        self._feed.hear_transforms(static, is_static=True)
        self._has_own_map = grid is not None
        self._odom_from_base: Pose2D | None = None
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
        """What it hears."""
        return (*INPUTS[:-1], replace(INPUTS[-1], is_needed=False)) if self._has_own_map else INPUTS

    def begin(self, names: Collection[str]) -> None:
        """Which of the inputs will be heard: it asks for what it needs itself."""

    def hear(self, name: str, now: float, content: Any) -> None:
        """Take in a record of the input of that name, recorded at a time [s]."""
        self._tell_health(now)
        if isinstance(content, Refused):
            self._counts["ignored"] += 1
        elif isinstance(content, MapRecord):
            self._hear_map(content)
        elif isinstance(content, PoseRecord):
            self._initial_pose(content)
        elif name == "scan":
            self._feed.hear_scan(content, now)
        else:
            self._feed.hear_transforms(content, is_static=name == "tf_static")
        for placed in self._feed.placed(now):
            self._step(placed)

    def finish(self) -> Result:
        """Poses that were given out, health each second, counts."""
        tables = {"poses": self._poses.table(), "health": self._health.table()}
        return Result("amcl", self._feed.facts(), counts=self._feed.counts() | self._counts, tables=tables)

    def _hear_map(self, record: MapRecord) -> None:
        is_wanted = self._params.use_map_topic and not self._params.first_map_only
        if self._has_own_map or (self._counts["maps"] and not is_wanted):
            return
        try:
            self._take_map(record.grid)
        except MapError:
            self._counts["ignored"] += 1

    def _take_map(self, grid: Grid) -> None:
        self._localizer.set_map(grid)
        self._counts["maps"] += 1

    def _initial_pose(self, record: PoseRecord) -> None:
        try:
            taken = taken_pose(
                record.pose,
                record.covariance,
                frame=record.frame,
                stamp=record.stamp,
                global_frame=self._params.global_frame_id.lstrip("/"),
                odometry=lambda stamp: self._feed.tree.lookup(self._feed.odom, self._feed.base, stamp),
            )
        except ValueError:
            self._counts["ignored"] += 1
            return
        self._counts["initial_poses"] += 1
        self._localizer.set_pose(taken.pose, taken.covariance, taken.odom_from_base)
        if self._params.force_update_after_initialpose:
            self._localizer.request_update()

    def _step(self, placed: PlacedScan) -> None:
        outcome = self._localizer.update(placed.scan, placed.odom_from_base, placed.base_from_laser)
        if not outcome.is_late:
            self._odom_from_base = placed.odom_from_base
        for name, happened in (
            ("updates", outcome.updated),
            ("resampled", outcome.resampled),
            ("late", outcome.is_late),
            ("found", outcome.is_found),
        ):
            self._counts[name] += happened
        self._note(placed.scan.stamp, outcome)

    def _note(self, stamp: float, outcome: Outcome) -> None:
        estimate = outcome.estimate
        if estimate is not None:
            spread = np.sqrt(np.maximum(np.diag(estimate.covariance), 0.0)).tolist()
            weight, count = float(estimate.cluster_weight), estimate.particles
            self._poses.add(stamp, *estimate.pose, *spread, weight, count, outcome.is_found)

    def _tell_health(self, now: float) -> None:
        if now < self._next_health:
            return
        stamp = now if math.isinf(self._next_health) else self._next_health
        self._next_health = stamp + HEALTH_S * (1.0 + math.floor((now - stamp) / HEALTH_S))
        correction, odometry = self._localizer.map_from_odom, self._odom_from_base
        if correction is None or odometry is None:
            pose: tuple[float, ...] = (math.nan, math.nan, math.nan)
        else:
            pose = compose(correction, odometry)
        trust = self._localizer.trust
        state, seeking = trust.state.name.lower(), self._localizer.is_seeking
        self._health.add(now, *pose, state, trust.belief, trust.agreement, seeking, self._feed.dropped)
