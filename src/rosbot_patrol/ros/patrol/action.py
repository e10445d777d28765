"""Action `patrol`: search rooms, requested by programs. Callbacks store goals; the patrol's step answers."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import actionlib

from rosbot_patrol.counts import count_of
from rosbot_patrol.msg import PatrolAction, PatrolFeedback, PatrolResult
from rosbot_patrol.patrol.guard.schedule import all_rooms
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.mission.manager import PatrolManager
from rosbot_patrol.patrol.records.commands import Report
from rosbot_patrol.patrol.records.mission import Mission
from rosbot_patrol.patrol.records.request import Origin, Request

CANCELLED = "cancelled by the program that asked for it"


@dataclass(kw_only=True)
class _Open:
    handle: Any
    rooms: list[int]
    missions: dict[int, str]
    ended: dict[int, Mission] = field(default_factory=dict)

    @property
    def is_done(self) -> bool:
        return len(self.ended) == len(self.rooms)


class PatrolActions:
    """Goals of the action, several at once.

    Args:
        manager: manager of the missions.
        rooms: rooms of the points file.
    """

    def __init__(self, manager: PatrolManager, rooms: Rooms) -> None:
        self._manager, self._rooms = manager, rooms
        self._goals: deque[Any] = deque()
        self._cancels: deque[Any] = deque()
        self._open: list[_Open] = []
        self._report: Report | None = None
        self._server = actionlib.ActionServer(
            "patrol", PatrolAction, self._goals.append, self._cancels.append, auto_start=False
        )

    def start(self) -> None:
        """Start accepting goals."""
        self._server.start()

    def begin(self) -> None:
        """Accept waiting goals, before a step."""
        while self._goals:
            self._take(self._goals.popleft())
        while self._cancels:
            self._cancel(self._cancels.popleft())

    def follow(self, ended: tuple[Mission, ...], report: Report | None) -> None:
        """Report progress, after a step."""
        self._report = report or self._report
        for goal in list(self._open):
            rooms = {mission_id: room for room, mission_id in goal.missions.items()}
            goal.ended.update({rooms[mission.id]: mission for mission in ended if mission.id in rooms})
            if goal.is_done:
                self._open.remove(goal)
                goal.handle.set_succeeded(_result(goal))
            elif report is not None:
                goal.handle.publish_feedback(self._feedback(goal, report))

    def _take(self, handle: Any) -> None:
        wanted = list(dict.fromkeys(handle.get_goal().rooms)) or all_rooms(self._rooms)
        unknown = [room for room in wanted if self._rooms.find(room) is None]
        if unknown:
            handle.set_rejected(PatrolResult(), f"refused: {self._rooms.refusal(unknown[0])}")
            return
        handle.set_accepted("the rooms wait for their turn")
        requests = [Request(room_id=room, origin=Origin.ACTION, wall=time.time()) for room in wanted]
        self._open.append(_Open(handle=handle, rooms=wanted, missions=self._manager.ask(requests)))

    def _cancel(self, handle: Any) -> None:
        for goal in list(self._open):
            if goal.handle == handle:
                self._open.remove(goal)
                others = {mission for other in self._open for mission in other.missions.values()}
                self._manager.withdraw(set(goal.missions.values()) - others, CANCELLED)
                goal.handle.set_canceled(_result(goal), CANCELLED)

    def _feedback(self, goal: _Open, report: Report) -> PatrolFeedback:
        mission = self._manager.mission
        share = -1.0 if mission is None or mission.share_seen is None else mission.share_seen
        return PatrolFeedback(
            phase=report.phase.value,
            room=report.room_id,
            room_name=report.room_name,
            share_seen=share,
            done=len(goal.ended),
            of=len(goal.rooms),
        )


def _result(goal: _Open) -> PatrolResult:
    result = PatrolResult(rooms=goal.rooms, missions=[goal.missions[room] for room in goal.rooms])
    for room in goal.rooms:
        mission = goal.ended.get(room)
        result.verdicts.append(mission.verdict.value if mission and mission.verdict else "unverified")
        result.reasons.append(mission.reason if mission else CANCELLED)
    found = [str(room) for room, verdict in zip(goal.rooms, result.verdicts, strict=True) if verdict == "confirmed"]
    somebody = f"somebody is in room {', '.join(found)}" if found else "nobody was confirmed"
    result.text = f"{len(goal.ended)} of {count_of(len(goal.rooms), 'room has', 'rooms have')} a verdict: {somebody}"
    return result
