"""What people and programs order between two steps, and what they are told is done."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence
from typing import Any

from rosbot_patrol.patrol.calls.call_filter import Intake
from rosbot_patrol.patrol.calls.own_motion import OwnMotion
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.intruder.decision import Lookout
from rosbot_patrol.patrol.mission import resume as recall
from rosbot_patrol.patrol.mission.params import ManagerParams
from rosbot_patrol.patrol.records.commands import Commands
from rosbot_patrol.patrol.records.mission import Phase, Verdict
from rosbot_patrol.patrol.records.request import Origin, Request
from rosbot_patrol.patrol.story import status_text as saying

log = logging.getLogger(__name__)


class Ordered(Lookout):
    """A `Lookout` that takes orders; what they come to is part of the next step's commands. Arguments as of Conduct."""

    def __init__(self, rooms: Rooms, params: ManagerParams, **helpers: Any) -> None:
        super().__init__(rooms, params, **helpers)
        self._own_motion = OwnMotion(params.own_motion_radius, params.own_motion_memory)
        self._intake = Intake(rooms, self.queue, params.priorities, self._own_motion)
        self._pending = Commands()

    def cancel(self, why: str = "cancelled by a person") -> str:
        """Give up the mission that runs and all that wait; the robot stays where it is."""
        rooms = saying.rooms_open(self.mission, self.queue)
        was_home = self._home is not None
        self._give_up(self.queue.drop(), why, self._pending)
        self._home = None
        if self.mission:
            self._decide(Verdict.UNVERIFIED, f"{self.mission.room.title} was not looked at to the end: {why}")
            self._end(self._pending, f"where it is, as the mission was {why}")
        self._pending.cancel |= bool(rooms) or was_home
        self._ready.at_rest = f"on guard, {why}" if rooms or was_home else self._ready.at_rest
        if rooms:
            return f"given up: {rooms}; the robot stays where it is"
        return "the way home is given up" if was_home else "there is nothing to give up"

    def go_home(self) -> str:
        """Give up everything and drive home."""
        rooms = saying.rooms_open(self.mission, self.queue)
        if self._inputs.stop:
            return f"the robot stays where it is: {self._inputs.stop}"
        self.cancel("called home by a person")
        self._drive_home()
        return f"given up: {rooms}; the robot drives home" if rooms else "the robot drives home"

    def withdraw(self, missions: set[str], why: str) -> None:
        """Give up missions that a program asked for, by id; what a sensor calls for, too, goes on."""
        asked = [request for request in self.queue if request.id in missions and request.origin is Origin.ACTION]
        others = [request for request in self.queue.drop() if request not in asked]
        for request in others:
            self.queue.add(request)
        self._give_up(asked, why, self._pending)
        mission = self.mission
        if mission and mission.id in missions and mission.origin is Origin.ACTION:
            self._decide(Verdict.UNVERIFIED, f"{mission.room.title} was not looked at to the end: {why}")
            if mission.phase is not Phase.RETURNING:
                self._enter(Phase.RETURNING, self._inputs)
            self._pending.changed = True

    def abandon(self, why: str) -> Commands:
        """Give up mission and queue, for an orderly end of the program; the answer holds their records."""
        rooms = saying.rooms_open(self.mission, self.queue)
        if rooms:
            log.warning("the patrol ends: %s; given up: %s", why, rooms)
            self.cancel(why)
        out, self._pending = self._pending, Commands()
        return out

    def ask(self, requests: Sequence[Request]) -> dict[int, str]:
        """Queue requests; the id of the mission that will answer each room, "" where the room is refused."""
        taken = self._intake.ask(requests, self._inputs.wall, self.mission)
        self._pending.changed = True
        return taken

    def _give_up(self, requests: Iterable[Request], why: str, out: Commands) -> None:
        """Requests that will not be followed get their verdict, too."""
        for request in requests:
            mission = recall.begin(request, self.rooms, self._inputs.wall)
            mission.verdict, mission.reason = Verdict.UNVERIFIED, f"{mission.room.title} was not looked at: {why}"
            log.warning("%s", mission.reason)
            self._close(mission, out)

    def calls(self) -> dict[str, int]:
        """Rooms that sensors called for and that have no verdict yet, by the id of their missions."""
        found = {request.id: request.room_id for request in self.queue if request.origin is Origin.TRIGGER}
        if self.mission and self.mission.origin is Origin.TRIGGER:
            found[self.mission.id] = self.mission.room.id
        return found

    def served(self) -> frozenset[int]:
        """Rooms whose call, coming now, would be answered by what runs or waits."""
        rooms = set(self.queue.rooms)
        if self.mission and self.mission.phase is not Phase.RETURNING:
            rooms.add(self.mission.room.id)
        return frozenset(rooms)
