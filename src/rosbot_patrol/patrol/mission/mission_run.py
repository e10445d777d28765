"""One mission while it runs: its phase, what it finds on the way, its verdict."""

from __future__ import annotations

import dataclasses
import logging

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.belief.decision import Finding, IntruderDecision
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.mission.drive import OtherPoses
from rosbot_patrol.patrol.mission.look_around import LookParts
from rosbot_patrol.patrol.mission.notices import NoticeGate
from rosbot_patrol.patrol.mission.params import ManagerParams
from rosbot_patrol.patrol.mission.phases import (
    Arrived,
    DrivingTo,
    LookingAround,
    PhaseRun,
    PhaseStep,
    Returning,
    Ruling,
)
from rosbot_patrol.patrol.mission.views import Viewpoints, Views
from rosbot_patrol.patrol.records.activity import Activity, Place
from rosbot_patrol.patrol.records.commands import Commands, IntruderAlarm, OwnerMessage
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Mission, Phase, Verdict
from rosbot_patrol.patrol.records.request import Origin
from rosbot_patrol.patrol.story import status_text
from rosbot_patrol.patrol.story.status_text import StatusReports

log = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class RunParts:
    """What every mission works with.

    Attributes:
        rooms: of the points file; params: behaviour.
        needs_camera: pictures come in, so that a silent camera can be told.
        views: what was seen of a room; viewpoints: further poses that show a room.
        decision: who is an intruder; notices: which notices wait; status: reports the state.
    """

    rooms: Rooms
    params: ManagerParams
    needs_camera: bool
    views: Views
    viewpoints: Viewpoints | None
    decision: IntruderDecision
    notices: NoticeGate
    status: StatusReports

    @property
    def look(self) -> LookParts:
        """The part of a look around."""
        p = self.params
        return LookParts(look=p.look, spin=p.spin, drive=p.drive, needs_camera=self.needs_camera)


