"""The mission that runs, those that wait, and the way home between them."""

from __future__ import annotations

import logging
from collections.abc import Iterable

from rosbot_patrol.patrol.mission.agenda import Agenda
from rosbot_patrol.patrol.mission.drive import WayHome, end_of_way_home
from rosbot_patrol.patrol.mission.mission_run import MissionRun, RunParts
from rosbot_patrol.patrol.mission.readiness import Readiness
from rosbot_patrol.patrol.mission.resume import Memory
from rosbot_patrol.patrol.records.activity import ON_GUARD, Activity, Place, Whereabouts
from rosbot_patrol.patrol.records.commands import Commands
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Mission, Phase, Verdict
from rosbot_patrol.patrol.records.request import Origin, Request
from rosbot_patrol.patrol.story import status_text

log = logging.getLogger(__name__)


class Missions:
    """Begins and ends missions, one at a time, and closes the record of each.

    Args:
        parts: what every mission works with.
        agenda: what waits.
        recalled: the mission that ran before a restart.

    Attributes:
        run: the mission that runs; way_home: without a mission.
        ready: whether the patrol can begin, and what to say at rest.
    """

    def __init__(self, parts: RunParts, agenda: Agenda, recalled: Mission | None = None) -> None:
        self.parts, self.agenda = parts, agenda
        self.run = MissionRun(recalled, parts) if recalled else None
        self.way_home: WayHome | None = None
        self.ready = Readiness(parts.params.look)
        self._ways_home = 0

    @property
    def mission(self) -> Mission | None:
        """The record of the mission that runs."""
        return self.run.mission if self.run is not None else None

    def calls(self) -> dict[str, int]:
        """Rooms that sensors called for and that have no verdict yet, by the id of their missions."""
        found = {r.id: r.room_id for r in self.agenda.queue if r.origin is Origin.TRIGGER}
        mission = self.mission
        if mission and mission.origin is Origin.TRIGGER:
            found[mission.id] = mission.room.id
        return found

    def served(self) -> frozenset[int]:
        """Rooms whose call, coming now, would be answered by what runs or waits."""
        rooms = set(self.agenda.queue.rooms)
        mission = self.mission
        if mission and mission.phase is not Phase.RETURNING:
            rooms.add(mission.room.id)
        return frozenset(rooms)

    def memory(self) -> Memory:
        """What has to outlive the program."""
        return Memory(
            count=self.agenda.count,
            waiting=tuple(self.agenda.queue),
            mission=self.mission,
            last_verdict=self.parts.status.last_verdict,
            held=self.parts.notices.held,
        )

    def title(self, room_id: int) -> str:
        """A room for people."""
        room = self.parts.rooms.find(room_id)
        return room.title if room else f"room {room_id}"

    # -- missions

    def begin(self, now: float, wall: float) -> None:
        """Begin the most urgent mission that waits; now in steady time [s], wall in seconds since 1970."""
        self.run = MissionRun(self.agenda.next_mission(wall), self.parts)
        reason = self.parts.notices.take_written(self.run.mission.id)
        if reason is not None:
            self.run.confirm(reason)
        self.way_home = None
        self.run.begin(now)

    def put_back(self, mission: Mission, other: Request) -> None:
        """Let the mission that runs wait for another."""
        title, cause = mission.room.title, self.title(other.room_id)
        log.info("%s is put back: motion in %s", title, cause)
        self.agenda.put_back(mission)
        self.run = None
        self.ready.at_rest = f"{ON_GUARD}; {title} is put back, as the sensor of {cause} calls"

    def end(self, run: MissionRun, out: Commands, place: Place) -> None:
        """End the mission that runs; `place` says where the robot is or goes."""
        mission = run.mission
        if mission.verdict is None:
            run.decide(Verdict.UNVERIFIED, f"{mission.room.title} was not looked at")
        level = logging.INFO if place.kind is Whereabouts.HOME else logging.WARNING
        log.log(level, "the mission to %s is over, %s", mission.room.title, place.text)
        out.suspects += status_text.hypotheses(self.parts.decision.belief)
        self._close(mission, out)
        self.run = None
        self.ready.at_rest = f"{ON_GUARD}, {place.text}; {status_text.verdict(mission)}"
        self.say(out, Phase.IDLE, self.ready.at_rest)

    def give_up(self, requests: Iterable[Request], why: str, wall: float, out: Commands) -> None:
        """Give requests that are not followed their verdict, too."""
        for mission in self.agenda.give_up(requests, why, wall):
            self._close(mission, out)

    def _close(self, mission: Mission, out: Commands) -> None:
        self.parts.status.last_verdict = mission.verdict_name
        out.ended += (mission,)
        out.changed = True

    # -- between missions

    def drive_home(self) -> None:
        """Drive home without a mission."""
        self._ways_home += 1
        self.way_home = WayHome(f"home/{self._ways_home}", self.parts.rooms.base, self.parts.params.drive)

    def step_way_home(self, way: WayHome, now: float, inputs: Inputs, out: Commands) -> None:
        """Drive on; now and the stamps of `inputs` in steady time [s]."""
        step = way.step(now, inputs)
        out.goal = step.goal
        out.cancel |= step.cancel
        place = end_of_way_home(step)
        if place is not None:
            self.way_home = None
            self.ready.at_rest = f"{ON_GUARD}, {place.text}"
            self.say(out, Phase.IDLE, self.ready.at_rest)
        else:
            waiting = f"{Activity.WAITING_FOR_NAVIGATION.value} to drive home"
            self.say(out, Phase.RETURNING, waiting if step.waiting else "driving home")

    def say(self, out: Commands, phase: Phase, why: str) -> None:
        """Report the state of a patrol without a mission."""
        self.parts.status.say(out, phase, why)
