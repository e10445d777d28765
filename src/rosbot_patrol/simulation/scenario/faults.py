"""Kinds of faults: one declaration per kind, checked like parameters.

    fault = read_fault({"kind": "odometry_slip", "factor": 0.3, "duration": 5.0}, source="a service")

`fault_board.py` keeps the active faults and applies their effects on readings for the engine. Times are simulated time,
except the delays and drops of a sensor's link, which are real time.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from rosbot_patrol import params
from rosbot_patrol.errors import ParamError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.params import param

EVENTS = ("start", "on_guard", "driving", "looking", "returning", "home")
ALL_SENSORS = -1


def finite(value: float) -> str | None:
    """Problem of a number that is not finite, for `param(check=...)`."""
    return None if math.isfinite(value) else f"is {value}, expected a finite number"


def _finite_or_none(value: float | None) -> str | None:
    return None if value is None else finite(value)


@dataclass(frozen=True, kw_only=True)
class Timed:
    """An event at a time relative to another event."""

    at: float = param(0.0, unit="s", lo=0.0, check=finite, doc="time, counted from the event `after`")
    after: str = param("", choices=("", *EVENTS), doc="event of the patrol; empty: the scenario's own beginning")


@dataclass(frozen=True, kw_only=True)
class Fault(Timed):
    """Common part of all faults."""

    kind: ClassVar[str] = ""
    is_instant: ClassVar[bool] = False

    duration: float = param(0.0, unit="s", lo=0.0, check=finite, doc="duration of the fault; 0: until it is cleared")

    @property
    def where(self) -> str:
        """Target of the fault, "" if the kind implies it."""
        target = getattr(self, "target", "")
        return "" if target == ALL_SENSORS else str(target)

    @property
    def name(self) -> str:
        """Kind and target; of two faults with one name only one can be active."""
        return f"{self.kind} {self.where}".strip()

    def __str__(self) -> str:
        own = [f.name for f in dataclasses.fields(self) if f.name not in _COMMON]
        details = ", ".join(f"{key} {getattr(self, key):g}" for key in own)
        return f"{self.name} ({details})" if details else self.name


_COMMON = ("at", "after", "duration", "target")


@dataclass(frozen=True, kw_only=True)
class CameraFrozen(Fault):
    """The camera repeats one image, with new stamps."""

    kind: ClassVar[str] = "camera_frozen"


@dataclass(frozen=True, kw_only=True)
class CameraBlack(Fault):
    """The image is black and has no depth, as behind a cover."""

    kind: ClassVar[str] = "camera_black"


@dataclass(frozen=True, kw_only=True)
class CameraSilent(Fault):
    """The camera sends neither images nor camera_info."""

    kind: ClassVar[str] = "camera_silent"


@dataclass(frozen=True, kw_only=True)
class LidarSilent(Fault):
    """The lidar sends no scans."""

    kind: ClassVar[str] = "lidar_silent"


@dataclass(frozen=True, kw_only=True)
class BaseSilent(Fault):
    """The base's cable is pulled: neither odometry nor battery comes, and no command reaches it."""

    kind: ClassVar[str] = "base_silent"


@dataclass(frozen=True, kw_only=True)
class OdometrySlip(Fault):
    """The wheels turn as commanded; the base covers only a part of the distance."""

    kind: ClassVar[str] = "odometry_slip"
    factor: float = param(0.5, lo=0.0, hi=1.0, doc="share of the wheels' distance that the base covers")


@dataclass(frozen=True, kw_only=True)
class WheelStuck(Fault):
    """The wheels of one side do not turn."""

    kind: ClassVar[str] = "wheel_stuck"
    target: str = param(choices=("left", "right"), doc="side of the base")


@dataclass(frozen=True, kw_only=True)
class SensorFault(Fault):
    """A fault of one motion sensor."""

    target: int = param(lo=0, hi=255, doc="id of the motion sensor")


@dataclass(frozen=True, kw_only=True)
class MotionStuck(SensorFault):
    """The output stays high: the sensor triggers once and never again."""

    kind: ClassVar[str] = "motion_stuck"


@dataclass(frozen=True, kw_only=True)
class MotionSilent(SensorFault):
    """The device sends neither motion nor heartbeat; its link stays open."""

    kind: ClassVar[str] = "motion_silent"


@dataclass(frozen=True, kw_only=True)
class MotionFlapping(SensorFault):
    """The output goes up and down."""

    kind: ClassVar[str] = "motion_flapping"
    period: float = param(4.0, unit="s", lo=0.2, check=finite, doc="time from one rise to the next")

    def is_high(self, since: float) -> bool:
        """The output `since` seconds after the start: high in the first half of each period."""
        return math.fmod(since, self.period) < self.period / 2.0


