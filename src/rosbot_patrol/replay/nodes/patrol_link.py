"""move_base's recorded answers to the patrol, matched to the goals by their number."""

from __future__ import annotations

import math

from rosbot_patrol.goal import SILENCE, Goal, GoalLink, GoalState, ending_text, goal_state
from rosbot_patrol.replay.nodes.patrol_records import GoalRecord, OutcomeRecord


class BagLink:
    """Answers to goals: the replay's n-th goal is matched to the bag's n-th, and ends when that one ended."""

    def __init__(self) -> None:
        self._heard = -math.inf
        self._goals: list[str] = []  # of the bag
        self._outcomes: dict[str, OutcomeRecord] = {}
        self._tag, self._sent = "", 0

    def hear_status(self, now: float) -> None:
        """Record that the server is alive."""
        self._heard = now

    def hear_goal(self, record: GoalRecord) -> None:
        """Record a goal of the bag."""
        if record.goal not in self._goals:
            self._goals.append(record.goal)

    def hear_outcome(self, record: OutcomeRecord) -> None:
        """Record the result of a goal of the bag."""
        self._outcomes[record.goal] = record

    def send(self, goal: Goal) -> None:
        """Send a goal of the replay."""
        self._tag, self._sent = goal.tag, self._sent + 1

    def state(self, now: float) -> GoalLink:
        """State of server and goal at a time [s]."""
        is_up = now - self._heard < SILENCE
        if not self._tag:
            return GoalLink(is_up=is_up)
        outcome = self._outcomes.get(self._goals[self._sent - 1]) if self._sent <= len(self._goals) else None
        if outcome is None:
            return GoalLink(is_up=is_up, tag=self._tag, state=GoalState.ACTIVE)
        text = outcome.text or ending_text(outcome.status)
        return GoalLink(is_up=is_up, tag=self._tag, state=goal_state(outcome.status), text=text)
