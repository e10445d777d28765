"""Health of a node on /diagnostics, once a second of wall time."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from rosbot_patrol.ros.runtime.node import Worker

OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)


class Health:
    """Keep one status per part of a node; publish all at 1 Hz, and at once if a level changes.

    Args:
        hardware_id: name of the hardware that the node serves, "" for none.
    """

    def __init__(self, hardware_id: str = "") -> None:
        self._hardware_id = hardware_id
        self._lock = threading.Lock()
        self._parts: dict[str, DiagnosticStatus] = {}
        self._changed = threading.Event()
        self._publisher = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
        Worker(self._run, name="diagnostics").start()

    def set(self, part: str, level: int, message: str, values: Mapping[str, object] | None = None) -> None:
        """Set the health of one part ("" for the node itself)."""
        name = rospy.get_name().strip("/") + (f": {part}" if part else "")
        status = DiagnosticStatus(
            level=level,
            name=name,
            message=message,
            hardware_id=self._hardware_id,
            values=[KeyValue(str(k), str(v)) for k, v in (values or {}).items()],
        )
        with self._lock:
            before = self._parts.get(part)
            self._parts[part] = status
        if before is None or before.level != level:
            self._changed.set()

    def drop(self, part: str) -> None:
        """Forget a part, such as a client that has disconnected."""
        with self._lock:
            self._parts.pop(part, None)

    def _run(self) -> None:
        while not rospy.is_shutdown():
            self._changed.wait(1.0)
            self._changed.clear()
            with self._lock:
                parts = list(self._parts.values())
            if not parts:
                continue
            message = DiagnosticArray(status=parts)
            message.header.stamp = rospy.Time.now()
            try:
                self._publisher.publish(message)
            except rospy.ROSException:
                return
            time.sleep(0.05)
