"""Until when the patrol listened, so that after a restart it is known which calls it cannot have heard."""

from __future__ import annotations

import math
import os
from pathlib import Path

_EVERY = 1.0  # between two signs of life [s]
_SLACK = 0.3  # clocks and messages are late by so much at most [s]


class Vigil:
    """Signs of life in a file's time of change; no more than that is written.

    Args:
        path: of the file; its folder is made.
        wall: seconds since 1970, now: from here on calls are heard.
        most: a gap that is longer than that is not looked into [s].

    Attributes:
        problem: why the file cannot be read or made, "" where it can; `step` tries on.
    """

    def __init__(self, path: Path, wall: float, most: float = 3600.0) -> None:
        self._path, self._began, self._touched = path, wall, -math.inf
        self._gone: float | None = None
        self.problem = ""
        try:
            gone = path.stat().st_mtime if path.exists() else -math.inf
            if 0.0 <= wall - gone <= most:  # else for too long, or the clock was set
                self._gone = gone
            self.step(wall)
        except OSError as err:
            self.problem = str(err)

    @property
    def has_gap(self) -> bool:
        """Whether there was a time in which nobody listened."""
        return self._gone is not None

    def step(self, wall: float) -> None:
        """Give a sign of life where one is due. Raises OSError."""
        if not 0.0 <= wall - self._touched < _EVERY:
            self._touched = wall
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._path.touch()
            os.utime(self._path, (wall, wall))

    def end(self) -> None:
        """It was ended in order: what is called from now on is not missed."""
        self._path.unlink(missing_ok=True)

    def missed(self, wall: float) -> bool:
        """Whether a call at a time (seconds since 1970) came when nobody listened."""
        return self._gone is not None and self._gone - _SLACK <= wall <= self._began + _SLACK
