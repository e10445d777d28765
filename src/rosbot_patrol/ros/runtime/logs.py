"""Log records of the pure modules (`logging.getLogger("rosbot_patrol...")`) on the console and /rosout."""

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
    """Limits the rate of each kind of line and counts those held back, so that no line buries the others.

    Args:
        period: shortest time between two lines of a kind [s].
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._said: dict[str, float] = {}
        self._held_back: dict[str, int] = {}

    def due(self, kind: str, now: float) -> str | None:
        """Suffix for a line of that kind (how often it was held back since the last); None: hold it back."""
        if 0.0 <= now - self._said.get(kind, -math.inf) < self._period:
            self._held_back[kind] = self._held_back.get(kind, 0) + 1
            return None
        self._said[kind] = now
        more = self._held_back.pop(kind, 0)
        return f" (and {count_of(more, 'time')} before)" if more else ""


def install() -> None:
    """Send every record of this package to the logger `rosout`; call it once, after `init_node`."""
    package = logging.getLogger("rosbot_patrol")
    if not any(isinstance(h, _ToRosout) for h in package.handlers):
        package.addHandler(_ToRosout())
        package.setLevel(logging.INFO)
        package.propagate = False
    _answer_rospy()


def _answer_rospy() -> None:
    """Answer in advance what rospy asks the master at each log line: does /rosout omit the node's topics?

    Only a parameter that is set enters rospy's cache. Without an entry each line waits for the master: 2 ms, 100 ms on
    a busy machine, and for ever if the master hangs. The parameter's value at the start counts.
    """
    value = rospy.get_param(_OMIT_TOPICS, False)
    get_param_server_cache().set(rospy.resolve_name(_OMIT_TOPICS), value)
