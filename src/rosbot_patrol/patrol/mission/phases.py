"""The two things that a mission does: get to a point from which its room is seen, and look at it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Protocol

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.goal import GoalLink
from rosbot_patrol.patrol.intruder.close_ups import Sighting
from rosbot_patrol.patrol.intruder.weak_sightings import Suspect
from rosbot_patrol.patrol.mission.drive import Drive, DriveParams, DriveStep
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Mission
from rosbot_patrol.patrol.search.look import Look, LookParams, LookStep
from rosbot_patrol.patrol.search.turn import SpinParams
from rosbot_patrol.patrol.visibility.viewpoints import Viewpoint

Choose = Callable[[], Sequence[Pose2D]]


class Trip:
    """A drive to one of several poses that serve as well: the next is tried where navigation gives one up.

    Args:
        name: of the trip, unlike any other's.
        pose: the first to try, as often as `params` say.
        params: bounds.
        others: gives further poses, asked for when the first has failed; each is tried once.
    """

    def __init__(self, name: str, pose: Pose2D, params: DriveParams, others: Choose | None = None) -> None:
        self._name, self._params, self._others = name, params, others
        self._drive = Drive(name, pose, params)
        self._left: list[Pose2D] | None = None
        self._tried = 0
        self._problem = ""
        self.pose = pose

    @property
    def is_at_first(self) -> bool:
        """Whether it still goes to the first pose."""
        return self._tried == 0

    def pause(self) -> None:
        """The drive is interrupted; the next step takes it up again."""
        self._drive.pause()

    def step(self, now: float, link: GoalLink, pose: Pose2D | None) -> DriveStep:
        """Drive on."""
        step = self._drive.step(now, link, pose)
        if not step.problem or step.is_down:
            return step
        self._problem = self._problem or step.problem
        if self._left is None:
            self._left = list(self._others())[: self._params.other_viewpoints] if self._others else []
        if self._left:
            self._tried += 1
            self.pose = self._left.pop(0)
            once = dataclasses.replace(self._params, goal_attempts=1)
            self._drive = Drive(f"{self._name}/{self._tried}", self.pose, once)
            return DriveStep(cancel=step.cancel)
        also = f"; {self._tried} other viewpoints in it failed, too" if self._tried else ""
        return dataclasses.replace(step, problem=self._problem + also)


class Views(Protocol):
    """What has been seen of a room, and from where to see the rest."""

    def start(self, mission: Mission) -> None:
        """A mission begins, or goes on after a restart: `mission.views_done` says what was done."""

    def see(self, now: float, inputs: Inputs) -> None:
        """One step of the drive to the room or of the look."""

    def suspect(self, doubtful: Sequence[Suspect]) -> None:
        """What looks like a person from too few sides, all of it."""

    def step_back(self, doubtful: Sequence[Sighting]) -> None:
        """What is too near to be told from a pet, all of it."""

    def harmless(self) -> Sequence[Sighting]:
        """What moves in the room and is no person."""

    def next(self, inputs: Inputs) -> Viewpoint | None:
        """Where to look from next, None where the room is seen well enough or there is nowhere."""

    def turn_from(self, pose: Pose2D | None, view: Viewpoint) -> float:
        """How far to turn to the left at a viewpoint, now that the robot is there [rad]."""

    def share(self) -> float | None:
        """Share of the room's floor that was seen, None where nobody measures."""

    def blind(self) -> str:
        """Why what was seen is too little for a verdict, "" where it is not."""

    def is_seen(self) -> bool:
        """Whether as much of the room was seen as is wanted, however it came about."""

    def moved(self) -> str:
        """What moved in the room as far as the lidar tells, "" where nothing did."""


class OneTurn:
    """`Views` of a look that ends with its one turn."""

    def start(self, mission: Mission) -> None:
        """Nothing to remember."""

    def see(self, now: float, inputs: Inputs) -> None:
        """Nothing to see."""

    def suspect(self, doubtful: Sequence[Suspect]) -> None:
        """There is no other side."""

    def step_back(self, doubtful: Sequence[Sighting]) -> None:
        """There is no other place."""

    def harmless(self) -> Sequence[Sighting]:
        """Nobody knows."""
        return ()

    def next(self, inputs: Inputs) -> Viewpoint | None:
        """One turn is enough."""
        return None

    def turn_from(self, pose: Pose2D | None, view: Viewpoint) -> float:
        """As planned."""
        return view.turn

    def share(self) -> float | None:
        """Nobody measures."""
        return None

    def blind(self) -> str:
        """Nobody measures."""
        return ""

    def is_seen(self) -> bool:
        """Nobody measures."""
        return False

    def moved(self) -> str:
        """Nobody watches."""
        return ""


