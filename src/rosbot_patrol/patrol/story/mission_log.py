"""What a mission's record is told, step by step: a plain list of entries made of what the patrol did.

Pure: it compares each step with the one before, and remembers only what it takes to see what is new.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rosbot_patrol.alerts.records.incident import NO_ROOM, Event, Incident
from rosbot_patrol.counts import count_of
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.records.commands import Commands, IntruderAlarm
from rosbot_patrol.patrol.records.mission import Mission

BEFORE = 60.0  # [s] of what the sensors said before a mission began, in its record
_WAY_STEP = 0.15  # [m] between two points of the way
_OWN = ("reason", "person", "person_room_id", "person_room")  # each person's, told when they were seen
_WHY_PAUSE = 2.0  # [s] between two sentences of one phase


@dataclass(frozen=True, kw_only=True)
class Entry:
    """Something for the record of a mission.

    Attributes:
        incident: id of the record.
        begin: the record as it begins, where it does; one that is there already goes on.
        changes: fields that have a new value.
        times: phases that began, with seconds since 1970; path: points of the way; both come behind those before.
        events: what happened.
        closed: seconds since 1970, where the mission is over.
    """

    incident: str
    begin: Incident | None = None
    changes: Mapping[str, Any] = field(default_factory=dict)
    times: tuple[tuple[str, float], ...] = ()
    path: tuple[tuple[float, float], ...] = ()
    events: tuple[Event, ...] = ()
    closed: float | None = None


class MissionLog:
    """Turns the patrol's steps into entries."""

    def __init__(self) -> None:
        self._id = ""
        self._phase = self._verdict = self._why = ""
        self._why_at = -math.inf
        self._path: list[tuple[float, float]] = []
        self._last_spot: tuple[float, float] | None = None
        self._heard: deque[Event] = deque(maxlen=200)

    def step(
        self,
        *,
        now: float,
        wall: float,
        mission: Mission | None,
        commands: Commands,
        pose: Pose2D | None,
        heard: Sequence[Event] = (),
    ) -> list[Entry]:
        """The entries of one step.

        Args:
            now: time [s].
            wall: seconds since 1970.
            mission: that runs after the step, None between missions.
            commands: of the step.
            pose: of the robot in map, None where it is not known.
            heard: what the sensors said since the last step.
        """
        entries: list[Entry] = []
        self._heard.extend(heard)
        if mission is not None:
            if mission.id != self._id:
                entries.append(self._begin(now, wall, mission))
            elif heard:
                entries.append(Entry(incident=mission.id, events=tuple(heard)))
            entries += self._follow(now, wall, mission, commands, pose)
        for alarm in commands.alarms:
            if (
                mission is not None and alarm.mission.id != mission.id
            ):  # somebody else elsewhere, with a record of their own
                entries.append(self._opened(now, wall, alarm.mission))
            entries.append(_seen(wall, alarm))
        ignored = (i for i in commands.ignored if i.mission)
        entries += [Entry(incident=i.mission, events=(Event(wall=i.wall, kind="sensor", text=i.why),)) for i in ignored]
        for ended in commands.ended:
            entries += self._end(now, wall, ended, commands)
        return entries

    def _begin(self, now: float, wall: float, mission: Mission) -> Entry:
        self._id, self._phase, self._verdict, self._why = mission.id, "", "", ""
        self._why_at = -math.inf
        self._path, self._last_spot = [], None
        return self._opened(now, wall, mission)

    def _opened(self, now: float, wall: float, mission: Mission) -> Entry:
        incident = Incident(
            id=mission.id,
            wall=mission.wall or wall,
            ros_time=now,
            room_id=mission.room.id,
            room_name=mission.room.name,
            origin=mission.origin.value,
            triggers=mission.triggers,
            events=tuple(event for event in self._heard if wall - BEFORE <= event.wall <= wall + 1.0),
        )
        return Entry(incident=mission.id, begin=incident)

    def _follow(
        self, now: float, wall: float, mission: Mission, commands: Commands, pose: Pose2D | None
    ) -> list[Entry]:
        self._walk(pose)
        report = commands.report
        phase = report.phase.value if report is not None and report.mission == mission.id else mission.phase.value
        why = report.why if report is not None and report.mission == mission.id else ""
        if report is None and self._phase:
            phase = self._phase  # a state such as `stopped` holds until another is reported
        entries = []
        if phase != self._phase:
            self._phase = phase
            text = why or phase
            event = Event(wall=wall, kind="state", text=text, data={"phase": phase})
            path, self._path = tuple(self._path), []
            entries.append(Entry(incident=mission.id, times=((phase, wall),), path=path, events=(event,)))
            self._why, self._why_at = why, now
        elif why and why != self._why and not 0.0 <= now - self._why_at < _WHY_PAUSE:
            entries.append(Entry(incident=mission.id, events=(Event(wall=wall, kind="state", text=why),)))
            self._why, self._why_at = why, now
        verdict = mission.verdict_name
        if verdict != self._verdict:
            self._verdict = verdict
            event = Event(wall=wall, kind="verdict", text=f"{verdict}: {mission.reason}")
            entries.append(Entry(incident=mission.id, changes=_state(mission), events=(event,)))
        return entries

    def _walk(self, pose: Pose2D | None) -> None:
        if pose is None:
            return
        spot = (round(pose.x, 3), round(pose.y, 3))
        if self._last_spot is None or math.dist(spot, self._last_spot) >= _WAY_STEP:
            self._path.append(spot)
            self._last_spot = spot

    def _end(self, now: float, wall: float, mission: Mission, commands: Commands) -> list[Entry]:
        is_own = mission.id == self._id
        entries = [] if is_own else [self._opened(now, wall, mission)]  # else it was over before it began
        path = tuple(self._path) if is_own else ()
        why = commands.report.why if commands.report is not None else mission.reason
        event = Event(wall=wall, kind="state", text=why, data={"spent": dict(mission.times)})
        looked_like = commands.suspects if is_own else ()
        events = (*(Event(wall=wall, kind="suspect", text=text) for text in looked_like), event)
        entries.append(Entry(incident=mission.id, changes=_state(mission), path=path, events=events, closed=wall))
        for number in range(2, len(mission.people) + 1):
            name = f"{mission.id}-{number}"
            changes = {key: value for key, value in _state(mission).items() if key not in _OWN}
            entries.append(Entry(incident=name, changes=changes, events=(event,), closed=wall))
        if is_own:
            self._id = ""
        return entries


