"""Guard against lost connections: a node connects to each publisher of a topic once, never twice at a time.

The master announces a new publisher several times, and rospy connects for each announcement on a thread of its own. Two
such threads can both open a connection. Then the subscriber drops one of them, the publisher drops the other, and rospy
opens no third: the topic stays silent although its publisher lives.
"""

from __future__ import annotations

import threading
from typing import Any

from rospy.impl.masterslave import ROSHandler

_connect = ROSHandler._connect_topic
_busy: set[tuple[str, str]] = set()  # topics and publishers to which a thread connects now
_changed = threading.Condition()


def install() -> None:
    """Connect one at a time to each publisher of a topic; call before `rospy.init_node`."""
    ROSHandler._connect_topic = _connect_in_turn


def _connect_in_turn(handler: Any, topic: str, publisher: str) -> Any:
    link = topic, publisher
    with _changed:
        _changed.wait_for(lambda: link not in _busy)
        _busy.add(link)
    try:
        return _connect(handler, topic, publisher)  # does nothing if there is a connection
    finally:
        with _changed:
            _busy.discard(link)
            _changed.notify_all()
