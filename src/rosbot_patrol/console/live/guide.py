"""What the set-up guide for a new house shows and does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from rosbot_patrol.console.live.orders import Answer


@dataclass(frozen=True, kw_only=True)
class ExplorationNow:
    """How the exploration stands.

    Attributes:
        state: "new", "running", "done" or "failed".
        text: its newest words.
    """

    state: str = "new"
    text: str = ""


class Exploration(Protocol):
    """Lets the robot map the house. Each call may block for some seconds."""

    def start(self) -> Answer:
        """Begin, or begin anew."""

    def stop(self) -> Answer:
        """Give up; nothing is saved."""

    @property
    def now(self) -> ExplorationNow:
        """How it stands."""


@dataclass(frozen=True, kw_only=True)
class Guide:
    """Parts of the guide.

    Attributes:
        exploration: of the house.
        map_file: that it writes, a yaml file.
        finish: ends the set-up; the guard starts instead.
    """

    exploration: Exploration
    map_file: Path
    finish: Callable[[], None]
