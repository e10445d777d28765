"""Report of serial_node on /diagnostics, once a second: the bridge, its sensors and its clients.

`~bytes` publishes the devices' bytes unchanged, for bags: `replay --node serial_node` reads them again.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import rospy

from rosbot_patrol.msg import SerialBytes
from rosbot_patrol.ros.runtime.diagnostics import ERROR, OK, WARN, Health
from rosbot_patrol.rosserial.server.client import Client
from rosbot_patrol.rosserial.server.report import RECENT, choose
from rosbot_patrol.rosserial.server.server import SerialServer
from rosbot_patrol.sensors.registry import SensorStatus

PERIOD = 1.0


class Report:
    """Report clients and sensors on /diagnostics.

    Args:
        sensors: returns the sensors' state at a time [s].
        what: the port or device that the server serves.
    """

    def __init__(self, server: SerialServer, sensors: Callable[[float], list[SensorStatus]], what: str) -> None:
        self._server = server
        self._sensors = sensors
        self._what = what
        self._health = Health("rosserial")
        self._parts: set[str] = set()
        self._strange = (0, 0)  # connections refused, requests refused
        self._strange_since = float("-inf")
        self._ended = threading.Event()

    def run(self) -> None:
        """Report until shutdown."""
        while not rospy.is_shutdown():
            self._step(time.monotonic())
            self._ended.wait(PERIOD)

    def _step(self, now: float) -> None:
        statuses = self._sensors(now)
        for status in statuses:
            level, text = (ERROR, "silent") if status.silent else (OK, "heard of")
            values = {"peer": status.peer, "seconds ago": f"{status.seconds:.1f}", "triggers": status.triggers}
            self._health.set(f"sensor {status.sensor_id}", level, f"{text} {status.seconds:.0f} s ago", values)
        clients = list(self._server.clients.values())
        self._tell_clients(clients, now)
        self._tell_bridge(clients, [str(status.sensor_id) for status in statuses if status.silent], now)

    def _tell_clients(self, clients: list[Client], now: float) -> None:
        in_full, others = choose(clients, now)
        parts = {f"client {state.peer}": state for state in in_full}
        for part, state in parts.items():
            self._health.set(part, int(state.level), state.text, state.values)
        kept = set(parts)
        if others:
            kept.add("other clients")
            worst = max(int(state.level) for state in others)
            lines = {state.peer: state.line for state in others}
            self._health.set("other clients", worst, f"{len(others)} more", lines)
        for part in self._parts - kept:
            self._health.drop(part)
        self._parts = kept

    def _tell_bridge(self, clients: list[Client], silent: list[str], now: float) -> None:
        server = self._server
        strange = server.journal.turned_away, server.journal.refused
        if strange != self._strange:
            self._strange, self._strange_since = strange, now
        values = {
            "clients": len(clients),
            "proven": sum(client.session.proven_id is not None for client in clients),
            "strangers": server.door.strangers,
            "turned away": server.journal.turned_away,
            "refused": server.journal.refused,
            "messages": sum(client.session.messages for client in clients),
        }
        text = f"{self._what}: {len(clients)} connected"
        if silent:
            text += f", silent: {', '.join(silent)}"
        if now - self._strange_since < RECENT:
            text += ", somebody wants what is refused"
        self._health.set("", OK if text.endswith("connected") else WARN, text, values)


class SerialTap:
    """A Tap that publishes the bytes."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher("~bytes", SerialBytes, queue_size=1000)

    def opened(self, client: Client) -> None:
        """Publish that a connection opened."""
        self._send(SerialBytes.OPENED, client, b"")

    def data(self, client: Client, data: bytes) -> None:
        """Publish received bytes."""
        self._send(SerialBytes.DATA, client, data)

    def closed(self, client: Client) -> None:
        """Publish that the connection closed."""
        self._send(SerialBytes.CLOSED, client, b"")

    def _send(self, event: int, client: Client, data: bytes) -> None:
        message = SerialBytes(event=event, peer=client.peer, address=client.address, data=data)
        message.header.stamp = rospy.Time.now()
        self._publisher.publish(message)
