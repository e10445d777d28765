"""Watch over a scenario from outside: its steps as text, and at the end whether its expectation holds."""

from __future__ import annotations

from collections.abc import Callable

import rospy
from std_msgs.msg import String

from rosbot_patrol.patrol.story.mission_story import Narrator
from rosbot_patrol.ros.runtime.node import now
from rosbot_patrol.simulation.scenario.file import PLAYED, Expect, Outcome, disappointments, read_scenario


class ScenarioWatch:
    """Decide when a scenario is over, and which expectations failed.

    Args:
        file: file of the scenario.
        simulator: name of the node that plays it.
        tell: receives each played step as a sentence.
    """

    def __init__(self, file: str, simulator: str, tell: Callable[[str], None]) -> None:
        self.scenario = read_scenario(file)
        self._expect = self.scenario.expect or Expect()
        self._tell = tell
        self._is_played = False
        self._on_guard_at: float | None = None
        self._topic = f"{simulator}/scenario"

    def start(self) -> None:
        """Subscribe to the played steps; this starts the scenario."""
        rospy.Subscriber(self._topic, String, self._on_act, queue_size=100)

    def is_over(self, narrator: Narrator) -> bool:
        """Whether no more steps will come, or the time is up."""
        if narrator.on_guard_at is None:
            return False
        if self._on_guard_at is None:
            self._on_guard_at = now()
        if self._is_late:
            return True
        least = self._expect.least_missions
        visited = {m.room_id for m in narrator.missions if m.verdict}
        return (
            self._is_played
            and 0 < least <= narrator.ended == len(narrator.missions)
            and visited >= set(self._expect.verdicts)
        )

    def failures(self, narrator: Narrator) -> list[str]:
        """One sentence per failed expectation."""
        outcome = Outcome(
            verdicts={m.room_id: m.verdict for m in narrator.missions if m.verdict},
            missions=narrator.ended,
            mails=sum(len(m.mails) for m in narrator.missions),
            is_home=narrator.is_home and narrator.ended == len(narrator.missions),
        )
        found = disappointments(self._expect, outcome)
        if not self._is_played:
            found.append("Not everything in the scenario has happened: an event that it waits for did not come.")
        if narrator.ended < self._expect.least_missions and self._expect.missions is None:
            found.append(f"Its time of {self._expect.within:.0f} simulated seconds has passed.")
        return found

    @property
    def _is_late(self) -> bool:
        return self._on_guard_at is not None and now() - self._on_guard_at > self._expect.within

    def _on_act(self, message: String) -> None:
        if message.data == PLAYED:
            self._is_played = True
        self._tell(f"{message.data[:1].upper()}{message.data[1:].rstrip('.')}.")
