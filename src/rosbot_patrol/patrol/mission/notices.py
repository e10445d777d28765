"""Which notices go out at once, which wait for the entry delay, and which were written before a restart."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from rosbot_patrol.patrol.guard.modes import DISARMED
from rosbot_patrol.patrol.records.commands import IntruderAlarm, Release
from rosbot_patrol.patrol.records.inputs import Guarded


class NoticeGate:
    """Holds notices while an entry delay runs.

    Args:
        held: notices that waited before a restart, as `held` below.

    Attributes:
        held: by id of its mission, when a notice goes out at the latest [s since 1970].
    """

    def __init__(self, held: Mapping[str, float]) -> None:
        self.held = dict(held)
        self._written: dict[str, str] = {}  # reasons, by the id of a call that waits

    def admit(self, alarm: IntruderAlarm, guarded: Guarded) -> IntruderAlarm:
        """The alarm, marked as held if an entry delay runs."""
        if guarded.holds_until is None:
            return alarm
        self.held[alarm.mission.id] = guarded.holds_until
        return dataclasses.replace(alarm, is_held=True)

    def hold(self, mission_id: str, until: float) -> None:
        """Hold a notice that was written before a restart, unless it is known."""
        self.held.setdefault(mission_id, until)

    def release(self, wall: float, guarded: Guarded) -> tuple[Release, ...]:
        """Let go of the notices whose entry delay is over, or that were disarmed in time."""
        is_disarmed = guarded.mode == DISARMED
        why = "disarmed within the entry delay" if is_disarmed else "the entry delay is over"
        is_over = is_disarmed or guarded.holds_until is None
        due = [mission for mission, until in self.held.items() if is_over or wall >= until]
        for mission in due:
            del self.held[mission]
        return tuple(Release(mission=mission, is_dropped=is_disarmed, why=why) for mission in due)

    def note_written(self, mission_id: str, reason: str) -> None:
        """Remember that the notice of a call that waits is on disk."""
        self._written[mission_id] = reason

    def take_written(self, mission_id: str) -> str | None:
        """The reason in a notice that was written before its mission began, None if there was none."""
        return self._written.pop(mission_id, None)
