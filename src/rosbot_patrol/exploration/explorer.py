"""Exploration: drives the robot to the frontiers of its map until there are none, and then home."""

from __future__ import annotations

import itertools
import logging
import math
from dataclasses import dataclass

from rosbot_patrol.counts import count_of
from rosbot_patrol.exploration.frontiers import Borders, Frontier, FrontierParams
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.goal import Goal, GoalLink, GoalState, Progress
from rosbot_patrol.grid import Grid
from rosbot_patrol.params import param

log = logging.getLogger(__name__)

_SAME = 0.6  # frontiers closer than this are one [m]
_CLOSE = 0.4  # distance from a goal that is near enough to look, if the robot comes no nearer [m]
_STEP = 0.05  # between two places of the robot's track [m]
_TRIES = 3  # goals that may fail before their frontier is left out


@dataclass(frozen=True, kw_only=True)
class ExplorerParams:
    """When to go on to another frontier."""

    frontiers: FrontierParams = FrontierParams()
    progress_timeout: float = param(30.0, unit="s", lo=1.0, doc="time without progress after which a goal is given up")
    look_again: float = param(2.0, unit="s", lo=0.1, doc="time between evaluations of the map while driving")
    map_patience: float = param(15.0, unit="s", lo=0.5, doc="longest wait for the map that includes the latest scans")


@dataclass(frozen=True, kw_only=True)
class Step:
    """Output of one step.

    Attributes:
        goal: next goal, None: unchanged.
        is_done: exploration is over.
        is_waiting: an input is missing.
        text: its reason.
        frontiers: of the latest evaluation of the map, None without one.
    """

    goal: Goal | None = None
    is_done: bool = False
    is_waiting: bool = False
    text: str = ""
    frontiers: tuple[Frontier, ...] | None = None


