"""Check of the scans of one topic, which logs each problem once."""

from __future__ import annotations

import logging
import math

from rosbot_patrol.scan import LaserScan, scan_problem

log = logging.getLogger(__name__)

_WELL = 10.0  # time without a problem after which it is logged again [s]
_SAID = 20  # maximum number of problems remembered


class ScanCheck:
    """Judges the scans of one topic and logs each problem once. Times [s] are of one clock.

    Args:
        lost: effect of missing scans, such as "the base creeps".

    Attributes:
        problem: reason why the newest scan was ignored, "" if it was used.
        lost: as given.
    """

    def __init__(self, lost: str) -> None:
        self.problem = ""
        self.lost = lost
        self._said: set[str] = set()
        self._bad_at = self._good_at = -math.inf

    def accepts(self, scan: LaserScan, now: float) -> bool:
        """Whether a scan is usable; refuse it if not."""
        problem = scan_problem(scan)
        if problem:
            self.refuse(f"the scan of frame '{scan.frame_id}' is left out: {problem}", now)
        return not problem

    def clear(self, now: float) -> None:
        """Note that the newest scan was used."""
        self.problem, self._good_at = "", now
        if self._said and abs(now - self._bad_at) > _WELL:
            self._said.clear()
            log.info("scans can be used again")

    def refuse(self, problem: str, now: float) -> None:
        """Ignore the newest scan for another reason, such as a tilted laser."""
        self.problem, self._bad_at = problem, now
        if problem in self._said:
            return
        if len(self._said) >= _SAID:
            self._said.clear()
        self._said.add(problem)
        log.warning("%s; %s", problem, self.lost)

    def lasts(self, now: float, patience: float) -> bool:
        """Whether scans have arrived but none was usable for some time [s]."""
        return bool(self.problem) and abs(now - self._good_at) > patience
