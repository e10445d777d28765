"""The look at a room: a full turn at the first viewpoint, then further viewpoints as `Views` asks for them."""

from __future__ import annotations

import dataclasses
import logging
import math

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.goal import Standstill
from rosbot_patrol.patrol.mission.drive import Drive, DriveParams
from rosbot_patrol.patrol.mission.views import Views
from rosbot_patrol.patrol.records.activity import Activity
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Mission
from rosbot_patrol.patrol.search.look import Look, LookParams, LookStep
from rosbot_patrol.patrol.search.turn import SpinParams
from rosbot_patrol.patrol.visibility.viewpoints import Viewpoint

log = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class LookParts:
    """What a look around is made of."""

    look: LookParams
    spin: SpinParams
    drive: DriveParams
    needs_camera: bool


@dataclasses.dataclass(frozen=True)
class _Approach:
    """The way to a further viewpoint."""

    view: Viewpoint
    drive: Drive
    standstill: Standstill = dataclasses.field(default_factory=Standstill)


class LookAround:
    """A full turn at the first viewpoint, then as much of one at each further one as `views` asks for.

    Args:
        mission: whose room; its `views_done` is kept up.
        views: what was seen.
        parts: parameters.
        pose: where the robot stands now, for the record.

    Attributes:
        turned_deg: sum of all turns [deg].
    """

    def __init__(self, mission: Mission, views: Views, parts: LookParts, pose: Pose2D | None) -> None:
        self._mission, self._views, self._parts = mission, views, parts
        self._at = pose
        self.turned_deg = 360.0 * len(mission.views_done)
        self._is_resumed = bool(mission.views_done)
        self._stuck: list[str] = []  # why turns ended early
        self._doing: Look | _Approach = self._new_look()

    @property
    def is_driving(self) -> bool:
        """Whether it is on its way to a further viewpoint."""
        return isinstance(self._doing, _Approach)

    def pause(self) -> None:
        """Interrupt the drive; the next step takes it up again."""
        if isinstance(self._doing, _Approach):
            self._doing.drive.pause()
            self._doing = dataclasses.replace(self._doing, standstill=Standstill())

    def step(self, now: float, inputs: Inputs, *, candidate: bool, held: bool = False) -> LookStep:
        """Look on.

        Args:
            now: steady time [s]; the stamps of `inputs` are in the same time.
            inputs: of this step.
            candidate: something that may become an intruder is in view.
            held: another part has the wheels for now.
        """
        if self._is_resumed:  # viewpoints done before a restart are not repeated
            self._is_resumed = False
            return self._go_on(inputs, LookStep(done=True))
        if isinstance(self._doing, _Approach):
            return self._step_approach(self._doing, now, inputs)
        step = self._doing.step(now, inputs, candidate=candidate, held=held)
        if not step.done:
            return step
        self.turned_deg += self._doing.turned_deg
        if step.is_stuck:  # enough may be seen already, or from another viewpoint
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
        view = self._views.next(inputs)
        if view is None:
            is_enough = not self._stuck or self._views.is_seen()
            return dataclasses.replace(step, problem="" if is_enough else self._stuck[0])
        self._at = view.pose
        name = f"{self._mission.id}/view{len(self._mission.views_done) + len(self._stuck)}"
        once = dataclasses.replace(self._parts.drive, goal_attempts=1)
        self._doing = _Approach(view, Drive(name, view.pose, once))
        return LookStep(why="going to a further viewpoint", progress=True)

    def _step_approach(self, approach: _Approach, now: float, inputs: Inputs) -> LookStep:
        step = approach.drive.step(now, inputs.link, inputs.pose)
        if step.problem:  # the room is not seen better than it is
            next_step = self._go_on(inputs, LookStep(done=True, why=step.problem))
            return dataclasses.replace(next_step, cancel=step.cancel)
        is_held = not step.waiting and self._is_held(approach, now, inputs.pose)
        if is_held:
            log.info("%s: held up on the way to a viewpoint, it looks from where it stands", self._mission.room.title)
        if step.reached or is_held:
            turn = self._views.turn_from(inputs.pose, approach.view)
            self._doing = self._new_look(turn, approach.view.stay)
            return LookStep(cancel=is_held, why="at a further viewpoint")
        return LookStep(speed=None, goal=step.goal, cancel=step.cancel, why=Activity.TO_VIEWPOINT.value)

    def _is_held(self, approach: _Approach, now: float, pose: Pose2D | None) -> bool:
        return pose is not None and approach.standstill.lasts(now, pose) > self._parts.drive.held_after
