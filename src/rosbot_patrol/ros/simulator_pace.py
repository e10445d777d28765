"""How fast the simulated clock may run: against the wall, and against the nodes that have to keep up."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

import rospy
from tf2_msgs.msg import TFMessage

from rosbot_patrol.params import param

log = logging.getLogger(__name__)

_BEHIND = 0.25  # what the clock has lost beyond this is not caught up [s]
_REPORT = 10.0
_TF = "tf:"


@dataclass(frozen=True, kw_only=True)
class LockstepParams:
    """Nodes that the clock waits for at rate 0: each topic speaks once in so much simulated time, or is idle."""

    topics: tuple[str, ...] = param((), doc="topics of the nodes that have to keep up; tf:FRAME for who places a frame")
    slack: float = param(0.25, unit="s", lo=0.02, doc="how far the clock may run ahead of their last message")
    patience: float = param(0.4, unit="s", lo=0.0, doc="wall time after which a silent topic is taken for idle")


class Pace:
    """Holds a real-time factor; 0 runs as fast as the consumers keep up."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._wall = time.monotonic()
        self._sim = 0.0

    def restart(self, sim: float) -> None:
        """Begin anew at a simulated time."""
        self._wall, self._sim = time.monotonic(), sim

    def wait(self, sim: float) -> None:
        """Sleep until the wall has reached a simulated time."""
        if self._rate <= 0.0:
            return
        due = self._wall + (sim - self._sim) / self._rate
        ahead = due - time.monotonic()
        if ahead > 0.0:
            time.sleep(ahead)
        elif ahead < -_BEHIND:
            self.restart(sim)


class Lockstep:
    """Waits for topics that speak steadily, so that the clock does not outrun who publishes them."""

    def __init__(self, params: LockstepParams, now: Callable[[], float]) -> None:
        self._params = params
        self._now = now
        self._heard: dict[str, float] = {}
        self._said = 0.0
        for topic in params.topics:
            if topic.startswith(_TF):
                rospy.Subscriber("/tf", TFMessage, self._note_frame, callback_args=topic, tcp_nodelay=True)
            else:
                rospy.Subscriber(topic, rospy.AnyMsg, self._note, callback_args=topic, queue_size=1, tcp_nodelay=True)

    def _note(self, _: object, topic: str) -> None:
        self._heard[topic] = self._now()

    def _note_frame(self, message: TFMessage, topic: str) -> None:
        if any(t.child_frame_id.lstrip("/") == topic.removeprefix(_TF) for t in message.transforms):
            self._heard[topic] = self._now()

    def wait(self) -> None:
        """Return when every topic that is not idle has spoken within the slack; a silent one is idle from then on."""
        until = time.monotonic() + self._params.patience
        while True:
            late = [t for t, at in list(self._heard.items()) if self._now() - at > self._params.slack]
            if not late or rospy.is_shutdown():
                return
            if time.monotonic() >= until:
                for topic in late:
                    self._heard.pop(topic, None)
                self._say(late)
                return
            time.sleep(0.0005)

    def _say(self, late: list[str]) -> None:
        if time.monotonic() - self._said > _REPORT:
            self._said = time.monotonic()
            log.info("the clock waited %.1f s for %s, and goes on without", self._params.patience, ", ".join(late))
