"""What the patrol answers in each step: plain records."""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.goal import Goal
from rosbot_patrol.patrol.records.findings import Confirmation, Person
from rosbot_patrol.patrol.records.mission import Mission, Phase


@dataclass(frozen=True, kw_only=True)
class Report:
    """What the patrol does, and why, for people; the fields of PatrolState."""

    phase: Phase
    why: str
    mission: str = ""
    room_id: int = 0
    room_name: str = ""
    origin: str = ""
    queue: tuple[int, ...] = ()
    verdict: str = ""
    last_verdict: str = ""
    mode: str = ""


@dataclass(frozen=True, kw_only=True)
class IntruderAlarm:
    """A confirmed intruder: the first of the mission, or another person elsewhere.

    Attributes:
        mission: copy of the mission at that moment; for another person under an id of its own, "ID-2", ...
        seen: what the detector saw; phase: what the robot did; pose: of the robot in map.
        is_held: an entry delay runs: write the notice, but send it only after a `Release`.
    """

    mission: Mission
    seen: Confirmation
    phase: Phase
    pose: Pose2D | None
    is_held: bool = False


@dataclass(frozen=True, kw_only=True)
class Release:
    """What becomes of a notice that was held: told to the owner, or dropped (it stays on record).

    Attributes:
        mission: id; is_dropped: the owner disarmed in time; why: one sentence.
    """

    mission: str
    is_dropped: bool
    why: str


@dataclass(frozen=True, kw_only=True)
class Ignored:
    """A motion sensor's call that starts no mission, for the record.

    Attributes:
        wall: when, in seconds since 1970; room_id: whose; why: one sentence.
        mission: id of the mission that ran, "" where there was none.
    """

    wall: float
    room_id: int
    why: str
    mission: str = ""


@dataclass(frozen=True, kw_only=True)
class OwnerMessage:
    """Something that the owner has to know besides an intruder: the robot stays at home, or cannot go on.

    Attributes:
        kind: battery, stop, ...; is_over: what an earlier word said is over; text: one sentence.
    """

    kind: str
    text: str
    is_over: bool = False


@dataclass(kw_only=True)
class Commands:
    """What to do after a step.

    Attributes:
        goal: to be sent; cancel: give up the goal that runs; cancel_all: and everybody else's.
        speed: turning speed to command [rad/s], None where the patrol has no wish (the wheels are another's).
        report: the state, where it changed.
        alarms: intruders that were confirmed: keep each, send it.
        releases: what becomes of notices that were held.
        ended: missions that are over, with their verdicts; the robot may not be at home yet.
        ignored: calls that start no mission.
        suspects: what looked like somebody on the mission that ended, one sentence each.
        words: for the owner.
        people: those met on the mission, where one of them was seen in this step.
        pictures: stamps of the camera's pictures to be kept [s], None for the same as before.
        changed: what has to outlive the program has changed.
    """

    goal: Goal | None = None
    cancel: bool = False
    cancel_all: bool = False
    speed: float | None = None
    report: Report | None = None
    alarms: tuple[IntruderAlarm, ...] = ()
    releases: tuple[Release, ...] = ()
    ended: tuple[Mission, ...] = ()
    ignored: tuple[Ignored, ...] = ()
    suspects: tuple[str, ...] = ()
    words: tuple[OwnerMessage, ...] = ()
    people: tuple[Person, ...] = ()
    pictures: tuple[float, ...] | None = None
    changed: bool = False
