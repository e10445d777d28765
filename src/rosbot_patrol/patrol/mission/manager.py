"""From trigger to verdict: drive to the room, look around, say what is there, come home.

Matches the tutorial's patrol_robot (a trigger of a room's sensor sends the robot there, it turns once, it comes back
to room 0; persons alarm).

Differs:
- One mission runs at a time, and detections count while the robot drives, looks and returns. Calls that arrive
  meanwhile wait, one entry a room, the most urgent first (`agenda`, `calls.queue`). Calls that are answered already,
  that the robot sets off itself or that are not armed start nothing (`calls.call_filter`). From the way home the robot
  goes on to the next room at once.
- A room whose point cannot be reached is looked at from another viewpoint (`drive`). Without such a viewpoint the room
  is reported as unreachable, and the robot does not turn elsewhere. A room that the points file lacks is refused. A
  room with a point off the map's floor is unverified, without a drive.
- Every mission ends in a verdict: confirmed, clear, unreachable, or unverified. Unverified means that detector, camera
  or turn failed, or that the battery, the emergency stop or a person ended the mission.
- A mission gives one notice, at its first confirmation, and one more for each further person elsewhere
  (`intruder.persons`).
- While a person is in view the robot stops and keeps the camera on them, for a bounded time
  (`intruder.camera_tracking`).
- All times and stamps of a mission are steady (`steady`): setting the clock ends nothing and loses no evidence.
"""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rosbot_patrol.geometry import distance
from rosbot_patrol.patrol.belief.decision import IntruderDecision
from rosbot_patrol.patrol.belief.networks import Network
from rosbot_patrol.patrol.calls.queue import MissionQueue
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.intruder.frozen_camera import FrozenCamera
from rosbot_patrol.patrol.intruder.known_objects import KnownObject
from rosbot_patrol.patrol.mission.agenda import Agenda
from rosbot_patrol.patrol.mission.interruptions import (
    EmergencyHold,
    LowBattery,
    drop_the_old,
    leave_out_off_the_map,
    stand_down,
)
from rosbot_patrol.patrol.mission.mission_run import RunParts
from rosbot_patrol.patrol.mission.missions import Missions
from rosbot_patrol.patrol.mission.notices import NoticeGate
from rosbot_patrol.patrol.mission.params import ManagerParams
from rosbot_patrol.patrol.mission.resume import memory_from_plain, memory_to_plain
from rosbot_patrol.patrol.mission.steady import SteadyInputs
from rosbot_patrol.patrol.mission.views import OneTurn, Viewpoints, Views
from rosbot_patrol.patrol.records.activity import ON_GUARD, Place, Whereabouts
from rosbot_patrol.patrol.records.commands import Commands
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Mission, Phase
from rosbot_patrol.patrol.records.request import Origin, Request
from rosbot_patrol.patrol.story import status_text
from rosbot_patrol.patrol.story.status_text import StatusReports

log = logging.getLogger(__name__)

AT_HOME = 0.5  # [m] from room 0's point


