"""Log of a patrol in a replay, as tables; events are compared in their order, each with its time."""

from __future__ import annotations

import math

from rosbot_patrol.patrol.records.commands import Commands
from rosbot_patrol.patrol.records.mission import Mission
from rosbot_patrol.replay.results.comparison import Field
from rosbot_patrol.replay.results.tables import STAMP, Result, Rows

TABLES = {
    "reports": ("state", "room", "origin", "queue", "verdict", "last_verdict", "mode", "why"),
    "goals": ("room", "phase", "x", "y", "yaw"),
    "turns": ("is_turning",),
    "cancels": ("is_for_all",),
    "notices": ("room", "label", "probability", "pictures", "x", "y", "is_held"),
    "verdicts": ("room", "verdict", "reason", "triggers", "sightings", "share_seen"),
    "ignored": ("room", "why"),
    "words": ("kind", "text"),
}
LATE_S = 0.5  # tolerance of an event's time

FIELDS = {
    **{f"{table}.rows": Field(is_by_order=True) for table in TABLES},
    **{f"{table}.{STAMP}": Field(tolerance=LATE_S, unit="s") for table in TABLES},
    **{f"{table}.{axis}": Field(tolerance=0.1, unit="m") for table in ("goals", "notices") for axis in "xy"},
    "goals.yaw": Field(tolerance=math.radians(5.0), unit="rad", is_angle=True),
    "notices.probability": Field(tolerance=0.1),
    "notices.pictures": Field(tolerance=2),
    "verdicts.sightings": Field(tolerance=3),
    "verdicts.share_seen": Field(tolerance=0.05),
    "counts.steps": Field(tolerance=1),
}


class PatrolLog:
    """Collector of the tables."""

    def __init__(self) -> None:
        self._rows = {name: Rows(STAMP, *columns) for name, columns in TABLES.items()}
        self._is_turning = False

    def note(self, now: float, commands: Commands, mission: Mission | None) -> None:
        """Record the commands of a step at a time [s]."""
        out = commands
        if out.report is not None:
            self._note_report(now, out)
        if out.goal is not None:
            room, phase = (mission.room.id, mission.phase.value) if mission else (0, "home")
            self._rows["goals"].add(now, room, phase, *out.goal.pose)
        if out.cancel:
            self._rows["cancels"].add(now, out.cancel_all)
        is_turning = bool(out.speed)
        if is_turning != self._is_turning:
            self._is_turning = is_turning
            self._rows["turns"].add(now, is_turning)
        if out.alarms or out.ended or out.ignored or out.words:
            self._note_news(now, out)

    def _note_report(self, now: float, commands: Commands) -> None:
        said = commands.report
        assert said is not None
        queue = " ".join(map(str, said.queue))
        texts = said.verdict, said.last_verdict, said.mode, said.why
        self._rows["reports"].add(now, said.phase.value, said.room_id, said.origin, queue, *texts)

    def _note_news(self, now: float, commands: Commands) -> None:
        for alarm in commands.alarms:
            seen, place = alarm.seen, alarm.seen.measured
            x, y = (place.x, place.y) if place is not None else (math.nan, math.nan)
            row = alarm.mission.room.id, seen.label, seen.probability, seen.pictures, x, y, alarm.is_held
            self._rows["notices"].add(now, *row)
        for mission in commands.ended:
            verdict = mission.verdict.value if mission.verdict else ""
            share = math.nan if mission.share_seen is None else mission.share_seen
            row_end = mission.room.id, verdict, mission.reason, mission.triggers, mission.sightings, share
            self._rows["verdicts"].add(now, *row_end)
        for each in commands.ignored:
            self._rows["ignored"].add(now, each.room_id, each.why)
        for word in commands.words:
            self._rows["words"].add(now, word.kind, word.text)

    def result(self, *, steps: int) -> Result:
        """The complete result."""
        counts = {"steps": steps, **{name: len(rows) for name, rows in self._rows.items()}}
        return Result("patrol_robot", counts=counts, tables={name: rows.table() for name, rows in self._rows.items()})