class Explorer:
    """Runs one exploration.

    Args:
        params: time limits.

    Attributes:
        left_out: frontiers that were unreachable, or remained after the robot's visit, in map [m].
        area: floor in the latest map [m2].
    """

    def __init__(self, params: ExplorerParams | None = None) -> None:
        self.params = params or ExplorerParams()
        self.left_out: list[tuple[float, float]] = []
        self.area = 0.0
        self._home: Pose2D | None = None
        self._target: Frontier | None = None
        self._goal: Goal | None = None
        self._tags = itertools.count(1)
        self._progress, self._looked = Progress(), -math.inf
        self._arrived: tuple[float, int] | None = None  # time, and the number of the map then
        self._refused: list[tuple[float, float]] = []  # goals that failed
        self._failures: list[tuple[float, float]] = []  # the frontiers of these
        self._passed: list[tuple[float, float]] = []  # the robot's track
        self._goes_home = self._is_over = False

    def step(self, now: float, grid: Grid | None, maps: int, pose: Pose2D | None, link: GoalLink) -> Step:
        """Decide what to do now.

        Args:
            now: [s].
            grid: the newest map.
            maps: number of maps so far.
            pose: of the robot in map.
            link: state of move_base.
        """
        if self._is_over:
            return Step(is_done=True, text="explored")
        if grid is None or pose is None or not link.is_up:
            missing = [("a map", grid is None), ("the robot's pose", pose is None), ("move_base", not link.is_up)]
            names = " and ".join(name for name, is_missing in missing if is_missing)
            return Step(is_waiting=True, text=f"waiting for {names}")
        self._home = self._home or pose
        self._pass(pose)
        state = link.state if self._goal is not None and link.tag == self._goal.tag else GoalState.ACTIVE
        if self._goal is None:
            return self._next(now, grid, pose)
        if self._goes_home:
            return self._home_step(now, pose, state)
        assert self._target is not None
        if state is GoalState.SUCCEEDED or self._arrived is not None:
            return self._look(now, grid, maps, pose)
        if state is GoalState.FAILED or self._stalls(now, pose):
            if math.dist(pose[:2], self._goal.pose[:2]) < _CLOSE:
                return self._look(now, grid, maps, pose)
            stalled = f"no progress for {self.params.progress_timeout:.0f} s"
            return self._fail(
                now, grid, pose, link.text or "move_base gave up" if state is GoalState.FAILED else stalled
            )
        if now - self._looked < self.params.look_again:
            return Step(text=self._about)
        self._looked = now
        found = self._borders(grid, pose).frontiers()
        if not any(_is_at(f, self._target) for f in found):  # it was explored on the way
            return self._next(now, grid, pose)
        return Step(text=self._about, frontiers=tuple(found))

    def _pass(self, pose: Pose2D) -> None:
        """Lengthen the robot's track."""
        x, y = self._passed[-1] if self._passed else pose[:2]
        count = math.floor(math.hypot(pose.x - x, pose.y - y) / _STEP)
        shares = [k / count for k in range(1, count + 1)]
        self._passed += [(x + share * (pose.x - x), y + share * (pose.y - y)) for share in shares]
        self._passed = self._passed or [(x, y)]

    @property
    def _about(self) -> str:
        t = self._target
        return "" if t is None else f"driving to a border of {t.length:.1f} m at ({t.x:.1f}, {t.y:.1f})"

    def _look(self, now: float, grid: Grid, maps: int, pose: Pose2D) -> Step:
        """Wait at a frontier: the next map but one includes the scans from there."""
        if self._arrived is None:
            self._arrived = now, maps
        if maps < self._arrived[1] + 2 and now - self._arrived[0] < self.params.map_patience:
            return Step(is_waiting=True, text="waiting for the map")
        assert self._target is not None
        if any(_is_at(f, self._target) for f in self._borders(grid, pose).frontiers()):
            log.info("the border at (%.1f, %.1f) stays unknown from nearby", self._target.x, self._target.y)
            return self._leave_out(now, grid, pose)
        return self._next(now, grid, pose)

    def _fail(self, now: float, grid: Grid, pose: Pose2D, reason: str) -> Step:
        """Look for another goal at the frontier; after some, leave it out."""
        assert self._target is not None
        assert self._goal is not None
        self._refused.append(self._goal.pose[:2])
        self._failures.append((self._target.x, self._target.y))
        log.warning("no way to the border at (%.1f, %.1f): %s", self._target.x, self._target.y, reason)
        tried = sum(math.dist(place, self._failures[-1]) < _SAME for place in self._failures)
        if tried < _TRIES and any(_is_at(f, self._target) for f in self._borders(grid, pose).frontiers()):
            return self._next(now, grid, pose)
        return self._leave_out(now, grid, pose)

    def _borders(self, grid: Grid, pose: Pose2D) -> Borders:
        return Borders(grid, pose, self.params.frontiers, self._refused, self._passed)

    def _leave_out(self, now: float, grid: Grid, pose: Pose2D) -> Step:
        assert self._target is not None
        self.left_out.append((self._target.x, self._target.y))
        return self._next(now, grid, pose)

    def _next(self, now: float, grid: Grid, pose: Pose2D) -> Step:
        borders = self._borders(grid, pose)
        self.area, found = borders.area, borders.frontiers()
        open_ = [f for f in found if not any(math.dist((f.x, f.y), place) < _SAME for place in self.left_out)]
        self._looked = now
        if not open_:
            return self._drive_home(now, tuple(found))
        self._target = open_[0]
        self._send(now, self._target.goal)
        log.info("%.0f m2 of floor known, %s; %s", self.area, count_of(len(open_), "border"), self._about)
        return Step(goal=self._goal, text=self._about, frontiers=tuple(found))

    def _drive_home(self, now: float, found: tuple[Frontier, ...]) -> Step:
        assert self._home is not None
        left = count_of(len(self.left_out), "border was", "borders were")
        log.info("no border is left: %.0f m2 of floor known, %s left out", self.area, left)
        self._goes_home, self._target = True, None
        self._send(now, self._home)
        return Step(goal=self._goal, text="explored, driving home", frontiers=found)

    def _home_step(self, now: float, pose: Pose2D, state: GoalState) -> Step:
        if state is GoalState.FAILED or self._stalls(now, pose):
            log.warning("the way home failed: the robot stands at (%.1f, %.1f)", pose.x, pose.y)
        elif state is not GoalState.SUCCEEDED:
            return Step(text="explored, driving home")
        self._is_over = True
        return Step(is_done=True, text="explored")

    def _send(self, now: float, pose: Pose2D) -> None:
        self._goal = Goal(tag=f"explore-{next(self._tags)}", pose=pose)
        self._progress, self._arrived = Progress(), None

    def _stalls(self, now: float, pose: Pose2D) -> bool:
        assert self._goal is not None
        gap = math.dist(pose[:2], self._goal.pose[:2])
        return self._progress.stalled(now, gap) > self.params.progress_timeout


def _is_at(frontier: Frontier, other: Frontier) -> bool:
    return math.dist((frontier.x, frontier.y), (other.x, other.y)) < max(_SAME, 0.5 * other.length)
