"""How one mission is carried out: the drive, the look, the verdict, the way home, and what is told on the way."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

from rosbot_patrol.geometry import Pose2D, distance
from rosbot_patrol.patrol.calls.queue import MissionQueue
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.patrol.intruder.camera_tracking import Track
from rosbot_patrol.patrol.intruder.close_ups import CloseUps
from rosbot_patrol.patrol.intruder.exclusions import Judge
from rosbot_patrol.patrol.intruder.persons import People
from rosbot_patrol.patrol.intruder.sightings import Watch
from rosbot_patrol.patrol.intruder.weak_sightings import Suspects
from rosbot_patrol.patrol.mission.drive import Drive, DriveStep
from rosbot_patrol.patrol.mission.params import ManagerParams
from rosbot_patrol.patrol.mission.phases import LookAround, LookParts, OneTurn, Trip, Views
from rosbot_patrol.patrol.mission.readiness import Readiness
from rosbot_patrol.patrol.mission.steady import SteadyClock
from rosbot_patrol.patrol.records.commands import Commands, Report
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Mission, Phase, Verdict
from rosbot_patrol.patrol.story import status_text as saying

log = logging.getLogger(__name__)

AT_HOME = 0.5  # [m] from room 0's point

Viewpoints = Callable[[Room, Inputs], Sequence[Pose2D]]


class Conduct:
    """The mission that runs, if one does; which one, a subclass decides.

    Args:
        rooms: of the points file.
        params: behaviour.
        needs_camera: pictures come in, so that a silent camera can be told.
        views: what was seen of a room, and from where to see the rest.
        viewpoints: further poses from which a room is seen, where its own cannot be reached.
        judge: who refuses what cannot be an intruder.

    Attributes:
        mission: that runs; queue: what waits.
        last_verdict: of the mission that ended last, "" before the first.
        held: missions whose notices wait for an entry delay, until when [s since 1970].
    """

    def __init__(
        self,
        rooms: Rooms,
        params: ManagerParams,
        *,
        needs_camera: bool = True,
        views: Views | None = None,
        viewpoints: Viewpoints | None = None,
        judge: Judge | None = None,
    ) -> None:
        self.rooms, self.params = rooms, params
        self.mission: Mission | None = None
        self.queue = MissionQueue()
        self.last_verdict = ""
        self.held: dict[str, float] = {}
        self._judge = judge or Judge()
        self._watch = Watch(tuple(params.alarm_classes), params.watch, self._judge)
        self._suspects = Suspects(params.suspects)
        self._close_ups = CloseUps(self._judge)
        self._people = People(params.people)
        self._track = Track(params.track)
        self._is_tracking = False
        self._parts = LookParts(look=params.look, spin=params.spin, drive=params.drive, needs_camera=needs_camera)
        self._views: Views = views or OneTurn()
        self._viewpoints = viewpoints
        self._clock = SteadyClock()
        self._ready = Readiness(params.look)
        self._trip: Trip | None = None
        self._look: LookAround | None = None
        self._home: Drive | None = None  # the way home without a mission
        self._homes = 0
        self._report: Report | None = None
        self._inputs = Inputs()

    # -- its phases

    def _start(self, inputs: Inputs, phase: Phase) -> None:
        assert self.mission is not None
        self.mission.started = self._clock.time
        self._watch.start(self._clock.time)
        self._suspects.start(self._clock.time)
        self._close_ups.start()
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
        lost = "" if there else self._base_problem(inputs)
        if lost:
            self._end(out, f"not at home ({lost})")
            return
        step = trip.step(self._clock.time, inputs.link, inputs.pose)
        out.goal = step.goal
        out.cancel |= step.cancel
        where = mission.room.title if there else f"home, {saying.verdict(mission)}"
        if step.waiting:
            self._say(out, Phase.STARTING if there else Phase.RETURNING, f"waiting for move_base to drive to {where}")
        elif step.reached and there:
            mission.arrived = self._clock.time
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
        candidate = mission.sightings == 0 and self._watch.candidate(self._clock.time)
        step = look.step(self._clock.time, inputs, candidate=candidate)
        out.speed, out.goal = step.speed, step.goal
        out.cancel |= step.cancel
        out.changed |= step.progress
        if not step.done:
            self._say(out, Phase.LOOKING, f"{step.why}, in {mission.room.title}")
            return
        mission.looked = self._clock.time
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
        if mission.verdict is not None and verdict is not Verdict.CONFIRMED:  # nothing that comes later takes it back
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
        out.suspects += saying.suspects(self._suspects.all)
        out.ended += (mission,)
        out.changed = True

    # -- the way home without a mission

    def _is_home(self, inputs: Inputs) -> bool:
        return inputs.pose is None or distance(inputs.pose, self.rooms.base.pose) < AT_HOME

    def _drive_home(self) -> None:
        self._homes += 1
        self._home = Drive(f"home/{self._homes}", self.rooms.base.pose, self.params.drive)

    def _base_problem(self, inputs: Inputs) -> str:
        """Why the robot cannot come home, "" where it can."""
        lost = inputs.house.refusal(self.rooms.base) if inputs.house is not None else ""
        return f"{self.rooms.base.title}: {lost}" if lost else ""

    def _step_home(self, time: float, inputs: Inputs, out: Commands) -> None:
        assert self._home is not None
        lost = self._base_problem(inputs)
        step = DriveStep(problem=lost) if lost else self._home.step(time, inputs.link, inputs.pose)
        out.goal = step.goal
        out.cancel |= step.cancel
        if step.reached or step.problem:
            self._home = None
            place = f"not at home ({step.problem})" if step.problem else "at home again"
            self._ready.at_rest = f"on guard, {place}"
            self._say(out, Phase.IDLE, self._ready.at_rest)
        else:
            self._say(out, Phase.RETURNING, "waiting for move_base to drive home" if step.waiting else "driving home")

    # -- what people are told

    def _say(self, out: Commands, phase: Phase, why: str) -> None:
        report = saying.report(phase, why, self.mission, self.queue, self.last_verdict, self._inputs.guarded.mode)
        if report != self._report:
            self._report = report
            out.report = report
