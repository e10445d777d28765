"""Pace of the simulated clock: relative to wall time, and to the nodes that must keep up."""

from __future__ import annotations

import logging
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from urllib.parse import urlparse

import rosgraph
import rospy
from tf2_msgs.msg import TFMessage

from rosbot_patrol.errors import WorldError
from rosbot_patrol.params import param
from rosbot_patrol.ros.runtime.node import sender_of

log = logging.getLogger(__name__)

_BEHIND = 0.25  # longer lags of the clock are not caught up [s]
_CATCHING_UP = 1.5  # largest speed-up while catching up; the clock never jumps
_SET_BACK = 1.0  # a clock that goes back this far counts as restarted [s]
_REPORT = 10.0
_TF = "tf:"
_LOOK = 0.0005
_PATIENCE = 2.0  # longest wait for a node's answer [s] of wall time


@dataclass(frozen=True, kw_only=True)
class LockstepParams:
    """Nodes that the clock waits for at rate 0; a silent topic counts as idle."""

    topics: tuple[str, ...] = param(
        (), doc="topics of the nodes to wait for; tf:FRAME for the node that publishes a frame"
    )
    slack: float = param(0.25, unit="s", lo=0.02, doc="maximum lead of the clock over their last messages")
    patience: float = param(0.4, unit="s", lo=0.0, doc="wall time after which a silent topic counts as idle")


class Pace:
    """Limit to a real-time factor; 0 runs as fast as the consumers keep up.

    Args:
        rate: simulated seconds per second.
        clock: wall time [s]; sleep: waits on it.
    """

    def __init__(
        self,
        rate: float,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._rate = rate
        self._clock = clock
        self._sleep = sleep
        self.restart(0.0)

    def restart(self, sim: float) -> None:
        """Restart at a simulated time."""
        self._wall, self._sim = self._clock(), sim
        self._last_wall, self._last_sim = self._wall, sim

    def wait(self, sim: float) -> None:
        """Sleep until wall time reaches a simulated time."""
        if self._rate <= 0.0:
            return
        due = self._wall + (sim - self._sim) / self._rate
        earliest = self._last_wall + (sim - self._last_sim) / (self._rate * _CATCHING_UP)
        now = self._clock()
        if now - due > _BEHIND:
            self.restart(sim)
            return
        if max(due, earliest) > now:
            self._sleep(max(due, earliest) - now)
            now = max(due, earliest)
        self._last_wall, self._last_sim = now, sim


class SharedClock:
    """Keep the simulation at ROS time, given by another node's /clock (or the wall, without /use_sim_time).

    Args:
        now: function that returns ROS time [s], 0 before it is known.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._is_set = False
        self.ahead = 0.0  # ROS time minus simulated time [s]

    def restart(self, sim: float) -> None:
        """Restart at a simulated time."""
        now = self._now()
        self._is_set, self.ahead = now > 0.0, round(now - sim, 2)

    def is_due(self, sim: float) -> bool:
        """Whether ROS time has reached a simulated time; a clock that was set back restarts."""
        if not self._is_set or self.behind(sim) < -_SET_BACK:
            self.restart(sim)
        return self._is_set and self.behind(sim) >= 0.0

    def behind(self, sim: float) -> float:
        """Lag of a simulated time behind ROS time [s]."""
        return self._now() - (sim + self.ahead)


def refuse_second_clock() -> None:
    """Raise WorldError if another node publishes /clock: with two clocks time jumps for every node."""
    own, master = rospy.get_name(), rosgraph.Master(rospy.get_name())
    published, _, _ = master.getSystemState()
    tellers = {node for topic, nodes in published if topic == "/clock" for node in nodes}
    for node in sorted(tellers - {own}):
        if _answers(master.lookupNode(node)):
            problem = f"is published by {node} already: give this simulation clock:=false, it then keeps to that time"
            raise WorldError("/clock", problem)


def _answers(uri: str) -> bool:
    """Whether a node's port is open; the master keeps the names of killed nodes."""
    place = urlparse(uri)
    try:
        socket.create_connection((place.hostname, place.port), _PATIENCE).close()
    except OSError:
        return False
    return True


class Lockstep:
    """Wait for steadily published topics, so that the clock does not outrun their publishers.

    The clock waits for a topic from its first message on. A topic that stays silent delays the clock once, for the
    patience; then it is idle until its next message.

    Args:
        params: the topics and the limits.
        now: simulated time [s].
        clock: wall time [s]; sleep: waits on it.
    """

    def __init__(
        self,
        params: LockstepParams,
        now: Callable[[], float],
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._params = params
        self._now = now
        self._clock = clock
        self._sleep = sleep
        self._heard: dict[str, float] = {}
        self._nodes: dict[str, str] = {}
        self._idle: set[str] = set()
        self._said: dict[str, float] = {}
        self._waited: dict[str, float] = {}

    def subscribe(self) -> None:
        """Subscribe to the topics."""
        for topic in self._params.topics:
            if topic.startswith(_TF):
                rospy.Subscriber("/tf", TFMessage, self._hear_frame, callback_args=topic, tcp_nodelay=True)
            else:
                rospy.Subscriber(topic, rospy.AnyMsg, self._hear, callback_args=topic, queue_size=1, tcp_nodelay=True)

    def note(self, topic: str, node: str) -> None:
        """Record a message of a topic; callable from any thread."""
        self._nodes[topic] = node
        self._idle.discard(topic)
        self._heard[topic] = self._now()

    def wait(self) -> None:
        """Wait until every topic that is not idle has a message within the slack; a silent one becomes idle."""
        late = self._late()
        if not late:
            return
        began = at = self._clock()
        while late and not rospy.is_shutdown():
            if at - began >= self._params.patience:
                self._give_up(late)
                return
            self._sleep(_LOOK)
            before, at = at, self._clock()
            for topic in late:
                self._waited[topic] = self._waited.get(topic, 0.0) + at - before
            late = self._late()

    @property
    def idle(self) -> tuple[str, ...]:
        """Idle topics that have had a message before, each with its node."""
        return tuple(map(self._name, sorted(self._idle)))

    def take_waited(self) -> dict[str, float]:
        """Wall time that the clock waited for each topic since the last call [s], by topic and node."""
        waited, self._waited = self._waited, {}
        return {self._name(topic): seconds for topic, seconds in waited.items()}

    def _hear(self, message: rospy.AnyMsg, topic: str) -> None:
        self.note(topic, sender_of(message) or "an unknown node")

    def _hear_frame(self, message: TFMessage, topic: str) -> None:
        if any(t.child_frame_id.lstrip("/") == topic.removeprefix(_TF) for t in message.transforms):
            self.note(topic, sender_of(message) or "an unknown node")

    def _late(self) -> list[str]:
        now = self._now()
        return [t for t, at in list(self._heard.items()) if now - at > self._params.slack]

    def _name(self, topic: str) -> str:
        return f"{topic} of {self._nodes[topic]}"

    def _give_up(self, late: list[str]) -> None:
        wall = self._clock()
        for topic in late:
            self._heard.pop(topic, None)
            self._idle.add(topic)
            if wall - self._said.get(topic, -_REPORT) >= _REPORT:
                self._said[topic] = wall
                text = "the clock waited %.1f s for %s, and goes on without"
                log.info(text, self._params.patience, self._name(topic))
