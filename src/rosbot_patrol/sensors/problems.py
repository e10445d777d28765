"""What can be wrong with a motion sensor or its bridge, and the record of one such thing."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Kind(Enum):
    """Values are those of SensorEvent; the worst comes first."""

    PATROL_GONE = "patrol_gone"
    SILENT = "silent"
    BRIDGE_GONE = "bridge_gone"
    DUPLICATE_ID = "duplicate_id"
    WRONG_PEER = "wrong_peer"
    FLAPPING = "flapping"
    STUCK_ON = "stuck_on"
    NO_MOTION = "no_motion"
    UNKNOWN_ID = "unknown_id"
    CLOCK_OFF = "clock_off"


SERIOUS = frozenset({Kind.PATROL_GONE, Kind.SILENT, Kind.BRIDGE_GONE, Kind.DUPLICATE_ID, Kind.WRONG_PEER})


@dataclass(frozen=True, order=True)
class Key:
    """What it is about: a kind, and a sensor's id, or -1 and a node: a bridge, the patrol."""

    kind_name: str
    sensor_id: int = -1
    bridge: str = ""

    @property
    def kind(self) -> Kind:
        """The kind."""
        return Kind(self.kind_name)

    def __str__(self) -> str:
        return f"{self.kind_name}/{self.bridge if self.sensor_id < 0 else self.sensor_id}"


def sensor_key(kind: Kind, sensor_id: int) -> Key:
    """The key of a sensor's problem."""
    return Key(kind.value, sensor_id)


def bridge_key(kind: Kind, bridge: str) -> Key:
    """The key of a bridge's problem."""
    return Key(kind.value, bridge=bridge)


@dataclass(frozen=True, kw_only=True)
class Problem:
    """One thing that is wrong.

    Attributes:
        key: what it is about.
        since: begin, on the supervisor's own clock [s]; of a silence, when it was last heard.
        what: in words that follow "sensor 3 ...": "is silent: nothing heard for 12 s".
        bridge: that the sensor was last heard through, "" where no bridge says.
    """

    key: Key
    since: float
    what: str
    bridge: str = ""


@dataclass(frozen=True, kw_only=True)
class Event:
    """A problem has begun (`active`) or is over; `lasted` [s]; `text` is one sentence for people."""

    problem: Problem
    active: bool
    lasted: float
    text: str


@dataclass(frozen=True, kw_only=True)
class Link:
    """One connection on which a bridge hears a sensor.

    Attributes:
        sensor_id: that it reports; peer: "ADDRESS:PORT"; proven: it has shown its key.
        heard: seconds since its last message; messages, triggers: how many came.
        is_stuck: the device says that its sensor's output has been high for long.
        clock_offset: how far the device's clock is ahead of the bridge's [s], None where it does not tell.
    """

    sensor_id: int
    peer: str
    heard: float = 0.0
    messages: int = 0
    triggers: int = 0
    proven: bool = False
    is_stuck: bool = False
    clock_offset: float | None = None

    @property
    def host(self) -> str:
        """The peer's address without its port, or the path of the serial device."""
        if self.peer.startswith("["):
            return self.peer[1:].partition("]")[0]
        return self.peer.rpartition(":")[0] if self.peer.count(":") == 1 else self.peer


def duration(seconds: float) -> str:
    """For people: "40 s", "12 min", "3 h 5 min", "2 days"."""
    seconds = max(seconds, 0.0)
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    if minutes < 120:
        return f"{minutes} min"
    if minutes < 48 * 60:
        return f"{minutes // 60} h" + (f" {minutes % 60} min" if minutes % 60 else "")
    return f"{minutes // (24 * 60)} days"
