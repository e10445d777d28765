"""Scans of a bag, each handed out once tf tells where the robot was: as amcl's and slam_gmapping's nodes take them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rosbot_patrol.scan import LaserScan, level_scan, scan_problem
from rosbot_patrol.scan_line import PlacedScan, ScanLine
from rosbot_patrol.tf.tree import Edge, TransformTree


class ScanFeed:
    """tf and the line of scans that wait for it.

    Args:
        odom: frame of the odometry.
        base: frame of the robot.
        size: most scans that wait.
    """

    def __init__(self, odom: str, base: str, size: int = 100) -> None:
        self.odom, self.base = odom.lstrip("/"), base.lstrip("/")
        self.tree = TransformTree()
        self._line = ScanLine(self._place, size)
        self.heard = self.refused = 0
        self.problem = ""  # why the last scan was left out or dropped

    @property
    def dropped(self) -> int:
        """Scans that tf could not place."""
        return self._line.dropped

    @property
    def waiting(self) -> int:
        """Scans that wait."""
        return len(self._line)

    def hear_transforms(self, edges: Iterable[Edge], *, is_static: bool = False) -> None:
        """Take in what /tf or /tf_static says."""
        for edge in edges:
            self.tree.add(edge, is_static=is_static)

    def hear_scan(self, scan: LaserScan, now: float) -> None:
        """Let a scan that was recorded at a time [s] wait; one that cannot be used is left out."""
        self.heard += 1
        problem = scan_problem(scan)
        if problem:
            self.refused += 1
            self.problem = f"scan of frame '{scan.frame_id}': {problem}"
            return
        self._line.put(scan, now)

    def placed(self, now: float) -> Iterator[PlacedScan]:
        """All scans that can be taken in now, in their order."""
        while self._line:
            found = self._line.take(now)
            self.problem = self._line.problem or self.problem
            if found is None:
                return
            yield found

    def counts(self) -> dict[str, int]:
        """How many scans came, and what became of those that were not taken in."""
        return {"scans": self.heard, "refused": self.refused, "dropped": self.dropped, "waiting": self.waiting}

    def facts(self) -> dict[str, str]:
        """Why the last scan was left out, where one was."""
        return {"left out": self.problem} if self.problem else {}

    def _place(self, scan: LaserScan) -> PlacedScan:
        level = level_scan(scan, self.tree.transform(self.base, scan.frame_id), self.base)
        return PlacedScan(level.scan, self.tree.lookup(self.odom, self.base, scan.stamp), level.pose)
