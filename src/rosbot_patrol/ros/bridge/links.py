"""The bridge's report to the supervision of sensors, on /sensors/links: which sensor is on which connection."""

from __future__ import annotations

import math
import threading
import time

import rospy

from rosbot_patrol.msg import SensorLink, SensorLinks
from rosbot_patrol.ros.runtime.node import Worker
from rosbot_patrol.rosserial.server.client import Client
from rosbot_patrol.sensors.links import Links
from rosbot_patrol.sensors.problems import Link

PERIOD = 1.0
SHORTEST = 0.1  # shortest time between two messages [s], however much changes


class LinkTeller:
    """The links of the bridge: published once a second, and at once when a connection opens or closes."""

    def __init__(self) -> None:
        self._links = Links()
        self._clients: dict[str, Client] = {}
        self._lock = threading.Lock()
        self._changed = threading.Event()
        self._is_started = False
        # in simulated time a device's clock has another speed, which is no fault
        self._compares_clocks = not rospy.get_param("/use_sim_time", False)
        self._publisher = rospy.Publisher("sensors/links", SensorLinks, queue_size=5)

    def start(self) -> None:
        """Start to publish; without expected sensors, publishing starts with the first sensor heard."""
        if not self._is_started:
            self._is_started = True
            Worker(self._run, name="links").start()

    def heard(self, client: Client, sensor_id: int, now: float, *, move: bool) -> None:
        """Record a sensor's message."""
        with self._lock:
            is_new = self._links.heard(sensor_id, client.peer, now, move=move)
            if is_new:
                self._clients[client.peer] = client
        if is_new:
            self.start()
            self._changed.set()

    def logged(self, client: Client, text: str) -> None:
        """Record a log line of a device."""
        with self._lock:
            changed = self._links.logged(client.peer, text)
        if changed:
            self._changed.set()

    def closed(self, client: Client) -> None:
        """Record the end of a connection."""
        with self._lock:
            was_heard = self._links.closed(client.peer)
            self._clients.pop(client.peer, None)
        if was_heard:
            self._changed.set()

    def _run(self) -> None:
        while not rospy.is_shutdown():
            self._changed.wait(PERIOD)
            self._changed.clear()
            message = SensorLinks(bridge=rospy.get_name())
            with self._lock:
                if self._publisher.get_num_connections():
                    message.links = [_message(link) for link in self._links.snapshot(time.monotonic(), self._of_peer)]
            message.header.stamp = rospy.Time.now()
            try:
                self._publisher.publish(message)
            except rospy.ROSException:
                return  # the node is ending
            time.sleep(SHORTEST)

    def _of_peer(self, peer: str) -> tuple[bool, float | None]:
        client = self._clients.get(peer)
        if client is None:
            return False, None
        offset = client.session.clock_offset if self._compares_clocks else None
        return client.session.proven_id is not None, offset


def _message(link: Link) -> SensorLink:
    known = link.clock_offset is not None
    return SensorLink(
        link.sensor_id,
        link.peer,
        link.proven,
        link.heard,
        link.messages,
        link.triggers,
        link.is_stuck,
        known,
        link.clock_offset if known else 0.0,
    )


def links_from_msg(message: SensorLinks) -> list[Link]:
    """Links of a message, without invalid ones."""
    return [
        Link(
            sensor_id=each.id,
            peer=each.peer,
            heard=each.heard,
            messages=each.messages,
            triggers=each.triggers,
            proven=each.proven,
            is_stuck=each.stuck,
            clock_offset=each.clock_offset if each.clock_known and math.isfinite(each.clock_offset) else None,
        )
        for each in message.links
        if math.isfinite(each.heard)
    ]
