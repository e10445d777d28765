"""From trigger to verdict: drive to the room, look around, say what is there, come home.

Matches the tutorial's patrol_robot (a trigger of a room's sensor sends the robot there, it turns once, it comes back
to room 0; persons and fire hydrants alarm).

Differs (CONTRACTS, Settled 4 to 8; A0, quirks):
- One mission at a time, and detections count while driving, looking and returning. Calls that arrive meanwhile wait,
  one entry a room, the most urgent first (`queueing`); which of them are answered already, are the robot's own doing or
  are not armed, `intake` decides. From a mission that is on its way home the robot goes on to the next room at once.
- A room whose point cannot be reached is looked at from another viewpoint (`phases`); one that has none that can be is
  reported as unreachable, and the robot does not turn elsewhere. A room that the points file lacks is refused.
- Every mission ends in a verdict: confirmed, clear, unreachable, or unverified where detector, camera or turn failed,
  the battery or the emergency stop ended it, or a person did.
- A mission gives one notice, at its first confirmation, and one more for each further person elsewhere (`people`).
- While a person is in view the robot stops and keeps the camera on them, for a bounded time (`track`).
- Times are bounded in steady time: a clock that is set ends no drive and no turn.
"""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rosbot_patrol.geometry import Pose2D, distance
from rosbot_patrol.params import param
from rosbot_patrol.patrol import recall, saying
from rosbot_patrol.patrol.battery import BatteryParams, BatteryWatch
from rosbot_patrol.patrol.commands import Commands, Notice, Release, Report, Word
from rosbot_patrol.patrol.drive import Drive, DriveParams
from rosbot_patrol.patrol.inputs import Frame, Inputs
from rosbot_patrol.patrol.intake import Intake
from rosbot_patrol.patrol.judge import Judge
from rosbot_patrol.patrol.look import LookParams
from rosbot_patrol.patrol.mission import Mission, Phase, Verdict
from rosbot_patrol.patrol.own_motion import OwnMotion
from rosbot_patrol.patrol.people import People, PeopleParams, Person
from rosbot_patrol.patrol.phases import LookAround, LookParts, OneTurn, Trip, Views
from rosbot_patrol.patrol.queueing import MissionQueue, PriorityParams
from rosbot_patrol.patrol.readiness import Readiness
from rosbot_patrol.patrol.request import Origin, Request
from rosbot_patrol.patrol.rooms import Room, Rooms
from rosbot_patrol.patrol.spin import SpinParams
from rosbot_patrol.patrol.steady import Heard, SteadyClock
from rosbot_patrol.patrol.track import Track, TrackParams
from rosbot_patrol.patrol.watch import Confirmation, Watch, WatchParams

log = logging.getLogger(__name__)

ALARM_CLASSES = ["person", "fire hydrant"]
AT_HOME = 0.5  # [m] from room 0's point

Viewpoints = Callable[[Room, Inputs], Sequence[Pose2D]]


@dataclass(frozen=True, kw_only=True)
class ManagerParams:
    """The patrol's behaviour."""

    alarm_classes: tuple[str, ...] = param(tuple(ALARM_CLASSES), doc="classes of objects that alarm")
    own_motion_radius: float = param(
        2.0, unit="m", lo=0.0, doc="so near to a room's point the moving robot is what its sensor sees"
    )
    own_motion_memory: float = param(
        2.0, unit="s", lo=0.0, hi=60.0, doc="so long after it was near the robot is still what the sensor saw"
    )
    resume_max_age: float = param(
        43200.0, unit="s", lo=0.0, doc="a call that is older than this after a restart is reported, not followed"
    )
    drive: DriveParams = DriveParams()
    look: LookParams = LookParams()
    spin: SpinParams = SpinParams()
    watch: WatchParams = WatchParams()
    people: PeopleParams = PeopleParams()
    track: TrackParams = TrackParams()
    priorities: PriorityParams = PriorityParams()
    battery: BatteryParams = BatteryParams()


