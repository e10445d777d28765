"""Calls that started no mission, one JSON line each: what a disarmed house's sensors saw, or those the robot passed."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

from rosbot_patrol.patrol.records.commands import Ignored

MOST = 1 << 20  # [bytes] before the file becomes the old one


class IgnoredLog:
    """A file and the one before it.

    Args:
        path: of the file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def add(self, calls: tuple[Ignored, ...]) -> None:
        """Write some down. Raises OSError."""
        if self._path.exists() and self._path.stat().st_size > MOST:
            self._path.replace(self._path.with_suffix(".old.jsonl"))
        with self._path.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(dataclasses.asdict(call), ensure_ascii=False) + "\n" for call in calls)