@dataclasses.dataclass(frozen=True, kw_only=True)
class LookParts:
    """What a look around is made of."""

    look: LookParams
    spin: SpinParams
    drive: DriveParams
    needs_camera: bool


class LookAround:
    """A full turn at the first viewpoint, then as much of one at each further one as `views` asks for.

    Args:
        mission: whose room; its views_done and share_seen are kept up.
        views: what was seen.
        parts: parameters.
        pose: where the robot stands now, for the record.
    """

    def __init__(self, mission: Mission, views: Views, parts: LookParts, pose: Pose2D | None) -> None:
        self._mission, self._views, self._parts = mission, views, parts
        self._drive: Drive | None = None
        self._view: Viewpoint | None = None
        self._at = pose
        self.turned_deg = 360.0 * len(mission.views_done)
        self._goes_on = bool(mission.views_done)
        self._stuck: list[str] = []  # why turns ended early
        self._look: Look = self._new_look()

    @property
    def drives(self) -> bool:
        """Whether it is on its way to a further viewpoint."""
        return self._drive is not None

    def pause(self) -> None:
        """The drive is interrupted; the next step takes it up again."""
        if self._drive is not None:
            self._drive.pause()

    def step(self, now: float, inputs: Inputs, *, candidate: bool, held: bool = False) -> LookStep:
        """Look on.

        Args:
            now: steady time [s]; the stamps of `inputs` are of it, too.
            inputs: of this step.
            candidate: something is in view that may become an intruder.
            held: another has the wheels for now.
        """
        if self._goes_on:  # after a restart: what was looked at need not be again
            self._goes_on = False
            return self._go_on(inputs, LookStep(done=True))
        if self._drive is not None:
            return LookStep(why="driving to a further viewpoint") if held else self._step_drive(now, inputs)
        step = self._look.step(now, inputs, candidate=candidate, held=held)
        if not step.done:
            return step
        self.turned_deg += self._look.turned_deg
        if step.is_stuck:  # perhaps enough is seen, or will be from elsewhere
            self._stuck.append(step.problem)
            return self._go_on(inputs, step)
        if step.problem:
            return step
        if self._at is not None:
            self._mission.views_done.append((self._at.x, self._at.y, self._at.yaw))
        return self._go_on(inputs, step)

    def _new_look(self, turn: float = math.tau, stay: float = 0.0) -> Look:
        look = dataclasses.replace(self._parts.look, linger=self._parts.look.linger + stay)
        return Look(look, self._parts.spin, needs_camera=self._parts.needs_camera, turn=turn)

    def _go_on(self, inputs: Inputs, step: LookStep) -> LookStep:
        self._view = self._views.next(inputs)
        if self._view is None:
            is_enough = not self._stuck or self._views.is_seen()
            return dataclasses.replace(step, problem="" if is_enough else self._stuck[0])
        self._at = pose = self._view.pose
        name = f"{self._mission.id}/view{len(self._mission.views_done) + len(self._stuck)}"
        once = dataclasses.replace(self._parts.drive, goal_attempts=1)
        self._drive = Drive(name, pose, once)
        return LookStep(why="going to a further viewpoint", progress=True)

    def _step_drive(self, now: float, inputs: Inputs) -> LookStep:
        assert self._drive is not None
        step = self._drive.step(now, inputs.link, inputs.pose)
        if step.problem:  # the room is not seen better than it is
            self._drive = None
            next_step = self._go_on(inputs, LookStep(done=True, why=step.problem))
            return dataclasses.replace(next_step, cancel=step.cancel)
        if step.reached:
            self._drive = None
            assert self._view is not None
            self._look = self._new_look(self._views.turn_from(inputs.pose, self._view), self._view.stay)
            return LookStep(why="at a further viewpoint")
        return LookStep(speed=None, goal=step.goal, cancel=step.cancel, why="driving to a further viewpoint")
