"""Plans computed at once but delivered later, in place of move_base's planning thread."""

from __future__ import annotations

from collections.abc import Callable

from rosbot_patrol.errors import PlanningError, TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.navigation.interfaces import PlanResult
from rosbot_patrol.planning.interfaces import Array


class DelayedPlans:
    """A PlanSource on the caller's clock.

    Args:
        plan: poses from where the robot is to a goal (shape (n, 3), x, y [m], yaw [rad]); may raise PlanningError or
            TransformError, which become the request's result.
        clock: time now [s].
        delay: time from a request to its result [s].
    """

    def __init__(self, plan: Callable[[Pose2D], Array], clock: Callable[[], float], delay: float) -> None:
        self._plan, self._clock, self._delay = plan, clock, delay
        self._result: tuple[float, PlanResult] | None = None

    def request(self, goal: Pose2D) -> None:
        """Request a plan; an earlier request is dropped."""
        try:
            result = PlanResult(poses=self._plan(goal))
        except PlanningError as err:
            result = PlanResult(error=err)
        except TransformError as err:
            result = PlanResult(error=PlanningError(str(err)))
        self._result = self._clock() + self._delay, result

    def poll(self) -> PlanResult | None:
        """Take the result, once, when its time has come."""
        if self._result is None or self._clock() < self._result[0]:
            return None
        (_, result), self._result = self._result, None
        return result

    @property
    def is_busy(self) -> bool:
        """Whether a result is pending."""
        return self._result is not None

    def drop(self) -> None:
        """Drop the request."""
        self._result = None