class MissionRun:
    """A mission with the phase that it is in.

    After a restart it goes on in the phase of its record; a look without a full turn begins again with the drive.

    Args:
        mission: its record, kept up.
        parts: what it works with.

    Attributes:
        is_following: the camera is kept on somebody, and the phase waits.
    """

    def __init__(self, mission: Mission, parts: RunParts) -> None:
        self.mission, self._parts = mission, parts
        self.is_following = False
        is_fresh_look = mission.phase is Phase.LOOKING and not mission.views_done
        self._phase: PhaseRun = self._phase_run(Phase.DRIVING if is_fresh_look else mission.phase, None)
        mission.phase = self._phase.phase

    def begin(self, now: float) -> None:
        """Count what is seen from now on; steady time [s]."""
        self.mission.started = now
        self._parts.decision.start(now, self.mission.people)
        self._parts.views.start(self.mission, self._parts.decision.belief)

    def step(self, now: float, inputs: Inputs, out: Commands, *, passed: float) -> Place | None:
        """Go on; where the mission ended, None while it runs.

        Args:
            now: steady time [s], as the stamps of `inputs`.
            inputs: of this step.
            out: takes the commands.
            passed: time since the last step [s].
        """
        self._count(passed, inputs)
        if self.mission.phase is not Phase.RETURNING:
            self._parts.views.see(now, inputs)
            self.mission.share_seen = self._parts.views.share()
        self._look_for_intruders(now, inputs, out)
        if self._follow_somebody(now, inputs, out):
            return None
        return self._take(self._phase.step(now, inputs), now, inputs, out)

    # -- verdict and end

    def decide(self, verdict: Verdict, reason: str) -> None:
        """Set the verdict. A later verdict never replaces an earlier one, except that a confirmation always does."""
        mission = self.mission
        if mission.verdict is not None and verdict is not Verdict.CONFIRMED:
            is_clear = verdict is Verdict.CLEAR
            log.info("%s", f"the look around in {mission.room.title} is over" if is_clear else reason)
            return
        mission.verdict, mission.reason = verdict, reason
        (log.info if verdict is Verdict.CLEAR else log.warning)("%s", reason)

    def give_up(self, why: str) -> None:
        """Leave the room unverified, unless there is a verdict."""
        self.decide(Verdict.UNVERIFIED, f"{self.mission.room.title} was not looked at to the end: {why}")

    def confirm(self, reason: str) -> None:
        """Confirm by a notice on disk that the memory does not know: the program was killed between the two."""
        mission = self.mission
        mission.verdict, mission.reason, mission.notified = Verdict.CONFIRMED, reason, True
        mission.sightings = max(mission.sightings, 1)
        log.warning("%s", reason)

    def tell_of_call(self, problem: str, out: Commands) -> None:
        """Tell the owner of a motion sensor's call to which the robot could not see; `problem` ends the sentence."""
        mission = self.mission
        if mission.origin is Origin.TRIGGER:
            text = f"motion in {mission.room.title}, {problem}"
            out.words += (OwnerMessage(kind=f"room {mission.room.id}", text=text),)

    def return_home(self) -> None:
        """Go over to the way home."""
        self._enter(Phase.RETURNING, None)

    def turn_home(self, out: Commands) -> None:
        """Go over to the way home, and report it."""
        out.changed = True
        self.return_home()
        self._say(out, Phase.RETURNING, f"driving home, {status_text.verdict(self.mission)}")

    # -- phases

    def _enter(self, phase: Phase, pose: Pose2D | None) -> None:
        self.mission.phase = phase
        self._phase = self._phase_run(phase, pose)

    def _phase_run(self, phase: Phase, pose: Pose2D | None) -> PhaseRun:
        mission, parts = self.mission, self._parts
        if phase is Phase.LOOKING:
            return LookingAround(mission, parts.views, parts.decision, parts.look, pose=pose)
        if phase is Phase.DRIVING:
            return DrivingTo(mission, parts.params.drive, self._other_poses())
        return Returning(mission, parts.rooms.base, parts.params.drive)

    def _other_poses(self) -> OtherPoses | None:
        room, viewpoints = self.mission.room, self._parts.viewpoints
        return (lambda inputs: viewpoints(room, inputs)) if viewpoints else None

    def _take(self, step: PhaseStep, now: float, inputs: Inputs, out: Commands) -> Place | None:
        out.goal, out.speed = step.goal, step.speed
        out.cancel |= step.cancel
        out.changed |= step.is_progress
        match step.outcome:
            case None:
                self._say(out, step.status, step.why)
            case Arrived():
                self.mission.arrived = now
                out.changed = True
                self._enter(Phase.LOOKING, inputs.pose)
                self._say(out, Phase.LOOKING, f"arrived in {self.mission.room.title}")
            case Ruling(verdict, reason, fault):
                self.decide(verdict, reason)
                if fault and self.mission.verdict is not Verdict.CONFIRMED:
                    self.tell_of_call(f"which could not be looked at to the end: {fault}", out)
                self.turn_home(out)
            case Place():
                return step.outcome
        return None

    def _count(self, passed: float, inputs: Inputs) -> None:
        mission, name = self.mission, self.mission.phase.value
        mission.began.setdefault(name, inputs.wall)
        mission.times[name] = mission.times.get(name, 0.0) + passed

    def _say(self, out: Commands, phase: Phase, why: str) -> None:
        self._parts.status.say(out, phase, why, self.mission)

    # -- intruders

    def _look_for_intruders(self, now: float, inputs: Inputs, out: Commands) -> None:
        decision = self._parts.decision
        for finding in decision.see(now, inputs, self._parts.views.tracks()):
            self._note(finding, inputs, out)
            out.people = tuple(decision.met)
        out.pictures = decision.pictures

    def _note(self, finding: Finding, inputs: Inputs, out: Commands) -> None:
        mission, seen = self.mission, finding.seen
        mission.sightings += 1
        if mission.best is None or seen.probability > mission.best.probability:
            mission.best = seen
        mission.people = list(finding.places)
        if mission.place is None and finding.number == 1:  # it stays what the sentence and the mail say
            mission.place, mission.place_room = finding.places[0], finding.room
            mission.is_outside = finding.is_outside
        said = status_text.sighting(mission, seen, finding.room, is_outside=finding.is_outside)
        if mission.verdict is not Verdict.CONFIRMED:
            self.decide(Verdict.CONFIRMED, said)
        if finding.is_new:
            out.alarms += (self._alarm(finding, said, inputs),)
            mission.notified = out.changed = True

    def _alarm(self, finding: Finding, said: str, inputs: Inputs) -> IntruderAlarm:
        """The alarm about a person met for the first time; a second person has a record of their own."""
        mission = self.mission
        copy = dataclasses.replace(mission, people=list(mission.people))
        if finding.number > 1:
            copy.id, copy.place = f"{mission.id}-{finding.number}", finding.places[finding.number - 1]
            copy.place_room, copy.is_outside, copy.reason = finding.room, finding.is_outside, said
            log.warning("a second incident, %s: %s", copy.id, said)
        alarm = IntruderAlarm(mission=copy, seen=finding.seen, phase=mission.phase, pose=inputs.pose)
        return self._parts.notices.admit(alarm, inputs.guarded)

    def _follow_somebody(self, now: float, inputs: Inputs, out: Commands) -> bool:
        """Turn towards the person in view; the phase waits meanwhile."""
        speed = self._parts.decision.camera_speed(now, inputs)
        was_following, self.is_following = self.is_following, speed is not None
        if speed is None:
            return False
        if not was_following:
            out.cancel |= self._phase.pause()
        self._phase.hold(now, inputs)
        is_blocked = inputs.clearance is not None and inputs.clearance < self._parts.params.spin.spin_clearance
        out.speed = 0.0 if is_blocked else speed
        where = status_text.phase_text(self.mission)
        self._say(out, self.mission.phase, f"{Activity.FOLLOWING.value}, {where}")
        return True
