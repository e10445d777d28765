"""Which calls become missions: those that are armed, that no mission answers and that are not the robot's own doing."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Sequence
from dataclasses import dataclass

from rosbot_patrol.patrol.calls.own_motion import OwnMotion
from rosbot_patrol.patrol.calls.queue import MissionQueue, PriorityParams
from rosbot_patrol.patrol.calls.repeats import Repeats
from rosbot_patrol.patrol.calls.unrest import Unrest
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.patrol.records.commands import Ignored
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Mission, Phase, mission_id
from rosbot_patrol.patrol.records.request import Origin, Request

log = logging.getLogger(__name__)

_OFF_MAP = 600.0  # [s] between two missions by sensors to a room that cannot be looked at: each ends at once


@dataclass(kw_only=True)
class Taken:
    """What a step's calls have changed: the queue or a mission, and what was set aside."""

    changed: bool = False
    ignored: tuple[Ignored, ...] = ()


class CallFilter:
    """Takes calls into the queue.

    Args:
        rooms: of the points file.
        queue: to fill.
        priorities: of what calls.
        own_motion: where the robot was.

    Attributes:
        count: missions so far; unrest: how often sensors called.
    """

    def __init__(self, rooms: Rooms, queue: MissionQueue, priorities: PriorityParams, own_motion: OwnMotion) -> None:
        self.count = 0
        self.unrest = Unrest()
        self._rooms, self._queue, self._priorities, self._own_motion = rooms, queue, priorities, own_motion
        self._repeats, self._set_aside, self._off_map = Repeats(), Repeats(), Repeats(_OFF_MAP)

    def take(self, now: float, inputs: Inputs, mission: Mission | None, *, has_candidate: bool) -> Taken:
        """Take a step's calls.

        Args:
            now: steady time [s].
            inputs: of this step.
            mission: that runs.
            has_candidate: something that may be a person is in view.
        """
        taken = Taken()
        for room_id in inputs.triggers:
            room = self._rooms.find(room_id)
            answering = _answering(mission, room_id)
            if room is None:
                self._refuse(room_id, now)
            elif answering is not None:
                self._join(answering, room, now, taken)
            else:
                self._weigh(room, now, inputs, mission, taken, has_candidate=has_candidate)
            self.unrest.call(room_id, now)
        for request in inputs.requests:
            if inputs.guarded.is_quiet and request.origin is Origin.SCHEDULE:
                log.info("the round is left out: quiet hours; room %d", request.room_id)
                continue
            if request.origin is Origin.TRIGGER and not inputs.guarded.counts(request.room_id):
                continue  # one that was kept over a restart, and is not armed any more
            taken.changed |= bool(self.ask([request], inputs.wall, mission)[request.room_id])
        return taken

    def ask(self, requests: Sequence[Request], wall: float, mission: Mission | None) -> dict[int, str]:
        """Queue requests; the id of the mission that answers each room, "" where the room is refused."""
        return {request.room_id: self._ask(request, wall, mission) for request in requests}

    def _ask(self, request: Request, wall: float, mission: Mission | None) -> str:
        room = self._rooms.find(request.room_id)
        if room is None:
            log.error("refused: %s", self._rooms.refusal(request.room_id))
            return ""
        answering = _answering(mission, room.id)
        if answering is not None:
            return answering.id
        return self._add(dataclasses.replace(request, wall=request.wall or wall), mission)

    def _add(self, request: Request, mission: Mission | None) -> str:
        kept = self._queue.find(request.room_id)
        if kept is None:
            self.count += 1
        request = dataclasses.replace(
            request,
            id=kept.id if kept else mission_id(request.wall, self.count),
            priority=self._priorities.of(request.origin),
        )
        if self._queue.add(request):
            room = self._rooms.find(request.room_id)
            what = {Origin.TRIGGER: "motion in"}.get(request.origin, "a look is asked for at")
            waits = ", which waits its turn" if mission else ""
            log.info("%s %s%s", what, room.title if room else request.room_id, waits)
        return request.id

    def _refuse(self, room_id: int, now: float) -> None:
        if self._repeats.is_news(room_id, now):
            log.error("motion trigger refused: %s", self._rooms.refusal(room_id))

    def _join(self, mission: Mission, room: Room, now: float, taken: Taken) -> None:
        mission.triggers += 1
        if mission.origin is not Origin.TRIGGER:  # from now on it is one that no other call puts back
            mission.origin, mission.priority = Origin.TRIGGER, self._priorities.of(Origin.TRIGGER)
            taken.changed = True
        if self._repeats.is_news(room.id, now):
            log.info("motion in %s again, which the mission that runs answers", room.title)

    def _weigh(
        self, room: Room, now: float, inputs: Inputs, mission: Mission | None, taken: Taken, *, has_candidate: bool
    ) -> None:
        guarded = inputs.guarded
        if not guarded.counts(room.id):
            is_muted = "it is muted" if room.id in guarded.muted else ""
            why = guarded.why or is_muted or f"{room.title} is not guarded in the mode {guarded.mode}"
        elif _is_off_map(room, inputs) and not self._off_map.is_news(room.id, now):
            why = "its point is not on the map's floor, as was told a moment ago"
        elif not has_candidate and self._own_motion.explains(room, now):
            why = "the robot itself went past its sensor"
            if mission and self._set_aside.is_news(-1 - room.id, now):
                mission.own_motion.append((inputs.wall, room.id))
                taken.changed = True
        else:
            self._follow(room, now, inputs, mission, taken)
            return
        if self._set_aside.is_news(room.id, now):
            log.info("motion in %s starts no mission: %s", room.title, why)
            of = mission.id if mission else ""
            taken.ignored += (Ignored(wall=inputs.wall, room_id=room.id, why=why, mission=of),)

    def _follow(self, room: Room, now: float, inputs: Inputs, mission: Mission | None, taken: Taken) -> None:
        is_new = self._queue.find(room.id) is None
        self._add(Request(room_id=room.id, wall=inputs.wall, earlier=self.unrest.calls(room.id, now)), mission)
        taken.changed |= is_new


def _is_off_map(room: Room, inputs: Inputs) -> bool:
    return inputs.house is not None and room.id in inputs.house.lost


def _answering(mission: Mission | None, room_id: int) -> Mission | None:
    """The mission that runs, if it answers a call of this room: until it has looked at it."""
    if mission is None or mission.room.id != room_id or mission.phase is Phase.RETURNING:
        return None
    return mission
