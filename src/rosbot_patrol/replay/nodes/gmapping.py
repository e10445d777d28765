"""slam_gmapping over a bag: its Slam, fed as its node feeds it.

Scans wait for the odometry of their stamp, every `throttle_scans`-th is taken in, and a map is made at most once in
`map_update_interval`.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Collection, Iterable
from typing import Any

import numpy as np

from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.gmapping.slam import Outcome
from rosbot_patrol.gmapping.start import started
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.replay.bags.records import KINDS
from rosbot_patrol.replay.nodes.scan_feed import ScanFeed
from rosbot_patrol.replay.results.tables import STAMP, Result, Rows, Table
from rosbot_patrol.replay.runner import TF_TYPES, Field, Input
from rosbot_patrol.scan_line import PlacedScan
from rosbot_patrol.tf.tree import Edge

INPUTS = (
    Input(name="scan", types=("sensor_msgs/LaserScan",)),
    Input(name="tf", types=TF_TYPES),
    Input(name="tf_static", types=TF_TYPES, is_needed=False),
)
WAITING = 50  # scans, as the node's

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
    """A Slam and the decisions of its node.

    Args:
        params: of slam_gmapping; with `map_file` a saved map is gone on with.
        static: transforms that the bag lacks.

    Raises:
        MapError: the extent or the saved map makes no sense.
    """

    inputs = INPUTS
    kinds = KINDS

    def __init__(self, params: GmappingParams, *, static: Iterable[Edge] = ()) -> None:
        self._params = params
        self._slam = started(params)
        self._feed = ScanFeed(params.odom_frame, params.base_frame, WAITING)
        self._feed.hear_transforms(static, is_static=True)
        self._heard = 0
        self._map_stamp = -math.inf
        self._counts = {"updates": 0, "resampled": 0, "blind": 0}
        self._poses = Rows(STAMP, "x", "y", "yaw", "entropy", "effective", "failed")
        self._maps = Rows(STAMP, "known", "occupied", "digest")

    def begin(self, names: Collection[str]) -> None:
        """Which of the inputs will be heard: it asks for what it needs itself."""

    def hear(self, name: str, now: float, content: Any) -> None:
        """Take in a record of the input of that name, recorded at a time [s]."""
        if name == "scan":
            self._heard += 1
            if (self._heard - 1) % self._params.throttle_scans == 0:
                self._feed.hear_scan(content, now)
        else:
            self._feed.hear_transforms(content, is_static=name == "tf_static")
        for placed in self._feed.placed(now):
            self._step(placed)

    def finish(self) -> Result:
        """The best pose at each update, the maps on the way, the best particle's whole way and its map."""
        tables = {"poses": self._poses.table(), "maps": self._maps.table(), "trajectory": self._trajectory()}
        counts = self._feed.counts() | self._counts
        maps = {"map": known_part(self._slam.grid())}
        return Result("slam_gmapping", self._feed.facts(), counts, tables, maps)

    def _step(self, placed: PlacedScan) -> None:
        outcome = self._slam.update(placed.scan, placed.odom_from_base, placed.base_from_laser)
        if not outcome.updated:
            self._counts["blind"] += outcome.is_blind
            return
        self._note(placed.scan.stamp, outcome)
        since = placed.scan.stamp - self._map_stamp
        if since > self._params.map_update_interval or since < 0.0:
            self._map_stamp = placed.scan.stamp
            self._note_map(placed.scan.stamp)

    def _note(self, stamp: float, outcome: Outcome) -> None:
        self._counts["updates"] += 1
        self._counts["resampled"] += outcome.resampled
        self._counts["blind"] += outcome.is_blind
        pose = self._slam.poses[self._slam.best].tolist()
        self._poses.add(stamp, *pose, self._slam.entropy, outcome.effective, outcome.failed)

    def _note_map(self, stamp: float) -> None:
        cells = self._slam.grid().cells
        digest = hashlib.sha256(np.ascontiguousarray(cells).tobytes()).hexdigest()[:12]
        known, occupied = int(np.count_nonzero(cells >= 0)), int(np.count_nonzero(cells == 100))
        self._maps.add(stamp, known, occupied, digest)

    def _trajectory(self) -> Table:
        if not self._slam.stamps:
            return Rows(STAMP, "x", "y", "yaw").table()
        x, y, yaw = self._slam.trajectory.T
        return {STAMP: np.array(self._slam.stamps), "x": x, "y": y, "yaw": yaw}


def known_part(grid: Grid) -> Grid:
    """What is known of a map, cut out with a cell of margin; one cell where nothing is known."""
    rows, columns = (np.flatnonzero((grid.cells >= 0).any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return Grid(_cut(grid, 0, 0, 1, 1), grid.cells[:1, :1].copy())
    y0, y1 = max(int(rows[0]) - 1, 0), min(int(rows[-1]) + 2, grid.info.height)
    x0, x1 = max(int(columns[0]) - 1, 0), min(int(columns[-1]) + 2, grid.info.width)
    return Grid(_cut(grid, x0, y0, x1 - x0, y1 - y0), grid.cells[y0:y1, x0:x1].copy())


def _cut(grid: Grid, x0: int, y0: int, width: int, height: int) -> GridInfo:
    info = grid.info
    x, y = info.origin_x + x0 * info.resolution, info.origin_y + y0 * info.resolution
    return GridInfo(resolution=info.resolution, width=width, height=height, origin_x=x, origin_y=y, yaw=info.yaw)
