"""Scans of one topic: judged, then handed out level once the odometry at their stamp is known.

The nodes amcl and slam_gmapping and their replays take scans in this way.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator

from rosbot_patrol.counts import count_of
from rosbot_patrol.scan import LaserScan, level_scan
from rosbot_patrol.scan_check import ScanCheck
from rosbot_patrol.scan_line import PlacedScan, ScanLine
from rosbot_patrol.tf.frames import Frames

log = logging.getLogger(__name__)

_REPEAT = 10.0  # between two lines about a changed number of beams [s]


class ScanFeed:
    """Scans in, placed scans out. One thread may call `hear` while another calls `take`.

    Args:
        frames: transforms.
        odom: frame of the odometry.
        base: frame of the robot.
        lost: what does not happen without scans, such as "nothing is mapped".
        size: maximum number of waiting scans; the oldest is dropped first.

    Attributes:
        check: says why scans are left out.
        heard: number of scans that arrived.
        refused: number of unusable scans.
        left_out: reason for the last unusable or dropped scan, "" before the first.
    """

    def __init__(self, frames: Frames, odom: str, base: str, *, lost: str, size: int = 100) -> None:
        self.odom, self.base = odom.lstrip("/"), base.lstrip("/")
        self.check = ScanCheck(lost)
        self.heard = self.refused = 0
        self.left_out = ""
        self._frames = frames
        self._line = ScanLine(self._place, size)
        self._beams: dict[str, int] = {}  # of the last scan of each frame
        self._logged_at = -math.inf

    def __len__(self) -> int:
        """Number of scans that wait."""
        return len(self._line)

    @property
    def dropped(self) -> int:
        """Number of scans that could never be placed."""
        return self._line.dropped

    @property
    def problem(self) -> str:
        """Why the last dropped scan could not be placed, "" if the newest could."""
        return self._line.problem

    def hear(self, scan: LaserScan, now: float, arrival: float | None = None) -> bool:
        """Let a scan wait; False if it is unusable and ignored.

        Args:
            scan: as measured.
            now: time [s], for what is logged.
            arrival: time [s] on a clock that never goes back, the one given to `take`; None: `now`.
        """
        self.heard += 1
        if not self.check.accepts(scan, now):
            self.refused += 1
            self.left_out = self.check.problem
            return False
        self.check.clear(now)
        self._watch_beams(scan, now)
        self._line.put(scan, now if arrival is None else arrival)
        return True

    def take(self, now: float) -> PlacedScan | None:
        """Take the oldest scan that can be placed, None if none can be now; `now` [s] as the arrivals."""
        found = self._line.take(now)
        self.left_out = self._line.problem or self.left_out
        return found

    def placed(self, now: float) -> Iterator[PlacedScan]:
        """Take all scans that can be placed now, in their order."""
        while self._line and (found := self.take(now)) is not None:
            yield found

    def counts(self) -> dict[str, int]:
        """Number of scans that arrived, and what became of those that were not used."""
        return {"scans": self.heard, "refused": self.refused, "dropped": self.dropped, "waiting": len(self)}

    def facts(self) -> dict[str, str]:
        """Reason why the last scan was ignored, if one was."""
        return {"left out": self.left_out} if self.left_out else {}

    def _watch_beams(self, scan: LaserScan, now: float) -> None:
        beams = len(scan.ranges)
        before, self._beams[scan.frame_id] = self._beams.get(scan.frame_id, beams), beams
        if beams != before and abs(now - self._logged_at) > _REPEAT:
            self._logged_at = now
            many = count_of(beams, "beam")
            log.warning("scan of frame '%s': it has %s, %d before; it is taken as it is", scan.frame_id, many, before)

    def _place(self, scan: LaserScan) -> PlacedScan:
        level = level_scan(scan, self._frames.transform(self.base, scan.frame_id), self.base)
        return PlacedScan(level.scan, self._frames.lookup(self.odom, self.base, scan.stamp), level.pose)
