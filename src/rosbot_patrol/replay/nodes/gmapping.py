"""slam_gmapping over a bag: its node's core, fed with the bag's records."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Collection, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.gmapping.core import GmappingCore, Step
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.maps.known_part import known_part
from rosbot_patrol.replay.bags.records import KINDS
from rosbot_patrol.replay.results.comparison import Field
from rosbot_patrol.replay.results.tables import STAMP, Result, Rows, Table
from rosbot_patrol.replay.runner import TF_TYPES, Input
from rosbot_patrol.tf.tree import Edge, TransformTree

INPUTS = (
    Input(name="scan", types=("sensor_msgs/LaserScan",)),
    Input(name="tf", types=TF_TYPES),
    Input(name="tf_static", types=TF_TYPES, is_needed=False),
)

FIELDS = {
    **{f"{table}.{axis}": Field(tolerance=0.05, unit="m") for table in ("poses", "trajectory") for axis in "xy"},
    **{
        f"{table}.yaw": Field(tolerance=math.radians(1.0), unit="rad", is_angle=True)
        for table in ("poses", "trajectory")
    },
    "poses.entropy": Field(tolerance=1.0),
    "poses.effective": Field(tolerance=10.0),
    "poses.failed": Field(tolerance=3),
    "maps.known": Field(tolerance=200, unit="cells"),
    "maps.occupied": Field(tolerance=50, unit="cells"),
    "counts.resampled": Field(tolerance=5),
    "maps.digest": Field(tolerance=math.inf),  # the maps themselves are compared at the end
    "map": Field(tolerance=0.02),
}


class GmappingReplay:
    """A GmappingCore on the bag's clock.

    Args:
        params: slam_gmapping's parameters; with `map_file` a saved map is continued.
        static: transforms that the bag lacks.

    Raises:
        MapError: the extent or the saved map is invalid.
    """

    inputs = INPUTS
    kinds = KINDS

    def __init__(self, params: GmappingParams, *, static: Iterable[Edge] = ()) -> None:
        self._tree = TransformTree()
        self._tree.add_all(static, is_static=True)
        self._core = GmappingCore(params, self._tree)
        self._counts = {"updates": 0, "resampled": 0, "blind": 0}
        self._poses = Rows(STAMP, "x", "y", "yaw", "entropy", "effective", "failed")
        self._maps = Rows(STAMP, "known", "occupied", "digest")

    def begin(self, names: Collection[str]) -> None:
        """Ignore the list of inputs: the core asks for what it needs."""

    def hear(self, name: str, now: float, content: Any) -> None:
        """Process a record of the named input, recorded at a time [s]."""
        feed = self._core.feed
        if name != "scan":
            self._tree.add_all(content, is_static=name == "tf_static")
        elif self._core.is_wanted():
            feed.hear(content, now)
        for placed in feed.placed(now):
            self._note(self._core.step(placed))

    def finish(self) -> Result:
        """The best pose at each update, the intermediate maps, the best particle's trajectory and map."""
        tables = {"poses": self._poses.table(), "maps": self._maps.table(), "trajectory": self._trajectory()}
        feed = self._core.feed
        grid = self._core.slam.grid()
        maps = {"map": known_part(grid, grid.info.resolution)}
        return Result("slam_gmapping", feed.facts(), feed.counts() | self._counts, tables, maps)

    def _note(self, step: Step) -> None:
        outcome, slam = step.outcome, self._core.slam
        self._counts["blind"] += outcome.is_blind
        if not outcome.updated:
            return
        self._counts["updates"] += 1
        self._counts["resampled"] += outcome.resampled
        pose = slam.poses[slam.best].tolist()
        self._poses.add(step.stamp, *pose, slam.entropy, outcome.effective, outcome.failed)
        if step.grid is not None:
            self._note_map(step.stamp, step.grid.cells)

    def _note_map(self, stamp: float, cells: NDArray[np.int8]) -> None:
        digest = hashlib.sha256(np.ascontiguousarray(cells).tobytes()).hexdigest()[:12]
        known, occupied = int(np.count_nonzero(cells >= 0)), int(np.count_nonzero(cells == 100))
        self._maps.add(stamp, known, occupied, digest)

    def _trajectory(self) -> Table:
        if not self._core.slam.stamps:
            return Rows(STAMP, "x", "y", "yaw").table()
        x, y, yaw = self._core.slam.trajectory.T
        return {STAMP: np.array(self._core.slam.stamps), "x": x, "y": y, "yaw": yaw}
