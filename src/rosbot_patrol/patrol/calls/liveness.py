"""Time until which the patrol listened: after a restart it tells which calls were missed."""

from __future__ import annotations

import math
import os
from pathlib import Path

_EVERY = 1.0  # time between two signs of life [s]
DOWN = 60.0  # a longer gap is no restart of the node [s]
_SLACK = 0.3  # largest delay of clocks and messages [s]


class Vigil:
    """Signs of life as a file's modification time; nothing else is written.

    Args:
        path: of the file; its folder is created.
        wall: seconds since 1970 now: from here on calls are heard.
        most: longest gap that is evaluated [s].

    Attributes:
        down: when the last sign of life was, if the gap is longer than a node's restart; seconds since 1970, else None.
        problem: reason why the file cannot be read or created, "" if it can; `step` keeps trying.
    """

    def __init__(self, path: Path, wall: float, most: float = 3600.0) -> None:
        self._path, self._began, self._touched = path, wall, -math.inf
        self._gone: float | None = None
        self.down: float | None = None
        self.problem = ""
        try:
            gone = path.stat().st_mtime if path.exists() else -math.inf
            if 0.0 <= wall - gone <= most:  # else the gap is too long, or the clock was set
                self._gone = gone
            if DOWN <= wall - gone < math.inf:
                self.down = gone
            self.step(wall)
        except OSError as err:
            self.problem = str(err)

    @property
    def has_gap(self) -> bool:
        """Whether there was a time without a listener."""
        return self._gone is not None

    def step(self, wall: float) -> None:
        """Write a sign of life if it is due. Raises OSError."""
        if not 0.0 <= wall - self._touched < _EVERY:
            self._touched = wall
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._path.touch()
            os.utime(self._path, (wall, wall))

    def end(self) -> None:
        """Record an orderly end: later calls are not missed."""
        self._path.unlink(missing_ok=True)

    def missed(self, wall: float) -> bool:
        """Whether a call at a time (seconds since 1970) came while nobody listened."""
        return self._gone is not None and self._gone - _SLACK <= wall <= self._began + _SLACK
