"""Kinds of problems of motion sensors, bridges and the ROS graph, and the record of one problem."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from rosbot_patrol.graph.judge import Fault


class Kind(Enum):
    """Kind of a problem, the worst first; values are those of SensorEvent."""

    PATROL_GONE = "patrol_gone"
    MASTER_GONE = Fault.MASTER_GONE.value
    SECOND_DRIVER = Fault.SECOND_DRIVER.value
    SECOND_WITNESS = Fault.SECOND_WITNESS.value
    STRANGE_NODE = Fault.STRANGE_NODE.value
    LINK_GONE = Fault.LINK_GONE.value
    SETTINGS_CHANGED = Fault.SETTINGS_CHANGED.value
    SILENT = "silent"
    BRIDGE_GONE = "bridge_gone"
    DUPLICATE_ID = "duplicate_id"
    WRONG_PEER = "wrong_peer"
    NEW_ADDRESS = "new_address"
    FLAPPING = "flapping"
    STUCK_ON = "stuck_on"
    NO_MOTION = "no_motion"
    UNKNOWN_ID = "unknown_id"
    CLOCK_OFF = "clock_off"


OF_GRAPH = frozenset(
    {
        Kind.MASTER_GONE,
        Kind.SECOND_DRIVER,
        Kind.SECOND_WITNESS,
        Kind.STRANGE_NODE,
        Kind.LINK_GONE,
        Kind.SETTINGS_CHANGED,
    }
)
SERIOUS = OF_GRAPH | {Kind.PATROL_GONE, Kind.SILENT, Kind.BRIDGE_GONE, Kind.DUPLICATE_ID, Kind.WRONG_PEER}


@dataclass(frozen=True, order=True)
class Key:
    """Identity of a problem: its kind, and a sensor's id, or -1 and a node (a bridge, the patrol).

    A problem of the graph has -1 and what it is about, in words.
    """

    kind_name: str
    sensor_id: int = -1
    bridge: str = ""

    @property
    def kind(self) -> Kind:
        """Kind of the problem."""
        return Kind(self.kind_name)

    def __str__(self) -> str:
        return f"{self.kind_name}/{self.bridge if self.sensor_id < 0 else self.sensor_id}"


def sensor_key(kind: Kind, sensor_id: int) -> Key:
    """Key of a sensor's problem."""
    return Key(kind.value, sensor_id)


def bridge_key(kind: Kind, bridge: str) -> Key:
    """Key of a bridge's problem."""
    return Key(kind.value, bridge=bridge)


@dataclass(frozen=True, kw_only=True)
class Problem:
    """One problem.

    Attributes:
        key: its identity.
        since: begin on the supervisor's own clock [s]; of a silence, the last message.
        what: in words that follow "sensor 3 ...": "is silent: nothing heard for 12 s".
        bridge: over which the sensor was last heard, "" if unknown.
    """

    key: Key
    since: float
    what: str
    bridge: str = ""


@dataclass(frozen=True, kw_only=True)
class Event:
    """Begin (`active`) or end of a problem; `lasted` [s]; `text` is one sentence for people."""

    problem: Problem
    active: bool
    lasted: float
    text: str


@dataclass(frozen=True, kw_only=True)
class Link:
    """One connection over which a bridge hears a sensor.

    Attributes:
        sensor_id: that it reports; peer: "ADDRESS:PORT"; proven: it has shown its key.
        heard: seconds since its last message; messages, triggers: how many came.
        is_stuck: the device reports that its sensor's output has been high for long.
        clock_offset: lead of the device's clock over the bridge's [s], None if unknown.
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
    """Duration for people: "40 s", "12 min", "3 h 5 min", "2 days"."""
    seconds = max(seconds, 0.0)
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    if minutes < 120:
        return f"{minutes} min"
    if minutes < 48 * 60:
        return f"{minutes // 60} h" + (f" {minutes % 60} min" if minutes % 60 else "")
    return f"{minutes // (24 * 60)} days"
