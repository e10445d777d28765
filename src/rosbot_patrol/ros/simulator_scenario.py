"""A scenario in the running simulator: what happens to the patrol comes from /patrol/state, what is played goes out."""

from __future__ import annotations

import queue
from collections.abc import Mapping

import rospy
from std_msgs.msg import String

from rosbot_patrol.msg import PatrolState
from rosbot_patrol.rosserial.tcp_client import EspClient
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.scenario import Scenario
from rosbot_patrol.simulation.scenario_player import ScenarioPlayer

PLAYED = "Everything in the scenario has happened."

_EVENTS = {
    PatrolState.DRIVING: "driving",
    PatrolState.LOOKING: "looking",
    PatrolState.RETURNING: "returning",
}


class ScenarioRunner:
    """Plays a scenario; every method is called by the simulation's thread.

    Args:
        scenario: what is to happen.
        engine: where.
        clients: the sensors' links, by id.
    """

    def __init__(self, scenario: Scenario, engine: Engine, clients: Mapping[int, EspClient]) -> None:
        self._events: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._was = ""
        self._told = rospy.Publisher("~scenario", String, queue_size=100, latch=True)
        self._is_played = False
        self._player = ScenarioPlayer(scenario, engine, lambda sensor: clients[sensor].trigger(), self._tell)
        rospy.Subscriber("/patrol/state", PatrolState, self._note, queue_size=50)

    @property
    def waiting(self) -> tuple[str, ...]:
        """What has not happened yet."""
        return self._player.waiting

    def advance(self) -> None:
        """Do what is due; before each step of the engine."""
        while not self._events.empty():
            self._player.event(self._events.get())
        self._player.advance()
        if not self._is_played and not self._player.waiting:
            self._is_played = True
            self._tell(PLAYED)

    def _tell(self, text: str) -> None:
        self._told.publish(String(text))

    def _note(self, state: PatrolState) -> None:
        if state.state == PatrolState.IDLE:
            self._events.put("on_guard")
            if self._was == PatrolState.RETURNING:
                self._events.put("home")
        elif state.state in _EVENTS:
            self._events.put(_EVENTS[state.state])
        self._was = state.state
