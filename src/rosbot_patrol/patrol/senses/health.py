"""Where the senses tell how they are: a node's diagnostics, or nothing in a replay."""

from __future__ import annotations

from typing import Protocol

OK, WARN, ERROR = 0, 1, 2  # levels of diagnostic_msgs/DiagnosticStatus


class Health(Protocol):
    """One status for each part of a node."""

    def set(self, part: str, level: int, message: str) -> None:
        """State the health of a part."""

    def drop(self, part: str) -> None:
        """Forget a part."""


class NoHealth:
    """For a replay: nobody reads diagnostics there."""

    def set(self, part: str, level: int, message: str) -> None:
        """Do nothing."""

    def drop(self, part: str) -> None:
        """Do nothing."""
