"""What the patrol says of itself, in sentences."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from rosbot_patrol.counts import count_of
from rosbot_patrol.patrol.belief.belief import Belief
from rosbot_patrol.patrol.calls.queue import MissionQueue
from rosbot_patrol.patrol.house.rooms import Room
from rosbot_patrol.patrol.records.commands import Commands, Report
from rosbot_patrol.patrol.records.findings import Confirmation
from rosbot_patrol.patrol.records.inputs import Guarded
from rosbot_patrol.patrol.records.mission import Mission, Phase

_WHERE = {Phase.DRIVING: "on the way to", Phase.LOOKING: "in"}


def verdict(mission: Mission) -> str:
    """The verdict so far and its reason."""
    return f"{mission.verdict.value}: {mission.reason}" if mission.verdict else "without a verdict"


def sighting(mission: Mission, seen: Confirmation, room: Room | None = None, *, is_outside: bool = False) -> str:
    """That somebody was seen: first where they are, then where the robot was sent.

    Args:
        mission: that runs.
        seen: what the detector saw.
        room: in which the person is, None where that is not known.
        is_outside: the person's place is known and lies in no room.
    """
    sure = f"probability {seen.probability:.2f} over {count_of(seen.pictures, 'picture')}"
    place = ""
    if seen.measured is not None:
        about = "about " if seen.measured.error > 0.5 else ""
        place = f", {about}at ({seen.measured.x:.1f}, {seen.measured.y:.1f})"
    if room is not None and room.id != mission.room.id:
        return f"{seen.label} seen in {room.title}{place}, {_robot(mission)}, {sure}"
    if is_outside:
        return f"{seen.label} seen in no room of the map{place}, {_robot(mission)}, {sure}"
    where = _WHERE.get(mission.phase, "on the way back from")
    return f"{seen.label} seen {where} {mission.room.title}{place}, {sure}"


def _robot(mission: Mission) -> str:
    """Where the robot was when it saw somebody elsewhere."""
    where = "from" if mission.phase is Phase.LOOKING else _WHERE.get(mission.phase, "on the way back from")
    return f"{where} {mission.room.title}"


def clear(mission: Mission, turned_deg: float, refusals: Mapping[str, int]) -> str:
    """That nobody was seen, and how thorough the look was."""
    parts = [f"nobody seen in {mission.room.title}", f"turned {turned_deg:.0f} degrees"]
    if mission.share_seen is not None:
        parts.append(f"{mission.share_seen:.0%} of its floor seen")
    if refusals:
        parts.append(f"something like a person was no person: {max(refusals, key=lambda why: refusals[why])}")
    return ", ".join(parts)


def hypotheses(belief: Belief) -> tuple[str, ...]:
    """What looked like somebody, for the record: where, how surely, by what."""
    return tuple(belief.why(each) for each in belief.hypotheses if each.boxes)


def phase_text(mission: Mission) -> str:
    """Where on its way a mission is."""
    return f"{_WHERE.get(mission.phase, 'on the way back from')} {mission.room.title}"


def rooms_open(mission: Mission | None, queue: MissionQueue) -> str:
    """Rooms that have no verdict yet, "" where there are none."""
    ids = ([mission.room.id] if mission else []) + list(queue.rooms)
    return f"room{'s' * (len(ids) > 1)} {', '.join(map(str, ids))}" if ids else ""


class StatusReports:
    """Makes the report of each state, once.

    Args:
        queue: what waits.
        last_verdict: of the mission that ended before a restart, "" if there was none.

    Attributes:
        last_verdict: of the mission that ended last; mode: what is armed now.
    """

    def __init__(self, queue: MissionQueue, last_verdict: str = "") -> None:
        self.last_verdict, self.mode = last_verdict, Guarded().mode
        self._queue = queue
        self._last: Report | None = None

    def say(self, out: Commands, phase: Phase, why: str, mission: Mission | None = None) -> None:
        """Report a state, unless it is the one reported last.

        Args:
            out: takes the report.
            phase: what the patrol does.
            why: one sentence.
            mission: that runs.
        """
        report = self._report(phase, why, mission)
        if report != self._last:
            self._last = out.report = report

    def _report(self, phase: Phase, why: str, mission: Mission | None) -> Report:
        about = Report(phase=phase, why=why, queue=self._queue.rooms, last_verdict=self.last_verdict, mode=self.mode)
        if mission is None:
            return about
        return dataclasses.replace(
            about,
            mission=mission.id,
            room_id=mission.room.id,
            room_name=mission.room.name,
            origin=mission.origin.value,
            verdict=mission.verdict_name,
        )
