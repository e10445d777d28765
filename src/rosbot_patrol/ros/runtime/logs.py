"""Log handler that brings the pure modules' records (`getLogger("rosbot_patrol...")`) to the console and /rosout."""

from __future__ import annotations

import logging
import math

import rospy
from rospy.impl.paramserver import get_param_server_cache

from rosbot_patrol.counts import count_of

_OMIT_TOPICS = "/rosout_disable_topics_generation"


class _ToRosout(logging.Handler):
    def __init__(self) -> None:
        super().__init__()
        self._rosout = logging.getLogger("rosout")

    def emit(self, record: logging.LogRecord) -> None:
        self._rosout.handle(record)


class LineThrottle:
    """Rate limit per kind of log line, which counts the suppressed lines.

    Args:
        period: shortest time between two lines of a kind [s].
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._said: dict[str, float] = {}
        self._held_back: dict[str, int] = {}

    def due(self, kind: str, now: float) -> str | None:
        """Text to append to a line of that kind: number suppressed since the last; None: suppress this one too."""
        if 0.0 <= now - self._said.get(kind, -math.inf) < self._period:
            self._held_back[kind] = self._held_back.get(kind, 0) + 1
            return None
        self._said[kind] = now
        more = self._held_back.pop(kind, 0)
        return f" (and {count_of(more, 'time')} before)" if more else ""


def install() -> None:
    """Pass every record of this package to the logger `rosout`; call once, after `init_node`."""
    package = logging.getLogger("rosbot_patrol")
    if not any(isinstance(h, _ToRosout) for h in package.handlers):
        package.addHandler(_ToRosout())
        package.setLevel(logging.INFO)
        package.propagate = False
    _answer_rospy()


def _answer_rospy() -> None:
    """Cache the parameter that rospy asks the master for at each log line: whether /rosout lists the node's topics.

    rospy caches only a parameter that is set. Without an entry each line waits for the master: 2 ms, 100 ms on a busy
    machine, forever if the master hangs. Later changes of the parameter have no effect.
    """
    value = rospy.get_param(_OMIT_TOPICS, False)
    get_param_server_cache().set(rospy.resolve_name(_OMIT_TOPICS), value)
