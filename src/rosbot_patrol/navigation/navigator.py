"""move_base's state machine (matches move_base 1.17), without clocks, threads or ROS.

PLANNING waits for a plan, CONTROLLING drives along it, CLEARING runs the recovery behaviours. A goal ends in one of
upstream's result texts. Planning itself runs behind `PlanSource` and may take its time in another thread.

Differs:
    - A recovery behaviour can be cancelled at the next step, like everything else.
    - A robot with an unknown pose stands still and waits; only `step` with a pose counts against patience.
    - A new goal that replaces the present one sends no velocity until its plan comes, as upstream. If that takes longer
      than 0.35 s, the robot is stopped.
    - A plan that was requested before a goal was cancelled or replaced is dropped.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from rosbot_patrol.errors import ControlError, OutOfBounds
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D
from rosbot_patrol.navigation.interfaces import (
    OFF_MAP,
    PLAN_REFUSED,
    REACHED,
    Array,
    Command,
    NavigatorView,
    Outcome,
    PlanResult,
    PlanSource,
    Reason,
    State,
    Trigger,
)
from rosbot_patrol.navigation.params import MoveBaseParams
from rosbot_patrol.planning.interfaces import LocalPlanner, Recovery

log = logging.getLogger(__name__)

_COAST = 0.35  # time for which the last velocity may hold while a new goal is planned [s]


@dataclass
class _Progress:
    """Times and counts of the current goal."""

    last_plan: float
    last_control: float
    last_motion: float
    last_request: float = -math.inf
    coast_until: float = -math.inf
    motion_from: Pose2D | None = None
    retries: int = 0
    recovery_index: int = 0
    trigger: Trigger = Trigger.PLANNING
    running: Recovery | None = None
    held_back: Twist2D | None = None  # velocity that a recovery wanted when somebody came
    control_failed: bool = False

    def wait(self, now: float) -> None:
        """Restart all time limits: waiting for somebody uses up no patience."""
        self.last_plan = self.last_control = self.last_motion = now


@dataclass
class _Context:
    goal: Pose2D
    progress: _Progress
    failures: list[str] = field(default_factory=list)


class Navigator:
    """Brings the robot to one goal at a time.

    Args:
        params: move_base's.
        plans: where plans come from.
        controller: local planner.
        recoveries: tried in turn.

    Attributes:
        state: what it does.
        text: why it does that, in a sentence.
    """

    def __init__(
        self,
        params: MoveBaseParams,
        *,
        plans: PlanSource,
        controller: LocalPlanner,
        recoveries: Sequence[Recovery],
    ) -> None:
        self.params = params
        self.state = State.IDLE
        self._plans = plans
        self._controller = controller
        self._recoveries = list(recoveries)
        self._context: _Context | None = None
        self.text = Reason.NO_GOAL.value

    @property
    def goal(self) -> Pose2D | None:
        """Current goal in the global costmap's frame."""
        return self._context.goal if self._context else None

    @property
    def plan_failure(self) -> str:
        """Reason why the last plan for this goal failed, "" if it did not; already logged."""
        return self._context.failures[-1] if self._context and self._context.failures else ""

    def configure(self, params: MoveBaseParams, recoveries: Sequence[Recovery]) -> None:
        """Use other parameters from the next step on; a running behaviour ends first."""
        self.params = params
        self._recoveries = list(recoveries)

    def set_goal(self, goal: Pose2D, now: float) -> None:
        """Start for a goal; the previous goal is given up without stopping."""
        self._plans.drop()
        self._controller.reset()
        coast_until = now + _COAST if self.state is State.CONTROLLING else -math.inf
        progress = _Progress(last_plan=now, last_control=now, last_motion=now, coast_until=coast_until)
        self._context = _Context(goal, progress)
        self._begin_planning(now)

    def cancel(self) -> Command:
        """Give up the goal; the robot stops."""
        self._end()
        return Command(twist=STOP, reason=Reason.CANCELLED)

    def _end(self) -> None:
        self._plans.drop()
        self._context = None
        self.state, self.text = State.IDLE, Reason.NO_GOAL.value

    def _begin_planning(self, now: float) -> None:
        assert self._context is not None
        self.state = State.PLANNING
        self._request(now)

    def _request(self, now: float) -> None:
        assert self._context is not None
        if not self._plans.is_busy:
            self._context.progress.last_request = now
            self._plans.request(self._context.goal)

    def step(self, now: float, view: NavigatorView | None) -> Command:
        """One control cycle; `view` is None if the robot's pose is unknown."""
        context = self._context
        if context is None:
            return Command(reason=Reason.NO_GOAL, detail=self.text)
        if view is None:
            context.progress.wait(now)
            self.text = Reason.POSE_UNKNOWN.value
            return Command(twist=STOP, reason=Reason.POSE_UNKNOWN)
        self._watch_motion(now, view.local.pose, context)
        result = self._plans.poll()
        taken = self._take_plan(now, result, context) if result is not None else None
        if isinstance(taken, Command):
            return taken
        step = {
            State.PLANNING: self._planning,
            State.CONTROLLING: self._controlling,
            State.CLEARING: self._clearing,
        }[self.state]
        command = step(now, view, context)
        self.text = command.text
        return command if taken is None else replace(command, plan=taken)

    def _watch_motion(self, now: float, pose: Pose2D, context: _Context) -> None:
        progress = context.progress
        start = progress.motion_from
        if start is None or math.hypot(pose.x - start.x, pose.y - start.y) >= self.params.oscillation_distance:
            progress.motion_from, progress.last_motion = pose, now
            if progress.trigger is Trigger.OSCILLATION:
                progress.recovery_index = 0

    def _take_plan(self, now: float, result: PlanResult, context: _Context) -> Array | Command | None:
        progress = context.progress
        if result.poses is None:
            progress.retries += 1
            self.text = problem = str(result.error)
            if self.state is State.PLANNING and (not context.failures or context.failures[-1] != problem):
                log.warning("no plan: %s", problem)
                if isinstance(result.error, OutOfBounds) and result.error.what == "goal":
                    is_navfn = "navfn" in self.params.base_global_planner.lower()
                    log.warning(OFF_MAP.format("navfn" if is_navfn else "global"))
                context.failures.append(problem)
            return None
        progress.last_plan, progress.retries = now, 0
        context.failures.clear()
        try:
            self._controller.set_plan(result.poses)
        except ControlError as err:
            log.error("%s %s", PLAN_REFUSED, err)
            return self._finish(PLAN_REFUSED, succeeded=False)
        if self.state is State.PLANNING:
            self.state = State.CONTROLLING
            if not progress.control_failed:
                progress.last_control = now
        if progress.trigger is Trigger.PLANNING:
            progress.recovery_index = 0
        return result.poses

    # ---- states

    def _planning(self, now: float, view: NavigatorView, context: _Context) -> Command:
        progress, p = context.progress, self.params
        too_often = 0 <= p.max_planning_retries < progress.retries
        if now > progress.last_plan + p.planner_patience or too_often:
            if not self._plans.is_busy:
                return self._recover(Trigger.PLANNING, context)
            if now <= progress.last_plan + 4.0 * p.planner_patience + 10.0:
                return Command(twist=STOP, reason=Reason.PLANNING_LONG)
            return self._recover(Trigger.PLANNING, context)
        if now - progress.last_request >= (1.0 / p.planner_frequency if p.planner_frequency > 0.0 else 0.2):
            self._request(now)
        coasting = now < progress.coast_until and view.is_current and not context.failures
        failure = context.failures[-1] if context.failures else ""
        reason = Reason.NO_PLAN if failure else Reason.PLANNING
        return Command(twist=None if coasting else STOP, reason=reason, detail=failure)

    def _controlling(self, now: float, view: NavigatorView, context: _Context) -> Command:
        progress, p = context.progress, self.params
        if self._controller.is_goal_reached(view.local):
            return self._finish(REACHED, succeeded=True)
        if p.oscillation_timeout > 0.0 and now > progress.last_motion + p.oscillation_timeout:
            return self._recover(Trigger.OSCILLATION, context)
        if not view.is_current:
            progress.wait(now)
            return Command(twist=STOP, reason=Reason.SENSORS_OLD)
        if p.planner_frequency > 0.0 and now - progress.last_request >= 1.0 / p.planner_frequency:
            self._request(now)
        try:
            twist = self._controller.compute(view.local)
        except ControlError as err:
            if now > progress.last_control + p.controller_patience:
                return self._recover(Trigger.CONTROLLING, context)
            progress.control_failed = True
            progress.last_plan, progress.retries = now, 0
            self._begin_planning(now)
            return Command(twist=STOP, reason=Reason.NO_CONTROL, detail=str(err))
        progress.last_control, progress.control_failed = now, False
        if progress.trigger is Trigger.CONTROLLING:
            progress.recovery_index = 0
        someone = view.must_wait(twist)
        if someone:
            progress.last_motion = now  # to wait for somebody is no oscillation
            return Command(twist=STOP, reason=Reason.WAITING, detail=f"waiting: {someone}")
        return Command(twist=twist, reason=Reason.DRIVING)

    def _recover(self, trigger: Trigger, context: _Context) -> Command:
        context.progress.trigger = trigger
        context.progress.running = context.progress.held_back = None
        self.state = State.CLEARING
        return Command(twist=STOP, reason=Reason.RECOVERING, detail=f"recovering ({trigger.name.lower()})")

    def _clearing(self, now: float, view: NavigatorView, context: _Context) -> Command:
        progress = context.progress
        count = len(self._recoveries) if self.params.recovery_behavior_enabled else 0
        if progress.running is None:
            if progress.recovery_index >= count:
                log.error("%s %s", progress.trigger.value, "; ".join(context.failures[-1:]))
                return self._finish(progress.trigger.value, succeeded=False)
            progress.running = self._recoveries[progress.recovery_index]
            log.info("recovery %d of %d: %s", progress.recovery_index + 1, count, progress.running.name)
            progress.running.start(view.recovery)
            return Command(
                twist=STOP,
                recovery=(progress.recovery_index, count, progress.running.name),
                reason=Reason.RECOVERY,
                detail=f"recovery {progress.running.name}",
            )
        if not view.is_current:
            progress.wait(now)
            return Command(twist=STOP, reason=Reason.SENSORS_OLD)
        twist = progress.held_back or progress.running.step(view.recovery)
        if twist is not None and (someone := view.must_wait(twist)):
            progress.held_back = twist
            return Command(twist=STOP, reason=Reason.WAITING, detail=f"waiting: {someone}")
        progress.held_back = None
        if twist is not None:
            return Command(twist=twist, reason=Reason.RECOVERY, detail=f"recovery {progress.running.name}")
        log.info("recovery %s: %s", progress.running.name, progress.running.last_words)
        progress.running = None
        progress.recovery_index += 1
        progress.last_plan = progress.last_motion = progress.last_control = now
        progress.retries = 0
        self._begin_planning(now)
        return Command(twist=STOP, reason=Reason.RECOVERED)

    def _finish(self, text: str, *, succeeded: bool) -> Command:
        self._end()
        return Command(twist=STOP, outcome=Outcome(succeeded=succeeded, text=text), reason=Reason.ENDED, detail=text)
