"""Drive to a pose by an action server that may be down, die, refuse or never end."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rosbot_patrol.geometry import Pose2D, distance
from rosbot_patrol.goal import Goal, GoalLink, GoalState
from rosbot_patrol.params import param
from rosbot_patrol.patrol.house.rooms import Room
from rosbot_patrol.patrol.records.activity import Place, Whereabouts
from rosbot_patrol.patrol.records.inputs import Inputs

OtherPoses = Callable[[Inputs], Sequence[Pose2D]]
"""Further poses that serve as well as the first."""


@dataclass(frozen=True, kw_only=True)
class DriveParams:
    """Time limits and attempts of a drive to a goal."""

    goal_timeout: float = param(
        0.0, unit="s", lo=0.0, doc="time limit of a drive; 0: 60 s plus 40 s per metre of straight distance"
    )
    goal_attempts: int = param(2, lo=1, hi=20, doc="number of attempts at a goal")
    other_viewpoints: int = param(
        3, lo=0, hi=20, doc="number of other free points tried when the room's own point is unreachable, once each"
    )
    held_after: float = param(
        20.0,
        unit="s",
        lo=1.0,
        doc="time without progress after which a robot in the room, or bound for a viewpoint, looks where it stands",
    )
    retry_delay: float = param(2.0, unit="s", lo=0.0, doc="pause before the next attempt at a goal")
    server_wait: float = param(60.0, unit="s", lo=0.0, doc="longest total wait for move_base in one drive")


@dataclass(frozen=True, kw_only=True)
class DriveStep:
    """Output of one step.

    Attributes:
        goal: to send.
        cancel: give up the active goal.
        waiting: for the action server.
        reached: the pose is reached.
        problem: reason why it cannot be reached, "" while it may; is_down: because there is no action server.
    """

    goal: Goal | None = None
    cancel: bool = False
    waiting: bool = False
    reached: bool = False
    problem: str = ""
    is_down: bool = False


class Drive:
    """One drive to one pose.

    Args:
        name: unique name of the drive: the stem of its goals' tags.
        pose: in map.
        params: limits.
    """

    def __init__(self, name: str, pose: Pose2D, params: DriveParams) -> None:
        self.params = params
        self._name = name
        self._pose = pose
        self._sent = 0
        self._failed = 0
        self._tag = ""
        self._last: float | None = None
        self._waited = 0.0
        self._driven = 0.0
        self._retry_at: float | None = None
        self._timeout: float | None = params.goal_timeout or None

    def step(self, now: float, link: GoalLink, pose: Pose2D | None) -> DriveStep:
        """Check the goal's state, and decide."""
        passed = 0.0 if self._last is None else now - self._last
        self._last = now
        if not link.is_up:
            return self._wait(passed)
        if self._retry_at is not None:
            if now < self._retry_at:
                return DriveStep()
            self._retry_at = None
        if not self._tag:
            return self._send(pose)
        if link.tag == self._tag and link.state is GoalState.SUCCEEDED:
            return DriveStep(reached=True)
        if link.tag == self._tag and link.state is GoalState.FAILED:
            return self._again(now, link.text)
        self._driven += passed
        if self._timeout is not None and self._driven > self._timeout:
            return DriveStep(cancel=True, problem=f"not there after {self._timeout:.0f} s")
        return DriveStep()

    def pause(self) -> None:
        """The caller gives up the goal; the next step sends it again, and the pause does not count."""
        self._tag = ""
        self._retry_at = None
        self._last = None

    def _wait(self, passed: float) -> DriveStep:
        self._tag = ""  # a server that comes back has forgotten the goal
        self._retry_at = None
        self._waited += passed
        if self._waited > self.params.server_wait:
            return DriveStep(is_down=True, problem=f"move_base did not answer for {self.params.server_wait:.0f} s")
        return DriveStep(waiting=True)

    def _send(self, pose: Pose2D | None) -> DriveStep:
        if self._timeout is None:
            self._timeout = 60.0 + 40.0 * (distance(pose, self._pose) if pose else 20.0)
        self._sent += 1
        self._tag = f"{self._name}/{self._sent}"
        return DriveStep(goal=Goal(tag=self._tag, pose=self._pose))

    def _again(self, now: float, text: str) -> DriveStep:
        self._failed += 1
        self._tag = ""
        if self._failed >= self.params.goal_attempts:
            tried = "" if self._failed == 1 else f", tried {self._failed} times"
            return DriveStep(problem=f"move_base gave up{tried}: {(text or 'no reason given').rstrip('.')}")
        self._retry_at = now + self.params.retry_delay
        return DriveStep()


class Trip:
    """A drive to one of several equivalent poses; the next is tried when the navigation gives one up.

    Args:
        name: unique name of the trip.
        pose: the first to try, as often as `params` allow.
        params: limits.
        others: function that returns further poses after the first has failed; each is tried once.
    """

    def __init__(self, name: str, pose: Pose2D, params: DriveParams, others: OtherPoses | None = None) -> None:
        self._name, self._params, self._others = name, params, others
        self._drive = Drive(name, pose, params)
        self._left: list[Pose2D] | None = None
        self._tried = 0
        self._problem = ""

    @property
    def is_at_first(self) -> bool:
        """Whether it still drives to the first pose."""
        return self._tried == 0

    def pause(self) -> None:
        """Interrupt the drive; the next step resumes it."""
        self._drive.pause()

    def step(self, now: float, inputs: Inputs) -> DriveStep:
        """Continue the drive."""
        step = self._drive.step(now, inputs.link, inputs.pose)
        if not step.problem or step.is_down:
            return step
        self._problem = self._problem or step.problem
        if self._left is None:
            self._left = list(self._others(inputs))[: self._params.other_viewpoints] if self._others else []
        if self._left:
            self._tried += 1
            once = dataclasses.replace(self._params, goal_attempts=1)
            self._drive = Drive(f"{self._name}/{self._tried}", self._left.pop(0), once)
            return DriveStep(cancel=step.cancel)
        also = f"; {self._tried} other viewpoints in it failed, too" if self._tried else ""
        return dataclasses.replace(step, problem=self._problem + also)


class WayHome:
    """The drive to the base; it fails at once if the map shows no floor at the base's point.

    Args:
        name: unique name of the drive.
        base: room 0.
        params: limits.
    """

    def __init__(self, name: str, base: Room, params: DriveParams) -> None:
        self._base = base
        self._drive = Drive(name, base.pose, params)

    def pause(self) -> None:
        """Interrupt the drive; the next step resumes it."""
        self._drive.pause()

    def step(self, now: float, inputs: Inputs) -> DriveStep:
        """Continue the drive."""
        refusal = inputs.house.refusal(self._base) if inputs.house is not None else ""
        if refusal:
            return DriveStep(problem=f"{self._base.title}: {refusal}")
        return self._drive.step(now, inputs.link, inputs.pose)


def end_of_way_home(step: DriveStep) -> Place | None:
    """Place of the robot after the way home, None while it is driving."""
    if step.problem:
        return Place(Whereabouts.AWAY, f" ({step.problem})")
    return Place(Whereabouts.HOME) if step.reached else None