@dataclass(frozen=True, kw_only=True)
class MotionRebooting(SensorFault):
    """The device restarts: its link breaks, and the sensor is blind while it warms up."""

    kind: ClassVar[str] = "motion_rebooting"
    every: float = param(0.0, unit="s", lo=0.0, check=finite, doc="interval between restarts; 0: a single restart")


@dataclass(frozen=True, kw_only=True)
class LinkPoor(Fault):
    """Frames of a sensor's TCP link are delayed or lost, and the link breaks; in real time."""

    kind: ClassVar[str] = "link_poor"
    target: int = param(ALL_SENSORS, lo=ALL_SENSORS, hi=255, doc="id of the motion sensor; -1: all")
    loss: float = param(0.0, lo=0.0, hi=1.0, doc="share of the frames that are lost")
    delay: float = param(0.0, unit="s", lo=0.0, hi=60.0, doc="delay of each frame")
    jitter: float = param(0.0, unit="s", lo=0.0, hi=60.0, doc="maximum additional delay")
    drop_every: float = param(
        0.0, unit="s", lo=0.0, check=finite, doc="mean time between two breaks of the link; 0: none"
    )


@dataclass(frozen=True, kw_only=True)
class DoorwayBlocked(Fault):
    """A box stands in a doorway: in the named one (`target`), or at x, y."""

    kind: ClassVar[str] = "doorway_blocked"
    target: str = param("", doc="name of the doorway")
    x: float | None = param(None, unit="m", check=_finite_or_none, doc="centre of the box")
    y: float | None = param(None, unit="m", check=_finite_or_none, doc="centre of the box")
    yaw: float | None = param(None, unit="rad", check=_finite_or_none, doc="direction of its width")
    width: float | None = param(None, unit="m", lo=0.05, hi=20.0, doc="size along the wall (default 0.9)")
    height: float = param(1.0, unit="m", lo=0.05, hi=3.0, doc="height above the floor")
    depth: float = param(0.3, unit="m", lo=0.02, hi=5.0, doc="size across the wall")

    def __str__(self) -> str:
        place = "" if self.x is None or self.y is None else f"({self.x:.2f}, {self.y:.2f})"
        return f"{self.name} {place}".strip()


@dataclass(frozen=True, kw_only=True)
class RobotCarried(Fault):
    """The robot is carried to another place at once; its odometry does not notice."""

    kind: ClassVar[str] = "robot_carried"
    is_instant: ClassVar[bool] = True
    x: float = param(unit="m", check=finite, doc="new position in the map frame")
    y: float = param(unit="m", check=finite, doc="new position in the map frame")
    yaw: float = param(0.0, unit="rad", check=finite, doc="new heading")

    @property
    def pose(self) -> Pose2D:
        """Pose after the move."""
        return Pose2D(self.x, self.y, self.yaw)


@dataclass(frozen=True, kw_only=True)
class Doorway:
    """A place for a box: its centre [m], the direction of the wall [rad], its width [m]."""

    x: float = param(unit="m", check=finite, doc="centre")
    y: float = param(unit="m", check=finite, doc="centre")
    yaw: float = param(0.0, unit="rad", check=finite, doc="direction of the wall")
    width: float = param(0.9, unit="m", lo=0.05, hi=20.0, doc="clear width")


_CLASSES: tuple[type[Fault], ...] = (
    CameraFrozen,
    CameraBlack,
    CameraSilent,
    LidarSilent,
    BaseSilent,
    OdometrySlip,
    WheelStuck,
    MotionStuck,
    MotionSilent,
    MotionFlapping,
    MotionRebooting,
    LinkPoor,
    DoorwayBlocked,
    RobotCarried,
)
KINDS: dict[str, type[Fault]] = {cls.kind: cls for cls in _CLASSES}


def read_fault(tree: Mapping[str, Any], *, source: str) -> Fault:
    """Read the fault that a mapping with the key `kind` describes.

    Args:
        tree: kind, target, duration and the kind's own keys.
        source: prefix of the names in messages, "FILE: faults[0]/".

    Raises:
        ParamError: the kind or a key is unknown, or a value is wrong; the text names it.
    """
    if not isinstance(tree, Mapping):
        raise ParamError(source.rstrip("/ "), f"expected the keys of a fault, got {tree!r}")
    kind = tree.get("kind")
    if kind not in KINDS:
        raise ParamError(f"{source}kind", params.unknown_name(str(kind), KINDS) if "kind" in tree else "is missing")
    fault = params.load_strict(KINDS[kind], {k: v for k, v in tree.items() if k != "kind"}, name=source)
    if isinstance(fault, DoorwayBlocked) and not fault.target and (fault.x is None or fault.y is None):
        raise ParamError(f"{source}target", "is missing: name a doorway, or say x and y")
    return fault
