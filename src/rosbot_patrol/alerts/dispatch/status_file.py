"""State of the channels, left in the outbox by the program that delivers: `notify` and the other programs read it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from rosbot_patrol.alerts.dispatch.delivery import ChannelStatus
from rosbot_patrol.errors import StateError
from rosbot_patrol.files import read_json, write_json

NAME = "status.json"
_FIELDS = {field.name for field in fields(ChannelStatus)}


@dataclass(frozen=True, kw_only=True)
class PostStatus:
    """State of the program that delivers.

    Attributes:
        wall: time of the state, seconds since 1970.
        who: the program.
        channels: their states.
    """

    wall: float
    who: str
    channels: tuple[ChannelStatus, ...]


def write_status(folder: Path, *, wall: float, who: str, channels: Sequence[ChannelStatus]) -> None:
    """Write the state of the channels. Raises OSError."""
    write_json(folder / NAME, {"wall": wall, "who": who, "channels": [asdict(status) for status in channels]})


def read_status(folder: Path) -> PostStatus | None:
    """The last state that was written; None if there is none that makes sense."""
    try:
        tree = read_json(folder / NAME) or {}
        return PostStatus(
            wall=float(tree["wall"]),
            who=str(tree["who"]),
            channels=tuple(_channel_status(channel) for channel in tree["channels"]),
        )
    except (StateError, KeyError, TypeError, ValueError, AttributeError):
        return None


def _channel_status(tree: dict[str, Any]) -> ChannelStatus:
    return ChannelStatus(**{name: tree[name] for name in _FIELDS & tree.keys()})
