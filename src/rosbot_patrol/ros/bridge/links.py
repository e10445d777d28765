"""What a bridge tells the supervision of sensors: who is heard on which connection, on /sensors/links."""

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
SHORTEST = 0.1  # [s] between two messages, however much changes


class LinkTeller:
    """Keeps the links and publishes them: once a second, and at once when a connection comes or goes."""

    def __init__(self) -> None:
        self._links = Links()
        self._clients: dict[str, Client] = {}
        self._lock = threading.Lock()
        self._changed = threading.Event()
        self._is_started = False
        # in simulated time a device's clock goes at another pace, which is no fault of it
        self._compares_clocks = not rospy.get_param("/use_sim_time", False)
        self._publisher = rospy.Publisher("sensors/links", SensorLinks, queue_size=5)

    def start(self) -> None:
        """Begin to publish; a bridge on which no sensor is expected does so with the first that it hears."""
        if not self._is_started:
            self._is_started = True
            Worker(self._run, name="links").start()

    def heard(self, client: Client, sensor_id: int, now: float, *, move: bool) -> None:
        """A sensor's message came."""
        with self._lock:
            is_new = self._links.heard(sensor_id, client.peer, now, move=move)
            if is_new:
                self._clients[client.peer] = client
        if is_new:
            self.start()
            self._changed.set()

    def logged(self, client: Client, text: str) -> None:
        """A device logged something."""
        with self._lock:
            changed = self._links.logged(client.peer, text)
        if changed:
            self._changed.set()

    def closed(self, client: Client) -> None:
        """A connection has ended."""
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
                return  # the node ends
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
    """The links of a message; those that make no sense are left out."""
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
