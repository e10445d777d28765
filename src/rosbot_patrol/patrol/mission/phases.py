"""The phases of a mission as objects: driving to the room, looking around, returning home."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import ClassVar, Protocol

from rosbot_patrol.geometry import Pose2D, distance
from rosbot_patrol.goal import Goal, Progress
from rosbot_patrol.patrol.belief.decision import IntruderDecision
from rosbot_patrol.patrol.house.rooms import Room
from rosbot_patrol.patrol.mission.drive import DriveParams, OtherPoses, Trip, WayHome, end_of_way_home
from rosbot_patrol.patrol.mission.look_around import LookAround, LookParts
from rosbot_patrol.patrol.mission.views import Views
from rosbot_patrol.patrol.records.activity import Activity, Place
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Mission, Phase, Verdict
from rosbot_patrol.patrol.story import status_text

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Arrived:
    """The robot stands where the room is seen from."""


@dataclass(frozen=True)
class Ruling:
    """The verdict that a phase comes to.

    Attributes:
        verdict, reason: with its sentence.
        fault: of the robot (its camera shows nothing, no navigation), which kept it from looking, "" if none did.
    """

    verdict: Verdict
    reason: str
    fault: str = ""


@dataclass(frozen=True, kw_only=True)
class PhaseStep:
    """One step of a phase.

    Attributes:
        status, why: state to report while the phase goes on.
        goal: to be sent; cancel: the goal that runs is to be given up.
        speed: turning speed [rad/s], None if the wheels belong to another part.
        is_progress: a viewpoint is done, which has to outlive the program.
        outcome: how the phase ended, None while it goes on; a `Place` ends the mission.
    """

    status: Phase
    why: str = ""
    goal: Goal | None = None
    cancel: bool = False
    speed: float | None = None
    is_progress: bool = False
    outcome: Arrived | Ruling | Place | None = None


class PhaseRun(Protocol):
    """A phase of a mission while it runs."""

    phase: ClassVar[Phase]

    def step(self, now: float, inputs: Inputs) -> PhaseStep:
        """Go on; `now` and the stamps of `inputs` in steady time [s]."""

    def pause(self) -> bool:
        """Interrupt the drive, which the next step takes up again; returns whether a goal has to be given up."""

    def hold(self, now: float, inputs: Inputs) -> None:
        """Keep measuring in a step in which another part has the wheels."""


class DrivingTo:
    """The drive to the room, or to another viewpoint of it.

    Args:
        mission: whose room.
        params: bounds.
        others: gives further poses that show the room.
    """

    phase: ClassVar[Phase] = Phase.DRIVING

    def __init__(self, mission: Mission, params: DriveParams, others: OtherPoses | None) -> None:
        self._room, self._params = mission.room, params
        self._progress = Progress()
        self._trip = Trip(f"{mission.id}/{self.phase.value}", mission.room.pose, params, others)

    def step(self, now: float, inputs: Inputs) -> PhaseStep:
        """Drive on."""
        title = self._room.title
        step = self._trip.step(now, inputs)
        if step.waiting:
            why = f"{Activity.WAITING_FOR_NAVIGATION.value} to drive to {title}"
            return PhaseStep(status=Phase.STARTING, why=why, goal=step.goal, cancel=step.cancel)
        outcome: Arrived | Ruling | None = Arrived() if step.reached else None
        if step.problem:
            reason, fault = f"{title} cannot be reached: {step.problem}", step.problem if step.is_down else ""
            outcome = Ruling(Verdict.UNREACHABLE, reason, fault)
        why = f"driving to {title}{'' if self._trip.is_at_first else ', to another viewpoint in it'}"
        if outcome is None and self._is_held_in_room(now, inputs):
            log.info("%s: something holds the robot up in it, which looks from where it stands", title)
            return PhaseStep(status=self.phase, why=why, cancel=True, outcome=Arrived())
        return PhaseStep(status=self.phase, why=why, goal=step.goal, cancel=step.cancel, outcome=outcome)

    def _is_held_in_room(self, now: float, inputs: Inputs) -> bool:
        if inputs.pose is None or inputs.house is None:
            return False
        stalled = self._progress.stalled(now, distance(inputs.pose, self._room.pose))
        is_inside = inputs.house.room_at(inputs.pose.x, inputs.pose.y) == self._room.id
        return is_inside and stalled > self._params.held_after

    def pause(self) -> bool:
        """Interrupt the drive."""
        self._trip.pause()
        self._progress = Progress()
        return True

    def hold(self, now: float, inputs: Inputs) -> None:
        """A drive that others interrupt is not held up."""
        self._progress = Progress()


class LookingAround:
    """The look at the room, and the verdict that it allows.

    Args:
        mission: whose room; kept up.
        views: what was seen of the room.
        decision: what was seen of intruders.
        parts: parameters.
        pose: where the robot stands now, None if unknown.
    """

    phase: ClassVar[Phase] = Phase.LOOKING

    def __init__(
        self, mission: Mission, views: Views, decision: IntruderDecision, parts: LookParts, *, pose: Pose2D | None
    ) -> None:
        self._mission, self._views, self._decision = mission, views, decision
        self._look = LookAround(mission, views, parts, pose)

    def step(self, now: float, inputs: Inputs) -> PhaseStep:
        """Look on."""
        mission = self._mission
        candidate = mission.sightings == 0 and self._decision.has_candidate(now)
        step = self._look.step(now, inputs, candidate=candidate)
        if step.done:
            mission.looked = now
        return PhaseStep(
            status=self.phase,
            why=f"{step.why}, in {mission.room.title}",
            goal=step.goal,
            cancel=step.cancel,
            speed=step.speed,
            is_progress=step.progress,
            outcome=self._ruling(step.problem) if step.done else None,
        )

    def _ruling(self, fault: str) -> Ruling:
        problem = fault or self._views.blind()
        if not problem:
            clear = status_text.clear(self._mission, self._look.turned_deg, self._decision.belief.vetoes)
            return Ruling(Verdict.CLEAR, clear)
        moved = self._views.moved()
        also = f"; {moved}" if moved else ""
        reason = f"{self._mission.room.title} could not be verified: {problem}{also}"
        return Ruling(Verdict.UNVERIFIED, reason, fault)

    def pause(self) -> bool:
        """Interrupt the drive to a further viewpoint, if there is one."""
        self._look.pause()
        return self._look.is_driving

    def hold(self, now: float, inputs: Inputs) -> None:
        """Measure the turn that another part makes."""
        if not self._look.is_driving:
            self._look.step(now, inputs, candidate=False, held=True)


class Returning:
    """The way home after the look.

    Args:
        mission: that is over but for the way home.
        base: room 0.
        params: bounds.
    """

    phase: ClassVar[Phase] = Phase.RETURNING

    def __init__(self, mission: Mission, base: Room, params: DriveParams) -> None:
        self._mission = mission
        self._way = WayHome(f"{mission.id}/{self.phase.value}", base, params)

    def step(self, now: float, inputs: Inputs) -> PhaseStep:
        """Drive on."""
        step = self._way.step(now, inputs)
        doing = f"{Activity.WAITING_FOR_NAVIGATION.value} to drive to" if step.waiting else "driving to"
        return PhaseStep(
            status=self.phase,
            why=f"{doing} home, {status_text.verdict(self._mission)}",
            goal=step.goal,
            cancel=step.cancel,
            outcome=end_of_way_home(step),
        )

    def pause(self) -> bool:
        """Interrupt the drive."""
        self._way.pause()
        return True

    def hold(self, now: float, inputs: Inputs) -> None:
        """Nothing to measure."""
