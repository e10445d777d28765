"""What the patrol is told in each step, and what it answers: plain records."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.goal import GoalLink
from rosbot_patrol.patrol.house.regions import RoomRegions
from rosbot_patrol.patrol.records.request import Request
from rosbot_patrol.scan import LaserScan

_SLACK = 3.0, 0.04  # of a detector's boxes: pixels, and share of the height


@dataclass(frozen=True, kw_only=True)
class Measured:
    """What is known of a box's object in space.

    Attributes:
        x: place in map [m]; y: likewise.
        error: of the place, about [m].
        away: distance from the camera over the floor [m].
        top: of the object over the floor [m]; height, width: of what shows of it [m].
        is_cut: the box ends about the picture's upper edge, or at its lower one: there may be more of it.
        is_cut_above: there may be more of it above the picture.
        is_cut_aside: the box ends at the picture's left or right edge: the place is of the part that shows.
        is_flat: all of it lies in one plane, None where no depth tells.
        has_legs: of what goes on above the picture: it stands as a person does, where the map shows nothing; None where
            that is not known.
        source: what told the distance: "depth", "lidar", "floor" (the box's lower edge).
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
    """One object in one picture: class, probability, corners [px], and its place where that is known.

    Attributes:
        measured: place and size.
        doubt: where it may be, x, y in map [m], where it is too far off to be measured, but could be from near.
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
        """By how much its upper and lower edges may be off [px]."""
        return _SLACK[0] + _SLACK[1] * self.height


@dataclass(frozen=True, kw_only=True)
class Eye:
    """A camera over the floor when it took a picture.

    Attributes:
        pose: in map.
        width: angle that the picture spans [rad].
        columns: width of the picture [px].
    """

    pose: Pose2D
    width: float
    columns: int = 640

    def bearing(self, column: float) -> float:
        """Of a column of the picture from its middle, positive to the left [rad]."""
        half = self.columns / 2.0
        return math.atan((half - column) / half * math.tan(self.width / 2.0))


@dataclass(frozen=True, kw_only=True)
class Frame:
    """What the detector saw in one picture.

    Attributes:
        stamp: when the picture was taken [s], None where that is not known (darknet_ros tells it only with boxes).
        boxes: nothing seen if empty.
        eye: the camera then, None where its place or its lens is not known.
        counts: False where its boxes could not be measured yet, so that they prove nothing.
        is_same: its picture is the one before, byte for byte: the camera hangs, or has no noise and the room is still.
        picture: stamp by which the camera's picture is found again [s], None where that is `stamp`.
    """

    stamp: float | None = None
    boxes: tuple[Box, ...] = ()
    eye: Eye | None = None
    counts: bool = True
    is_same: bool = False
    picture: float | None = None


@dataclass(frozen=True, kw_only=True)
class ScanView:
    """One scan, and from where it was taken: the lidar's pose in map."""

    scan: LaserScan
    map_from_laser: Pose2D


@dataclass(frozen=True, kw_only=True)
class Battery:
    """What the battery last said.

    Attributes:
        share: of its charge, 0 to 1, None where it is not told; voltage: [V], None likewise.
        is_charging: it hangs at the charger.
        at: when it was heard [s].
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
        rooms: whose sensors count, None for all of them.
        why: one sentence about what is not guarded, "" where everything is.
        is_quiet: quiet hours: nothing but triggers and people's orders moves the robot.
        holds_until: an entry delay runs to this moment, in seconds since 1970: notices wait; None where none does.
    """

    mode: str = "armed_away"
    rooms: frozenset[int] | None = None
    why: str = ""
    is_quiet: bool = False
    holds_until: float | None = None

    def counts(self, room_id: int) -> bool:
        """Whether a call of the room's sensor starts a mission."""
        return self.rooms is None or room_id in self.rooms


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """One step's inputs; stamps and times [s] are of the clock of the step's `now`.

    Attributes:
        wall: seconds since 1970, for ids and records only.
        triggers: rooms whose sensor saw motion since the last step, in order of arrival.
        requests: rooms that something else asks for; ids and priorities are given to them here.
        frames: what the detector saw since the last step.
        yaw: heading of base_link in odom [rad], None where it is not known now.
        pose: of base_link in map, None where it is not known now.
        clearance: from the robot's centre to the nearest thing that the lidar sees [m], None where it is silent.
        link: the navigation.
        detector_at: when the detector was last heard [s].
        camera_at: when a picture came last that was not black [s].
        camera_changed_at: when one came last that differs from the one before [s], inf where nobody compares.
        scan: the newest scan, while a mission runs; None where it is silent or the robot's place is not known.
        house: the map's floor and its rooms, None until the map was heard.
        battery: None where nobody tells of one.
        guarded: what is armed.
        stop: why the emergency stop holds the robot, "" where it does not.
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
