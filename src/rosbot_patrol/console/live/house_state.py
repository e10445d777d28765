"""What the console knows of the guard and the house now."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rosbot_patrol.maps.zones import Zone
from rosbot_patrol.patrol.intruder.known_objects import KnownObject

Point = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class GuardNow:
    """What the guard does; see PatrolState.msg.

    Attributes:
        doing: idle, driving, looking, returning, starting or stopped.
        room_id, room_name: of the mission.
        origin: what called: trigger, action, all, silent_sensor or schedule.
        why: in one sentence.
        queue: rooms that wait, the next first.
        verdict: of the mission so far; last_verdict: of the mission before.
        share_seen: of the room's floor, None where nobody measures.
    """

    doing: str
    room_id: int = 0
    room_name: str = ""
    origin: str = ""
    why: str = ""
    queue: tuple[int, ...] = ()
    verdict: str = ""
    last_verdict: str = ""
    share_seen: float | None = None


@dataclass(frozen=True, kw_only=True)
class ArmingNow:
    """What is armed; see Arming.msg."""

    mode: str
    rooms: tuple[int, ...] | None = None  # None: all
    exit_delay: float = 0.0
    entry_delay: float = 0.0
    is_quiet: bool = False
    why: str = ""
    muted: tuple[tuple[int, float], ...] = ()  # rooms, and until when, in seconds since 1970


@dataclass(frozen=True, kw_only=True)
class SensorNow:
    """One motion sensor; see SensorState.msg."""

    id: int
    name: str
    room_id: int | None
    state: str
    heard: float | None  # [s] ago
    motion: float | None  # [s] ago
    text: str


@dataclass(frozen=True, kw_only=True)
class BatteryNow:
    """Share from 0 to 1, None where it is unknown; voltage [V]."""

    share: float | None
    voltage: float | None
    is_charging: bool


@dataclass(frozen=True, kw_only=True)
class Problem:
    """Something that a node's diagnostics warn of."""

    name: str
    text: str
    is_error: bool


@dataclass(frozen=True, kw_only=True)
class RoomMark:
    """A room on the map: number, name, the point to look from [m]."""

    id: int
    name: str
    x: float
    y: float


@dataclass(frozen=True, kw_only=True)
class Call:
    """The last motion that a sensor reported: its id, and when by the steady clock [s]."""

    sensor: int
    at: float


@dataclass(frozen=True, kw_only=True)
class HouseState:
    """Everything that changes seldom.

    Attributes:
        guard, arming, battery: None before they were heard.
        is_heard: the patrol gives signs of life.
        is_stopped: the emergency stop is pressed.
        sensors: all that are watched.
        problems: warnings and errors, by name.
        incidents: counts up with each change of the incidents on record.
        rooms, zones, known: of the house's files.
        house: counts up with each change of those files.
        calls: of each sensor, the newest last.
        devices: that were heard lately: lidar, base, camera.
    """

    guard: GuardNow | None = None
    arming: ArmingNow | None = None
    battery: BatteryNow | None = None
    is_heard: bool = False
    is_stopped: bool = False
    sensors: tuple[SensorNow, ...] = ()
    problems: Mapping[str, Problem] = field(default_factory=dict)
    incidents: int = 0
    rooms: tuple[RoomMark, ...] = ()
    zones: tuple[Zone, ...] = ()
    known: tuple[KnownObject, ...] = ()
    house: int = 0
    calls: tuple[Call, ...] = ()
    devices: frozenset[str] = frozenset()

    @property
    def worst_first(self) -> list[Problem]:
        """The problems, errors before warnings, each by name."""
        return sorted(self.problems.values(), key=lambda each: (not each.is_error, each.name))


@dataclass(frozen=True, kw_only=True)
class Box:
    """A detected object in the camera's picture: corners [px], class, probability."""

    xmin: int
    ymin: int
    xmax: int
    ymax: int
    label: str
    probability: float


@dataclass(frozen=True, kw_only=True)
class SeenFloor:
    """Floor that was seen: a picture (PNG in base64) and the corners of its place in map [m]."""

    png: str
    left: float
    bottom: float
    right: float
    top: float


@dataclass(frozen=True, kw_only=True)
class Scene:
    """What moves, while somebody looks.

    Attributes:
        robot: x [m], y [m], yaw [rad] in map.
        path: of the robot to its goal [m].
        people: places of persons in this mission [m].
        seen: floor that was seen in this mission, None for none.
        boxes: of the newest picture that the detector looked at.
        picture_size: columns and rows of that picture.
    """

    robot: tuple[float, float, float] | None = None
    path: tuple[Point, ...] = ()
    people: tuple[Point, ...] = ()
    seen: SeenFloor | None = None
    boxes: tuple[Box, ...] = ()
    picture_size: tuple[int, int] = (640, 480)
