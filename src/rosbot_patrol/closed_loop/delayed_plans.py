"""Plans made at once that come later, as if another thread had made them: what stands in for move_base's planner."""

from __future__ import annotations

from collections.abc import Callable

from rosbot_patrol.errors import PlanningError, TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.navigation.interfaces import PlanResult
from rosbot_patrol.planning.interfaces import Array


class DelayedPlans:
    """A PlanSource on a clock of the caller's.

    Args:
        plan: poses from where the robot is to a goal (shape (n, 3), x, y [m], yaw [rad]); may raise PlanningError or
            TransformError, which become the request's result.
        clock: time now [s].
        delay: from a request to its result [s].
    """

    def __init__(self, plan: Callable[[Pose2D], Array], clock: Callable[[], float], delay: float) -> None:
        self._plan, self._clock, self._delay = plan, clock, delay
        self._result: tuple[float, PlanResult] | None = None

    def request(self, goal: Pose2D) -> None:
        """Ask for a plan; what was asked for before is dropped."""
        try:
            result = PlanResult(poses=self._plan(goal))
        except PlanningError as err:
            result = PlanResult(error=err)
        except TransformError as err:
            result = PlanResult(error=PlanningError(str(err)))
        self._result = self._clock() + self._delay, result

    def poll(self) -> PlanResult | None:
        """The result, once, when its time has come."""
        if self._result is None or self._clock() < self._result[0]:
            return None
        (_, result), self._result = self._result, None
        return result

    @property
    def is_busy(self) -> bool:
        """Whether a result is to come."""
        return self._result is not None

    def drop(self) -> None:
        """Forget what was asked for."""
        self._result = None
