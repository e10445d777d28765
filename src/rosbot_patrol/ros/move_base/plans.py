"""Planning on its own thread, so that the control cycle never waits for it."""

from __future__ import annotations

import logging
import threading

from rosbot_patrol.errors import PatrolError, PlanningError, TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.navigation.interfaces import PlanResult
from rosbot_patrol.navigation.stack import NavigationStack
from rosbot_patrol.ros.runtime.node import Worker, now

log = logging.getLogger(__name__)


class PoseUnknownError(PlanningError):
    """Error: there is no start pose to plan from."""


class ThreadedPlans:
    """A PlanSource that plans on a worker thread.

    Args:
        stack: the navigation stack that makes the plans.
    """

    def __init__(self, stack: NavigationStack) -> None:
        self._stack = stack
        self._lock = threading.Lock()
        self._wake = threading.Condition(self._lock)
        self._goal: Pose2D | None = None
        self._ticket = 0
        self._result: PlanResult | None = None
        self._busy = False
        Worker(self._run, name="planner").start()

    def request(self, goal: Pose2D) -> None:
        """Start planning; the result of an earlier request is discarded."""
        with self._wake:
            self._goal, self._result, self._busy = goal, None, True
            self._ticket += 1
            self._wake.notify()

    def poll(self) -> PlanResult | None:
        """Take the result, once; None before it is there."""
        with self._lock:
            result, self._result = self._result, None
            return result

    @property
    def is_busy(self) -> bool:
        """Whether a request is in progress."""
        return self._busy

    def drop(self) -> None:
        """Discard the request in progress."""
        with self._lock:
            self._ticket += 1
            self._goal, self._result, self._busy = None, None, False

    def _run(self) -> None:
        while True:
            with self._wake:
                while self._goal is None:
                    self._wake.wait()
                goal, ticket, self._goal = self._goal, self._ticket, None
            result = self._attempt(goal)
            with self._lock:
                if ticket == self._ticket:
                    self._result, self._busy = result, False

    def _attempt(self, goal: Pose2D) -> PlanResult:
        try:
            return PlanResult(poses=self._stack.plan_from_robot(goal, now()))
        except PlanningError as err:
            return PlanResult(error=err)
        except TransformError as err:
            return PlanResult(error=PoseUnknownError(str(err)))
        except (PatrolError, ValueError, IndexError) as err:
            log.error("the global planner failed", exc_info=True)
            return PlanResult(error=PlanningError(f"the global planner failed: {err}"))