class PatrolManager:
    """The patrol as a function of time and inputs.

    Args:
        rooms: of the points file.
        params: behaviour.
        memory: what `snapshot` gave before the program ended, to go on from there.
        needs_camera: pictures come in, so that a silent camera can be told.
        views: what was seen of a room, and from where to see the rest.
        viewpoints: further poses from which a room is seen, where its own cannot be reached.
        judge: who refuses what cannot be an intruder.
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
        judge: Judge | None = None,
    ) -> None:
        self.rooms = rooms
        self.params = params or ManagerParams()
        self.mission: Mission | None = None
        self.queue = MissionQueue()
        self.last_verdict = ""
        self.held: dict[str, float] = {}  # notices of missions that wait for an entry delay, until [s since 1970]
        self._judge = judge or Judge()
        self._watch = Watch(tuple(self.params.alarm_classes), self.params.watch, self._judge)
        self._people = People(self.params.people)
        self._track = Track(self.params.track)
        self._is_tracking = False
        self._parts = LookParts(
            look=self.params.look, spin=self.params.spin, drive=self.params.drive, needs_camera=needs_camera
        )
        self._views: Views = views or OneTurn()
        self._viewpoints = viewpoints
        self._clock = SteadyClock()
        self._heard = {name: Heard() for name in ("detector_at", "camera_at", "camera_changed_at")}
        self._own_motion = OwnMotion(self.params.own_motion_radius, self.params.own_motion_memory)
        self._intake = Intake(rooms, self.queue, self.params.priorities, self._own_motion)
        self._ready = Readiness(self.params.look)
        self._battery = BatteryWatch(self.params.battery)
        self._trip: Trip | None = None
        self._look: LookAround | None = None
        self._home: Drive | None = None  # the way home without a mission
        self._homes = 0
        self._report: Report | None = None
        self._pending = Commands()  # of what people ordered between two steps
        self._homes_tried = 0
        self._is_first = True
        self._inputs = Inputs()
        self._now = 0.0
        if memory:
            recall.recall(self, self._intake, memory)

    def snapshot(self) -> dict[str, Any]:
        """What has to outlive the program, for JSON."""
        return recall.snapshot(self, self._intake)

    # -- one step

    def step(self, now: float, inputs: Inputs) -> Commands:
        """Take the inputs of this moment, decide.

        Args:
            now: time [s]; may stand still, go back or jump.
            inputs: since the last step.
        """
        out, self._pending, self._now = self._pending, Commands(), now
        passed = self._pass_time(now, inputs)
        inputs = self._inputs = self._in_steady_time(now, inputs)
        time = self._clock.time
        self._own_motion.see(time, inputs.pose, awake=not self._is_blind(inputs))
        if self._is_first:
            self._is_first = False
            self._drop_the_old(inputs, out)
        self._release(inputs, out)
        self._take(inputs, out)
        self._mind_the_battery(inputs, out)
        if inputs.stop:
            self._hold_still(inputs, out)
            return out
        self._choose(time, inputs, out)
        if self.mission is None:
            self._rest(time, inputs, out)
            return out
        self._count(passed, inputs)
        self._watch_frames(inputs, out)
        if self.mission.phase is not Phase.RETURNING:
            self._views.see(self._clock.time, inputs)
            self.mission.share_seen = self._views.share()
        if self._keep_in_view(inputs, out):
            return out
        if self.mission.phase is Phase.LOOKING:
            self._step_look(inputs, out)
        else:
            self._step_drive(inputs, out)
        return out

    def _pass_time(self, now: float, inputs: Inputs) -> float:
        passed = self._clock.step(now)
        if self._clock.jump:
            direction = "back" if self._clock.jump < 0.0 else "forward"
            log.warning("time went %s by %.1f s", direction, abs(self._clock.jump))
            self._watch.start(now)
        return passed

    def _in_steady_time(self, now: float, inputs: Inputs) -> Inputs:
        steady: dict[str, Any] = {
            name: heard.steady(getattr(inputs, name), now, self._clock.time) for name, heard in self._heard.items()
        }
        return dataclasses.replace(inputs, **steady)

    def _is_blind(self, inputs: Inputs) -> bool:
        look = self.params.look
        silent = self._clock.time - inputs.detector_at > look.detector_timeout
        return silent or (self._parts.needs_camera and self._clock.time - inputs.camera_at > look.camera_timeout)

    def _take(self, inputs: Inputs, out: Commands) -> None:
        watching = self._watch.candidate(self._now)
        taken = self._intake.take(self._clock.time, inputs, self.mission, has_candidate=watching)
        out.changed |= taken.changed
        out.ignored += taken.ignored
        if inputs.guarded.mode == "disarmed":
            self._stand_down(inputs, out)

    # -- what to do next

    def _choose(self, time: float, inputs: Inputs, out: Commands) -> None:
        """End, put back or begin missions."""
        mission = self.mission
        ready = self._ready.step(time, inputs)
        if mission and self._trip is None and self._look is None:
            self._go_on(inputs)
        if not self.queue or self._battery.is_low:
            return
        following = next(iter(self.queue))
        if mission and mission.phase is Phase.RETURNING:
            self._end(out, f"going on to {self._title(following.room_id)}")
        elif mission and self._may_wait(mission, following):
            self._put_back(mission, following, out)
        elif mission is None and ready:
            self._begin(inputs, out)

    def _may_wait(self, mission: Mission, other: Request) -> bool:
        """Whether a mission is put back for another: for a sensor's call, where nobody was seen yet."""
        return (
            self.params.priorities.preempt
            and mission.origin is not Origin.TRIGGER
            and other.origin is Origin.TRIGGER
            and other.priority > mission.priority
            and mission.verdict is None
        )

    def _put_back(self, mission: Mission, other: Request, out: Commands) -> None:
        log.info("%s is put back: motion in %s", mission.room.title, self._title(other.room_id))
        self.queue.put_back(
            Request(
                room_id=mission.room.id,
                origin=mission.origin,
                note=mission.note,
                wall=mission.called,
                priority=mission.priority,
                id=mission.id,
                triggers=mission.triggers,
                times=mission.times,
            )
        )
        self._leave(out)
        self._ready.at_rest = (
            f"on guard; {mission.room.title} is put back, as the sensor of {self._title(other.room_id)} calls"
        )

    def _title(self, room_id: int) -> str:
        room = self.rooms.find(room_id)
        return room.title if room else f"room {room_id}"

    def _begin(self, inputs: Inputs, out: Commands) -> None:
        self.mission = recall.begin(self.queue.pop(), self.rooms, inputs.wall)
        self._home = None
        out.changed = True
        self._start(inputs, Phase.DRIVING)

    def _start(self, inputs: Inputs, phase: Phase) -> None:
        assert self.mission is not None
        self.mission.started = self._now
        self._watch.start(self._now)
        self._track.reset()
        self._is_tracking = False
        self._people = People(self.params.people)
        self._people.recall(self.mission.people, self._clock.time)
        self._views.start(self.mission)
        self._enter(phase, inputs)

    def _go_on(self, inputs: Inputs) -> None:
        """Go on with a mission after a restart: where a first full turn was made the look goes on, else it begins."""
        mission = self.mission
        assert mission is not None
        phase = mission.phase
        self._start(inputs, Phase.DRIVING if phase is Phase.LOOKING and not mission.views_done else phase)

    def _enter(self, phase: Phase, inputs: Inputs) -> None:
        mission = self.mission
        assert mission is not None
        mission.phase = phase
        self._trip = self._look = None
        if phase is Phase.LOOKING:
            self._look = LookAround(mission, self._views, self._parts, inputs.pose)
        elif phase is Phase.DRIVING:
            name = f"{mission.id}/{phase.value}"
            self._trip = Trip(name, mission.room.pose, self.params.drive, self._others(mission.room))
        else:
            self._trip = Trip(f"{mission.id}/{phase.value}", self.rooms.base.pose, self.params.drive)

    def _others(self, room: Room) -> Callable[[], Sequence[Pose2D]] | None:
        viewpoints = self._viewpoints
        return (lambda: viewpoints(room, self._inputs)) if viewpoints else None

    # -- phases

    def _count(self, passed: float, inputs: Inputs) -> None:
        mission = self.mission
        assert mission is not None
        name = mission.phase.value
        mission.began.setdefault(name, inputs.wall)
        mission.times[name] = mission.times.get(name, 0.0) + passed

    def _step_drive(self, inputs: Inputs, out: Commands) -> None:
        mission, trip = self.mission, self._trip
        assert mission is not None
        assert trip is not None
        there = mission.phase is Phase.DRIVING
        step = trip.step(self._clock.time, inputs.link, inputs.pose)
        out.goal = step.goal
        out.cancel |= step.cancel
        where = mission.room.title if there else f"home, {saying.verdict(mission)}"
        if step.waiting:
            self._say(out, Phase.STARTING if there else Phase.RETURNING, f"waiting for move_base to drive to {where}")
        elif step.reached and there:
            mission.arrived = self._now
            out.changed = True
            self._enter(Phase.LOOKING, inputs)
            self._say(out, Phase.LOOKING, f"arrived in {mission.room.title}")
        elif step.problem and there:
            self._decide(Verdict.UNREACHABLE, f"{mission.room.title} cannot be reached: {step.problem}")
            self._turn_home(inputs, out)
        elif step.reached or step.problem:
            self._end(out, f"not at home ({step.problem})" if step.problem else "at home again")
        else:
            also = "" if trip.is_at_first else ", to another viewpoint in it"
            self._say(out, mission.phase, f"driving to {where}{also}")

    def _step_look(self, inputs: Inputs, out: Commands) -> None:
        mission, look = self.mission, self._look
        assert mission is not None
        assert look is not None
        candidate = mission.sightings == 0 and self._watch.candidate(self._now)
        step = look.step(self._clock.time, inputs, candidate=candidate)
        out.speed, out.goal = step.speed, step.goal
        out.cancel |= step.cancel
        out.changed |= step.progress
        if not step.done:
            self._say(out, Phase.LOOKING, f"{step.why}, in {mission.room.title}")
            return
        mission.looked = self._now
        problem = step.problem or self._views.blind()
        if problem:
            moved = self._views.moved()
            also = f"; {moved}" if moved else ""
            self._decide(Verdict.UNVERIFIED, f"{mission.room.title} could not be verified: {problem}{also}")
        else:
            self._decide(Verdict.CLEAR, saying.clear(mission, look.turned_deg, self._watch.refusals))
        self._turn_home(inputs, out)

    def _decide(self, verdict: Verdict, reason: str) -> None:
        mission = self.mission
        assert mission is not None
        if mission.verdict is Verdict.CONFIRMED:  # nothing that comes later takes that back
            is_clear = verdict is Verdict.CLEAR
            log.info("%s", f"the look around in {mission.room.title} is over" if is_clear else reason)
            return
        mission.verdict, mission.reason = verdict, reason
        (log.info if verdict is Verdict.CLEAR else log.warning)("%s", reason)

    def _turn_home(self, inputs: Inputs, out: Commands) -> None:
        assert self.mission is not None
        out.changed = True
        self._enter(Phase.RETURNING, inputs)
        self._say(out, Phase.RETURNING, f"driving home, {saying.verdict(self.mission)}")

    def _end(self, out: Commands, place: str) -> None:
        """The mission is over; `place` says where the robot is or goes."""
        mission = self.mission
        assert mission is not None
        if mission.verdict is None:
            self._decide(Verdict.UNVERIFIED, f"{mission.room.title} was not looked at")
        (log.info if place == "at home again" else log.warning)(
            "the mission to %s is over, %s", mission.room.title, place
        )
        self._close(mission, out)
        self._leave(out)
        self._ready.at_rest = f"on guard, {place}; {saying.verdict(mission)}"
        self._say(out, Phase.IDLE, self._ready.at_rest)

    def _leave(self, out: Commands) -> None:
        self.mission = self._trip = self._look = None
        out.changed = True

    def _close(self, mission: Mission, out: Commands) -> None:
        assert mission.verdict is not None
        self.last_verdict = mission.verdict.value
        out.ended += (mission,)
        out.changed = True

    # -- without a mission

    def _rest(self, time: float, inputs: Inputs, out: Commands) -> None:
        low = self._battery.is_low
        if low and self._home is None and self._homes_tried == 0 and not self._is_home(inputs):
            self._homes_tried += 1
            self._drive_home()
        if self._home is not None:
            self._step_home(time, inputs, out)
            return
        phase = Phase.IDLE if self._ready.is_ready else Phase.STARTING
        self._say(
            out, phase, f"waiting for the battery, which is low ({self._battery.text})" if low else self._ready.text
        )

    def _is_home(self, inputs: Inputs) -> bool:
        return inputs.pose is None or distance(inputs.pose, self.rooms.base.pose) < AT_HOME

    def _drive_home(self) -> None:
        self._homes += 1
        self._home = Drive(f"home/{self._homes}", self.rooms.base.pose, self.params.drive)

    def _step_home(self, time: float, inputs: Inputs, out: Commands) -> None:
        assert self._home is not None
        step = self._home.step(time, inputs.link, inputs.pose)
        out.goal = step.goal
        out.cancel |= step.cancel
        if step.reached or step.problem:
            self._home = None
            place = f"not at home ({step.problem})" if step.problem else "at home again"
            self._ready.at_rest = f"on guard, {place}"
            self._say(out, Phase.IDLE, self._ready.at_rest)
        else:
            self._say(out, Phase.RETURNING, "waiting for move_base to drive home" if step.waiting else "driving home")

    # -- what ends a mission early

    def _mind_the_battery(self, inputs: Inputs, out: Commands) -> None:
        if self._battery.step(self._now, inputs.battery):
            low = self._battery.is_low
            text = f"the battery is low ({self._battery.text}): the robot goes home and waits there"
            text = text if low else f"the battery is no longer low ({self._battery.text})"
            (log.warning if low else log.info)("%s", text)
            out.words += (Word(kind="battery", text=text, is_over=not low),)
            self._homes_tried = 0
        mission = self.mission
        if self._battery.is_low and mission and mission.phase is not Phase.RETURNING:
            title, text = mission.room.title, self._battery.text
            self._decide(Verdict.UNVERIFIED, f"{title} was not looked at to the end: the battery is low ({text})")
            self._turn_home(inputs, out)

    def _hold_still(self, inputs: Inputs, out: Commands) -> None:
        """The emergency stop is pressed."""
        if self._report is None or self._report.phase is not Phase.STOPPED:
            out.cancel = out.cancel_all = True
        self._home = None
        out.goal, out.speed = None, 0.0
        if self.mission:
            title = self.mission.room.title
            self._decide(Verdict.UNVERIFIED, f"{title} was not looked at to the end: {inputs.stop}")
            self._end(out, "where it was stopped")
        self._ready.at_rest = "on guard, where it was stopped"
        self._say(out, Phase.STOPPED, f"{inputs.stop}; it holds until it is released")

    def _drop_the_old(self, inputs: Inputs, out: Commands) -> None:
        """What was called for so long before a restart that a look would come too late."""
        oldest = inputs.wall - self.params.resume_max_age
        why = f"the patrol was down for more than {self.params.resume_max_age / 3600.0:g} hours"
        old = [request for request in self.queue if request.wall < oldest]
        kept = self.queue.drop()
        self._give_up(old, why, out)
        for request in kept:
            if request not in old:
                self.queue.add(request)
        if self.mission and self.mission.called < oldest:
            self._decide(Verdict.UNVERIFIED, f"{self.mission.room.title} was not looked at to the end: {why}")
            self._end(out, "where it is")

    def _stand_down(self, inputs: Inputs, out: Commands) -> None:
        """The house was disarmed: what sensors and rounds called for is over."""
        guarding = (Origin.TRIGGER, Origin.SILENT_SENSOR, Origin.SCHEDULE)
        self._give_up(self.queue.drop(*guarding), inputs.guarded.why, out)
        mission = self.mission
        if mission and mission.origin in guarding and mission.phase is not Phase.RETURNING:
            self._decide(Verdict.UNVERIFIED, f"{mission.room.title} was not looked at to the end: {inputs.guarded.why}")
            self._enter(Phase.RETURNING, inputs)
            out.cancel = out.changed = True

    def _give_up(self, requests: Iterable[Request], why: str, out: Commands) -> None:
        """Requests that will not be followed get their verdict, too."""
        for request in requests:
            mission = recall.begin(request, self.rooms, self._inputs.wall)
            mission.verdict, mission.reason = Verdict.UNVERIFIED, f"{mission.room.title} was not looked at: {why}"
            log.warning("%s", mission.reason)
            self._close(mission, out)

    # -- people's orders, between two steps; each says what was done

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

    # -- detections

    def _watch_frames(self, inputs: Inputs, out: Commands) -> None:
        mission = self.mission
        assert mission is not None
        if inputs.house is not None:
            self._judge.floor = inputs.house.floor
        for frame in inputs.frames:
            for seen in self._watch.add(self._now, frame):
                self._note(mission, seen, inputs, out)
            self._point_at(frame, inputs)

    def _note(self, mission: Mission, seen: Confirmation, inputs: Inputs, out: Commands) -> None:
        """Somebody was confirmed."""
        mission.sightings += 1
        if mission.best is None or seen.probability > mission.best.probability:
            mission.best = seen
        person, is_new = self._people.note(self._clock.time, seen.measured)
        person.label, person.room = seen.label, self._room_at(person, inputs)
        mission.people = self._people.places
        mission.place = mission.people[0]
        out.people = tuple(self._people.met)
        if mission.verdict is not Verdict.CONFIRMED:
            self._decide(Verdict.CONFIRMED, saying.sighting(mission, seen, person.room))
        if is_new:
            if person.number > 1:
                log.warning(
                    "a second incident, %s: %s", f"{mission.id}-{person.number}", saying.sighting(mission, seen)
                )
            mission.notified = out.changed = True
            out.notices += (self._notice(mission, inputs, seen, person.number),)

    def _room_at(self, person: Person, inputs: Inputs) -> str:
        """The room in which a person is, "" where that is not known."""
        if inputs.house is None or person.x is None or person.y is None:
            return ""
        room = self.rooms.find(inputs.house.room_at(person.x, person.y))
        return room.title if room else ""

    def _notice(self, mission: Mission, inputs: Inputs, seen: Confirmation, number: int) -> Notice:
        copy = dataclasses.replace(mission, people=list(mission.people))
        if number > 1:
            copy.id, copy.place = f"{mission.id}-{number}", mission.people[number - 1]
        until = inputs.guarded.holds_until
        if until is not None:
            self.held[copy.id] = until
        return Notice(mission=copy, seen=seen, phase=mission.phase, pose=inputs.pose, is_held=until is not None)

    # -- the camera is kept on a person

    def _point_at(self, frame: Frame, inputs: Inputs) -> None:
        boxes = self._watch.plausible(frame)
        if not boxes or (self._watch.lately(self._now) < 2 and not self._track.is_on):
            return  # a single picture stops no drive
        if frame.eye is None:
            return
        column = (boxes[0].xmin + boxes[0].xmax) / 2.0
        self._track.see(self._clock.time, frame.eye.bearing(column), frame.eye.pose.yaw)

    def _keep_in_view(self, inputs: Inputs, out: Commands) -> bool:
        """Turn towards whom the camera has in view; what the robot was about waits."""
        speed = self._track.step(self._clock.time, inputs.pose.yaw if inputs.pose else None)
        mission, was_tracking = self.mission, self._is_tracking
        assert mission is not None
        self._is_tracking = speed is not None
        if speed is None:
            return False
        if not was_tracking:
            out.cancel |= self._interrupt()
        if self._look is not None and not self._look.drives:
            self._look.step(self._clock.time, inputs, candidate=False, held=True)
        near = inputs.clearance is not None and inputs.clearance < self.params.spin.spin_clearance
        out.speed = 0.0 if near else speed
        self._say(out, mission.phase, f"keeping the camera on somebody, {saying.phase_text(mission)}")
        return True

    def _interrupt(self) -> bool:
        """Leave off driving; whether there is a goal to give up."""
        if self._look is not None:
            self._look.pause()
            return self._look.drives
        if self._trip is not None:
            self._trip.pause()
        return self._trip is not None

    def _release(self, inputs: Inputs, out: Commands) -> None:
        """Notices whose entry delay is over, or that were disarmed in time."""
        for mission, until in list(self.held.items()):
            disarmed = inputs.guarded.mode == "disarmed"
            if disarmed or inputs.wall >= until or inputs.guarded.holds_until is None:
                del self.held[mission]
                why = "disarmed within the entry delay" if disarmed else "the entry delay is over"
                out.releases += (Release(mission=mission, is_dropped=disarmed, why=why),)
                out.changed = True

    # -- what people are told

    def _say(self, out: Commands, phase: Phase, why: str) -> None:
        report = saying.report(phase, why, self.mission, self.queue, self.last_verdict, self._inputs.guarded.mode)
        if report != self._report:
            self._report = report
            out.report = report