class PatrolManager:
    """The patrol as a function of time and inputs: which mission runs when.

    Args:
        rooms: of the points file.
        params: behaviour.
        memory: what `snapshot` gave before the program ended, to go on from there.
        needs_camera: pictures come in, so that a silent camera can be told.
        views: what was seen of a room, and from where to see the rest.
        viewpoints: further poses that show a room whose own point cannot be reached.
        known: gives the objects that look like somebody, asked at each mission's start.
        network: gives the network that runs, asked at the begin of each mission.
    """

    def __init__(
        self,
        rooms: Rooms,
        params: ManagerParams | None = None,
        *,
        memory: Mapping[str, Any] | None = None,
        needs_camera: bool = True,
        views: Views | None = None,
        viewpoints: Viewpoints | None = None,
        known: Callable[[], tuple[KnownObject, ...]] = tuple,
        network: Callable[[], Network] = Network,
    ) -> None:
        self.params = params = params or ManagerParams()
        kept = memory_from_plain(memory or {}, rooms)
        agenda = Agenda(rooms, params, count=kept.count, waiting=kept.waiting)
        self._parts = RunParts(
            rooms=rooms,
            params=params,
            needs_camera=needs_camera,
            views=views or OneTurn(),
            viewpoints=viewpoints,
            decision=IntruderDecision(rooms, params.intruder, known, network),
            notices=NoticeGate(kept.held),
            status=StatusReports(agenda.queue, kept.last_verdict),
        )
        self._missions = Missions(self._parts, agenda, kept.mission)
        self._battery = LowBattery(params.battery, self._missions)
        self._hold = EmergencyHold(self._missions)
        self._steady = SteadyInputs()
        self._frozen_camera = FrozenCamera()
        self._is_first = True
        self._inputs = Inputs()  # of the last step
        self._pending = Commands()  # of orders since then

    # -- what others see

    @property
    def mission(self) -> Mission | None:
        """The mission that runs."""
        return self._missions.mission

    @property
    def queue(self) -> MissionQueue:
        """What waits."""
        return self._missions.agenda.queue

    @property
    def is_following(self) -> bool:
        """Whether the camera is kept on somebody."""
        return self._missions.run is not None and self._missions.run.is_following

    @property
    def is_resting(self) -> bool:
        """Whether only inputs set it in motion: nothing is under way, and nothing waits for a moment."""
        missions = self._missions
        is_free = missions.run is None and missions.way_home is None and not self.queue
        return is_free and missions.ready.is_ready and not self._parts.notices.held and not self._hold.is_on

    def calls(self) -> dict[str, int]:
        """Rooms that sensors called for and that have no verdict yet, by the id of their missions."""
        return self._missions.calls()

    def served(self) -> frozenset[int]:
        """Rooms whose call, coming now, would be answered by what runs or waits."""
        return self._missions.served()

    def snapshot(self) -> dict[str, Any]:
        """What has to outlive the program, for JSON."""
        return memory_to_plain(self._missions.memory())

    # -- orders between two steps

    def note_earlier_notice(self, mission_id: str, reason: str, *, held_until: float | None = None) -> bool:
        """Take in a notice that is on disk from before the start; the memory may be older.

        Args:
            mission_id: of the mission that runs or of a call that waits.
            reason: what the notice says, one sentence.
            held_until: latest end of the entry delay that it waits for [s since 1970], None if it does not wait.

        Returns:
            Whether it was news: then the mission is confirmed.
        """
        run, notices = self._missions.run, self._parts.notices
        if run is None or run.mission.id != mission_id:
            notices.note_written(mission_id, reason)
        elif run.mission.notified:
            return False
        else:
            run.confirm(reason)
        if held_until is not None:
            notices.hold(mission_id, held_until)
        return True

    def ask(self, requests: Sequence[Request]) -> dict[int, str]:
        """Queue requests; the id of the mission that will answer each room, "" if the room is refused."""
        taken = self._missions.agenda.ask(requests, self._inputs.wall, self.mission)
        self._pending.changed = True
        return taken

    def cancel(self, why: str = "cancelled by a person") -> str:
        """Give up the mission that runs and all that wait; the robot stays where it is."""
        missions = self._missions
        rooms = status_text.rooms_open(self.mission, self.queue)
        was_on_its_way = missions.way_home is not None
        missions.give_up(self.queue.drop(), why, self._inputs.wall, self._pending)
        missions.way_home = None
        if missions.run is not None:
            missions.run.give_up(why)
            missions.end(missions.run, self._pending, Place(Whereabouts.LEFT, f", as the mission was {why}"))
        if rooms or was_on_its_way:
            self._pending.cancel = True
            missions.ready.at_rest = f"{ON_GUARD}, {why}"
        if rooms:
            return f"given up: {rooms}; the robot stays where it is"
        return "the way home is given up" if was_on_its_way else "there is nothing to give up"

    def go_home(self) -> str:
        """Give up everything and drive home."""
        rooms = status_text.rooms_open(self.mission, self.queue)
        if self._inputs.stop:
            return f"the robot stays where it is: {self._inputs.stop}"
        self.cancel("called home by a person")
        self._missions.drive_home()
        return f"given up: {rooms}; the robot drives home" if rooms else "the robot drives home"

    def withdraw(self, missions: set[str], why: str) -> None:
        """Give up missions that a program asked for, by id; those that a sensor calls for, too, go on."""
        asked = self._missions.agenda.drop_asked(missions)
        self._missions.give_up(asked, why, self._inputs.wall, self._pending)
        run = self._missions.run
        if run is None or run.mission.id not in missions or run.mission.origin is not Origin.ACTION:
            return
        run.give_up(why)
        if run.mission.phase is not Phase.RETURNING:
            run.return_home()
        self._pending.changed = True

    def abandon(self, why: str) -> Commands:
        """Give up mission and queue, for an orderly end of the program; the answer holds their records."""
        rooms = status_text.rooms_open(self.mission, self.queue)
        if rooms:
            log.warning("the patrol ends: %s; given up: %s", why, rooms)
            self.cancel(why)
        out, self._pending = self._pending, Commands()
        return out

    # -- one step

    def step(self, now: float, inputs: Inputs) -> Commands:
        """Take the inputs of this moment, decide.

        Args:
            now: time [s]; may stand still, go back or jump.
            inputs: since the last step.
        """
        out, self._pending = self._pending, Commands()
        inputs = dataclasses.replace(inputs, frames=self._frozen_camera.left(inputs.frames))
        inputs = self._inputs = self._steady.step(now, inputs)
        self._parts.status.mode = inputs.guarded.mode
        if self._is_first and self._missions.run is not None:
            self._missions.run.begin(self._time)
        self._release_notices(inputs, out)
        self._take_calls(inputs, out)
        stand_down(self._missions, inputs, out)
        if self._is_first:
            self._is_first = False
            drop_the_old(self._missions, inputs.wall, self.params.resume_max_age, out)
        sees_somebody = self._parts.decision.has_candidate(self._time)
        self._battery.step(self._time, inputs, out, sees_somebody=sees_somebody)
        if not self._hold.step(inputs, out):
            self._choose(inputs, out)
            self._go_on(inputs, out)
        return out

    @property
    def _time(self) -> float:
        return self._steady.clock.time

    def _release_notices(self, inputs: Inputs, out: Commands) -> None:
        out.releases += self._parts.notices.release(inputs.wall, inputs.guarded)
        out.changed |= bool(out.releases)

    def _take_calls(self, inputs: Inputs, out: Commands) -> None:
        agenda, now = self._missions.agenda, self._time
        agenda.see_robot(now, inputs, is_awake=self._is_awake(inputs))
        agenda.see_motion(now, self._parts.views.tracks() if self.mission else (), inputs.house)
        taken = agenda.take(now, inputs, self.mission, has_candidate=self._parts.decision.has_candidate(now))
        out.changed |= taken.changed
        out.ignored += taken.ignored

    def _is_awake(self, inputs: Inputs) -> bool:
        """Whether detector and camera speak."""
        look, now = self.params.look, self._time
        sees = not self._parts.needs_camera or now - inputs.camera_at <= look.camera_timeout
        return sees and now - inputs.detector_at <= look.detector_timeout

    def _choose(self, inputs: Inputs, out: Commands) -> None:
        """End, put back or begin missions."""
        missions, run = self._missions, self._missions.run
        is_ready = missions.ready.step(self._time, inputs)
        if not self.queue or self._battery.is_low:
            return
        following = next(iter(self.queue))
        if run is None and is_ready:
            out.changed = True
            missions.begin(self._time, inputs.wall)
        elif run is not None and run.mission.phase is Phase.RETURNING:
            missions.end(run, out, Place(Whereabouts.ON_ITS_WAY, f" {missions.title(following.room_id)}"))
        elif run is not None and self._may_wait(run.mission, following):
            out.changed = True
            missions.put_back(run.mission, following)

    def _may_wait(self, mission: Mission, other: Request) -> bool:
        """Whether a mission is put back for another: for a sensor's call, unless somebody was seen."""
        return (
            self.params.priorities.preempt
            and mission.origin is not Origin.TRIGGER
            and other.origin is Origin.TRIGGER
            and other.priority > mission.priority
            and mission.verdict is None
        )

    def _go_on(self, inputs: Inputs, out: Commands) -> None:
        run = self._missions.run
        if run is None:
            self._rest(inputs, out)
            return
        leave_out_off_the_map(run, inputs, out)
        place = run.step(self._time, inputs, out, passed=self._steady.clock.passed)
        if place is not None:
            self._missions.end(run, out, place)

    def _rest(self, inputs: Inputs, out: Commands) -> None:
        missions = self._missions
        if inputs.pose is not None:
            is_home = distance(inputs.pose, self._parts.rooms.base.pose) < AT_HOME
            self._battery.rest(self._time, out, is_home=is_home)
        if missions.way_home is not None:
            missions.step_way_home(missions.way_home, self._time, inputs, out)
            return
        phase = Phase.IDLE if missions.ready.is_ready else Phase.STARTING
        missions.say(out, phase, self._battery.text if self._battery.is_low else missions.ready.text)
