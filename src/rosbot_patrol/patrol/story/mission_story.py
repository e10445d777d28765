"""Narration of a patrol: one plain sentence for each step, for people who watch `scripts/patrol`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rosbot_patrol.patrol.records.activity import ON_GUARD, Activity, activity_of, is_away, is_full_turn
from rosbot_patrol.patrol.records.mission import Phase, Verdict


@dataclass(frozen=True, kw_only=True)
class Telling:
    """What the topics say: one /patrol/state."""

    phase: str
    why: str
    mission: str = ""
    room_id: int = 0
    room_name: str = ""
    last_verdict: str = ""

    @property
    def room(self) -> str:
        """Number and name."""
        return f"room {self.room_id} ({self.room_name})" if self.room_name else f"room {self.room_id}"


@dataclass(frozen=True, kw_only=True)
class AlertTelling:
    """What the topics say: one /patrol/alerts."""

    id: str
    room: str
    object_class: str
    probability: float
    delivered: bool
    transport: str
    location: str


@dataclass(kw_only=True)
class MissionSummary:
    """One mission as it was seen from outside; times in seconds of the narrator's clock."""

    id: str
    room_id: int
    room_name: str
    verdict: str = ""
    why: str = ""
    times: dict[str, float] = field(default_factory=dict)
    seen: list[str] = field(default_factory=list)
    mails: list[str] = field(default_factory=list)


class Narrator:
    """Turns what topics say into sentences, and keeps the summary."""

    def __init__(self) -> None:
        self.missions: list[MissionSummary] = []
        self.on_guard_at: float | None = None
        self.ended = 0
        self.is_home = True
        self._last: Telling | None = None
        self._called: set[int] = set()

    def trigger(self, room_id: int) -> list[str]:
        """A motion sensor saw something; said once until a mission has answered it."""
        if room_id in self._called:
            return []
        self._called.add(room_id)
        return [f"Motion sensor {room_id} calls."]

    def state(self, now: float, report: Telling) -> list[str]:
        """The patrol's state was published."""
        last, self._last = self._last, report
        mission = self._mission(report)
        if mission and report.phase not in mission.times:
            mission.times[report.phase] = now
        if last is not None and (last.phase, last.mission) == (report.phase, report.mission):
            return self._news(last, report)
        if report.phase == Phase.IDLE.value:
            return self._idle(now, last, report)
        if report.phase == Phase.STARTING.value:
            return [f"Not yet on guard: {report.why}."]
        return [self._step(report)]

    def alert(self, report: AlertTelling) -> list[str]:
        """An intruder was seen, or the mail about one has left."""
        mission = next((m for m in self.missions if m.id == report.id), None)
        if not report.delivered:
            if mission:
                mission.seen.append(report.object_class)
            return [
                f"INTRUDER: a {report.object_class} seen on the mission to {report.room},"
                f" probability {report.probability:.2f}. The notice is on disk."
            ]
        if mission:
            mission.mails.append(report.location)
        if report.transport == "maildir":
            return [f"The mail lies in the Maildir {Path(report.location).parent.parent}."]
        return [f"The mail was sent to {report.location} by {report.transport}."]

    def is_complete(self, mission: MissionSummary) -> bool:
        """Whether nothing more is to come of a mission that ended."""
        return mission.verdict != Verdict.CONFIRMED.value or bool(mission.mails)

    def summary(self) -> dict[str, Any]:
        """All missions, for JSON."""
        return {"on_guard_s": self.on_guard_at, "missions": [vars(mission) for mission in self.missions]}

    def _mission(self, report: Telling) -> MissionSummary | None:
        if not report.mission:
            return None
        found = next((m for m in self.missions if m.id == report.mission), None)
        if found is None:
            found = MissionSummary(id=report.mission, room_id=report.room_id, room_name=report.room_name)
            self.missions.append(found)
        return found

    def _idle(self, now: float, last: Telling | None, report: Telling) -> list[str]:
        if last is None or not last.mission:
            if self.on_guard_at is not None:
                return []
            self.on_guard_at = now
            extra = report.why.removeprefix(ON_GUARD).strip("; ")
            return [f"On guard{f' ({extra})' if extra else ''}."]
        mission = next(m for m in self.missions if m.id == last.mission)
        mission.verdict, mission.why = report.last_verdict, report.why
        mission.times["end"] = now
        self.ended += 1
        self._called.discard(mission.room_id)
        self.is_home = not is_away(report.why)
        place = "Home again" if self.is_home else "Not home"
        return [f"{place}. Verdict for {last.room}: {report.last_verdict}.", f"On guard ({_details(report.why)})."]

    @staticmethod
    def _news(last: Telling, report: Telling) -> list[str]:
        if report.phase == Phase.STARTING.value and report.why != last.why:
            return [f"Not yet on guard: {report.why}."]
        before, doing = activity_of(last.why), activity_of(report.why)
        if doing is before:
            return []
        if doing.is_waiting and not before.is_waiting and before is not Activity.WAITING_FOR_PICTURES:
            return [f"{report.why[:1].upper()}{report.why[1:]}."]
        if doing is Activity.FOLLOWING:
            return ["Somebody is in view: the camera is kept on them."]
        if doing is Activity.TO_VIEWPOINT:
            return [f"On to a further viewpoint in {report.room}."]
        if doing is Activity.TURNING:
            once = "Turning once" if is_full_turn(report.why) else "Turning"
            return [f"{once} to look around in {report.room}."]
        return []

    @staticmethod
    def _step(report: Telling) -> str:
        if report.phase == Phase.DRIVING.value:
            return f"Driving to {report.room}."
        if report.phase == Phase.LOOKING.value:
            return f"Arrived in {report.room}."
        return f"Driving home. {_details(report.why).removeprefix('driving home, ').capitalize()}."


def _details(why: str) -> str:
    return why.removeprefix(f"{ON_GUARD}, ").rstrip(".")
