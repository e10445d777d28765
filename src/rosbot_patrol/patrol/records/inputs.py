"""Inputs of the patrol in each step: plain records."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.goal import GoalLink
from rosbot_patrol.patrol.house.regions import RoomRegions
from rosbot_patrol.patrol.records.request import Request
from rosbot_patrol.scan import LaserScan

_SLACK = 3.0, 0.1  # tolerance of a detector's boxes: pixels, and share of the height (yolo-fastest: 99 %)


@dataclass(frozen=True, kw_only=True)
class Measured:
    """Measurement of a box's object in space.

    Attributes:
        x: place in map [m]; y: likewise.
        error: approximate error of the place [m].
        away: distance from the camera over the floor [m].
        top: height of the object's top over the floor [m]; height, width: of its visible part [m].
        is_cut: the box ends about the picture's upper edge, or at its lower one: there may be more of it.
        is_cut_above: there may be more of it above the picture.
        is_cut_aside: the box touches the left or right image border: the place is that of the visible part.
        is_flat: all of it lies in one plane, None without depth.
        has_legs: of what goes on above the picture: it stands as a person does, where the map shows nothing; None where
            that is not known.
        source: of the distance: "depth", "lidar" or "floor" (the box's lower edge).
    """

    x: float
    y: float
    error: float
    away: float
    top: float
    height: float
    width: float
    is_cut: bool = False
    is_cut_above: bool = False
    is_cut_aside: bool = False
    is_flat: bool | None = None
    has_legs: bool | None = None
    source: str = "depth"


@dataclass(frozen=True, kw_only=True)
class Box:
    """One object in one picture: class, probability, corners [px], and its place if known.

    Attributes:
        measured: place and size.
        doubt: its possible place x, y in map [m], if it is too far away now but measurable from close by.
    """

    label: str
    probability: float
    xmin: int
    ymin: int
    xmax: int
    ymax: int
    measured: Measured | None = None
    doubt: tuple[float, float] | None = None

    @property
    def width(self) -> int:
        """Width [px]."""
        return self.xmax - self.xmin

    @property
    def height(self) -> int:
        """Height [px]."""
        return self.ymax - self.ymin

    @property
    def slack(self) -> float:
        """Tolerance of its upper and lower edges [px]."""
        return _SLACK[0] + _SLACK[1] * self.height


@dataclass(frozen=True, kw_only=True)
class Eye:
    """Pose and view of a camera at the time of a picture.

    Attributes:
        pose: in map.
        width: horizontal field of view [rad].
        columns: width of the picture [px].
    """

    pose: Pose2D
    width: float
    columns: int = 640

    def bearing(self, column: float) -> float:
        """Bearing of a column from the image centre, positive to the left [rad]."""
        half = self.columns / 2.0
        return math.atan((half - column) / half * math.tan(self.width / 2.0))


@dataclass(frozen=True, kw_only=True)
class Frame:
    """Detections in one picture.

    Attributes:
        stamp: time of the picture [s], None if unknown (darknet_ros sends it only with boxes).
        boxes: empty if nothing was detected.
        eye: the camera then, None if its pose or lens is unknown.
        counts: False if its boxes could not be measured yet and therefore prove nothing.
        is_dark: the picture shows little light.
        is_same: the picture equals the previous one byte for byte: the camera hangs, or has no noise in a still room.
        picture: stamp of the camera's picture [s], None if it equals `stamp`.
    """

    stamp: float | None = None
    boxes: tuple[Box, ...] = ()
    eye: Eye | None = None
    counts: bool = True
    is_same: bool = False
    is_dark: bool = False
    picture: float | None = None


@dataclass(frozen=True, kw_only=True)
class ScanView:
    """One scan, and the lidar's pose in map."""

    scan: LaserScan
    map_from_laser: Pose2D


@dataclass(frozen=True, kw_only=True)
class Battery:
    """Last state of the battery.

    Attributes:
        share: of its charge, 0 to 1, None if unknown; voltage: [V], None if unknown.
        is_charging: it is being charged.
        at: time of arrival [s].
    """

    share: float | None = None
    voltage: float | None = None
    is_charging: bool = False
    at: float = -math.inf


@dataclass(frozen=True, kw_only=True)
class Guarded:
    """What is guarded now (see `arming`).

    Attributes:
        mode: armed_away, armed_home, night or disarmed.
        rooms: with active sensors, None: all.
        why: one sentence about what is not guarded, "" if everything is.
        is_quiet: quiet hours: nothing but triggers and people's orders moves the robot.
        holds_until: end of the running entry delay, in seconds since 1970: notices wait; None: no delay.
        muted: rooms with sensors that start no mission, and until when, in seconds since 1970.
    """

    mode: str = "armed_away"
    rooms: frozenset[int] | None = None
    why: str = ""
    is_quiet: bool = False
    holds_until: float | None = None
    muted: Mapping[int, float] = field(default_factory=dict)

    def counts(self, room_id: int) -> bool:
        """Whether a call of the room's sensor starts a mission."""
        return room_id not in self.muted and (self.rooms is None or room_id in self.rooms)


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """One step's inputs; stamps and times [s] are of the clock of the step's `now`.

    Attributes:
        wall: seconds since 1970, for ids and records only.
        triggers: rooms with motion since the last step, in order of arrival.
        requests: rooms requested otherwise; their ids and priorities are assigned here.
        frames: detections since the last step.
        yaw: heading of base_link in odom [rad], None if unknown now.
        pose: of base_link in map, None if unknown now.
        clearance: distance from the robot's centre to the nearest obstacle of the lidar [m], None if it is silent.
        link: the navigation.
        detector_at: when the detector was last heard [s].
        camera_at: arrival of the last picture that was not black [s].
        camera_changed_at: arrival of the last picture that differs from its predecessor [s], inf if nobody compares.
        scan: the newest scan, during a mission; None if there is none or the robot's pose is unknown.
        house: the map's floor and its rooms, None until the map was heard.
        battery: None if there is no report.
        guarded: what is armed.
        stop: reason of the emergency stop, "" if it is not pressed.
    """

    wall: float = 0.0
    triggers: tuple[int, ...] = ()
    requests: tuple[Request, ...] = ()
    frames: tuple[Frame, ...] = ()
    yaw: float | None = None
    pose: Pose2D | None = None
    clearance: float | None = None
    link: GoalLink = GoalLink()
    detector_at: float = -math.inf
    camera_at: float = -math.inf
    camera_changed_at: float = math.inf
    scan: ScanView | None = None
    house: RoomRegions | None = None
    battery: Battery | None = None
    guarded: Guarded = Guarded()
    stop: str = ""