def _state(mission: Mission) -> dict[str, Any]:
    """What of a mission its record shows now."""
    state: dict[str, Any] = {
        "verdict": mission.verdict_name,
        "reason": mission.reason,
        "sightings": mission.sightings,
        "triggers": mission.triggers,
        "share_seen": mission.share_seen,
    }
    if mission.place is not None:
        state["person"] = mission.place
    return state | person_room(mission)


def person_room(mission: Mission) -> dict[str, Any]:
    """The fields of a record that say in which room the person is; none where nobody knows."""
    if mission.place_room is not None:
        return {"person_room_id": mission.place_room.id, "person_room": mission.place_room.name}
    return {"person_room_id": NO_ROOM} if mission.is_outside else {}


def _seen(wall: float, alarm: IntruderAlarm) -> Entry:
    mission, seen, pose = alarm.mission, alarm.seen, alarm.pose
    changes = _state(mission) | {
        "confirmed": wall,
        "phase": alarm.phase.value,
        "object_class": seen.label,
        "probability": seen.probability,
        "pictures": seen.pictures,
        "pose": (pose.x, pose.y, pose.yaw) if pose else None,
    }
    text = f"{seen.label} seen, probability {seen.probability:.2f} over {count_of(seen.pictures, 'picture')}"
    event = Event(wall=wall, kind="seen", text=text, data={"stamp": seen.stamp})
    return Entry(incident=mission.id, changes=changes, events=(event,))
