"""A scenario in the running simulator: patrol events come from /patrol/state, the played steps are published."""

from __future__ import annotations

import logging
import queue
import time
from collections.abc import Mapping

import rospy
from std_msgs.msg import String

from rosbot_patrol.msg import PatrolState
from rosbot_patrol.rosserial.device.tcp_client import EspClient
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.player import ScenarioPlayer
from rosbot_patrol.simulation.scenario.file import PLAYED, Scenario

log = logging.getLogger(__name__)

WATCH_WAIT = 120.0  # [s] of wall time

_EVENTS = {
    PatrolState.DRIVING: "driving",
    PatrolState.LOOKING: "looking",
    PatrolState.RETURNING: "returning",
}


class ScenarioRunner:
    """Play a scenario; only the simulation's thread calls the methods.

    Args:
        scenario: the scenario to play.
        engine: engine to play it on.
        clients: the sensors' links, by id.
        is_watched: begin only when the played steps have a subscriber, so that a watcher that starts late on a busy
            machine misses nothing; earlier events of the patrol do not count.
    """

    def __init__(
        self, scenario: Scenario, engine: Engine, clients: Mapping[int, EspClient], *, is_watched: bool = False
    ) -> None:
        self._watch_until = time.monotonic() + WATCH_WAIT if is_watched else None
        self._events: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._was = ""
        self._publisher = rospy.Publisher("~scenario", String, queue_size=100, latch=True)
        self._is_played = False
        self._player = ScenarioPlayer(scenario, engine, lambda sensor: clients[sensor].trigger(), self._tell)
        rospy.Subscriber("patrol/state", PatrolState, self._note, queue_size=50)

    @property
    def waiting(self) -> tuple[str, ...]:
        """Steps that have not been played yet."""
        return self._player.waiting

    def advance(self) -> None:
        """Play the steps that are due; call before each step of the engine."""
        if self._watch_until is not None and self._waits_for_its_watch(self._watch_until):
            return
        while not self._events.empty():
            self._player.event(self._events.get())
        self._player.advance()
        if not self._is_played and not self._player.waiting:
            self._is_played = True
            self._tell(PLAYED)

    def _waits_for_its_watch(self, until: float) -> bool:
        is_late = time.monotonic() > until
        if self._publisher.get_num_connections() == 0 and not is_late:
            return True
        if is_late:
            log.warning("nobody watches the scenario after %.0f s: it is played all the same", WATCH_WAIT)
        self._watch_until = None
        return False

    def _tell(self, text: str) -> None:
        self._publisher.publish(String(text))

    def _note(self, state: PatrolState) -> None:
        if state.state == PatrolState.IDLE:
            self._events.put("on_guard")
            if self._was == PatrolState.RETURNING:
                self._events.put("home")
        elif state.state in _EVENTS:
            self._events.put(_EVENTS[state.state])
        self._was = state.state
