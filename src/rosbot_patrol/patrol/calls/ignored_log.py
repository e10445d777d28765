"""Log of calls that started no mission, one JSON line each: of a disarmed house, or caused by the robot itself."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

from rosbot_patrol.patrol.records.commands import Ignored

MOST = 1 << 20  # [bytes] at which the file becomes the old one


class IgnoredLog:
    """A log file and its predecessor.

    Args:
        path: of the file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def add(self, calls: tuple[Ignored, ...]) -> None:
        """Write some calls. Raises OSError."""
        if self._path.exists() and self._path.stat().st_size > MOST:
            self._path.replace(self._path.with_suffix(".old.jsonl"))
        with self._path.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(dataclasses.asdict(call), ensure_ascii=False) + "\n" for call in calls)
