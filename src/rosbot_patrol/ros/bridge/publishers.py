"""Publishers of devices' messages: the received bytes go to ROS without a thread, a queue or a message object between.

A message is checked against its definition and sent unchanged; only a header gets ROS's sequence number. All messages
of one moment go to a subscriber in one piece. A subscriber that does not read delays nobody: its messages wait, up to a
bound, and then the oldest are dropped.

rospy negotiates with the subscribers; then this module writes to their connections itself
(`Publisher.impl.connections` of rospy 1.16). rospy's own thread per subscriber cost half of the bridge's time and up to
5 ms.
"""

from __future__ import annotations

import logging
import socket
import struct
import time
from collections import deque
from typing import Any

import rospy

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.ros.bridge.channels import check_md5, message_class
from rosbot_patrol.ros.bridge.layouts import layout
from rosbot_patrol.rosserial.protocol.old_types import find_old_type
from rosbot_patrol.rosserial.protocol.topics import TopicInfo

log = logging.getLogger(__name__)

SETTLING = 1.0  # time for subscribers to learn of a new publisher from the master [s]
HELD = 1000  # messages kept meanwhile
WAITING = 1 << 20  # bytes kept for a subscriber that does not read


class Outlet:
    """The connection to one subscriber; it never waits.

    Args:
        connection: rospy's, after the header exchange; name: name of the topic, for messages.

    Attributes:
        lost: number of messages that the subscriber will never get.
    """

    def __init__(self, connection: Any, name: str) -> None:
        self.connection = connection
        self.lost = 0
        self._name = name
        self._waiting: deque[tuple[bytes, int]] = deque()
        self._bytes = 0
        self._silent_until = 0.0

    def put(self, data: bytes, messages: int) -> None:
        """Send, or keep until the subscriber reads again; raises OSError if it has gone."""
        self._waiting.append((data, messages))
        self._bytes += len(data)
        self.flush()
        while self._bytes > WAITING and len(self._waiting) > 1:
            dropped, count = self._waiting[1]  # the first may be sent in part
            del self._waiting[1]
            self._bytes -= len(dropped)
            self.lost += count
            self._complain()

    def flush(self) -> None:
        """Send as much as possible; raises OSError if the subscriber has gone."""
        while self._waiting:
            data, messages = self._waiting[0]
            link = self.connection.socket
            if link is None:
                raise OSError("closed")
            try:
                sent = link.send(data, socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL)
            except BlockingIOError:
                return
            self._bytes -= sent
            self.connection.stat_bytes += sent
            if sent < len(data):
                self._waiting[0] = (data[sent:], messages)
                return
            self.connection.stat_num_msg += messages
            self._waiting.popleft()

    def _complain(self) -> None:
        now = time.monotonic()
        if now >= self._silent_until:
            self._silent_until = now + 60.0
            who = self.connection.endpoint_id
            log.warning("%s: %s does not keep up, the oldest messages are lost, %d so far", self._name, who, self.lost)


class Topic:
    """One ROS publisher; for its first second it holds messages back until the subscribers have found it."""

    def __init__(self, name: str, cls: Any) -> None:
        self.cls = cls
        self._name = name
        self._layout = layout(cls)
        self._has_header = bool(getattr(cls, "_has_header", False))
        self._publisher = rospy.Publisher(name, cls, queue_size=1, tcp_nodelay=True)
        self._publisher.impl.set_queue_size(None)  # connections without rospy's thread
        self._opens_at = time.monotonic() + SETTLING
        self._seq = 0
        self._batch: list[bytes] = []
        self._connections: list[Any] = []
        self._outlets: list[Outlet] = []

    def put(self, info: TopicInfo, data: bytes) -> None:
        """Take a message for the next `flush`; raises ProtocolError if it is not of this type."""
        old = find_old_type(info.message_type, info.md5, self.cls._md5sum)
        data = self._layout.check(old.upgrade(data) if old else data, info)
        if self._has_header:
            data = self._numbered(data)
        if self._opens_at and len(self._batch) >= HELD:
            del self._batch[0]
        self._batch.append(struct.pack("<I", len(data)) + data)

    def flush(self, now: float) -> None:
        """Send the messages taken, and the remaining ones of slow subscribers."""
        if self._opens_at:
            if now < self._opens_at:
                return
            self._opens_at = 0.0
        impl = self._publisher.impl
        if impl is None or impl.connections is None:
            return  # the node is ending
        if impl.connections is not self._connections:
            self._connections = impl.connections
            known = {id(outlet.connection): outlet for outlet in self._outlets}
            self._outlets = [known.get(id(c)) or Outlet(c, self._name) for c in self._connections]
        batch, self._batch = self._batch, []
        data = b"".join(batch)
        for outlet in self._outlets:
            try:
                if data:
                    outlet.put(data, len(batch))
                else:
                    outlet.flush()
            except OSError as err:
                log.debug("%s: %s has gone: %s", self._name, outlet.connection.endpoint_id, err)
                outlet.connection.close()  # rospy then drops it
        impl.message_data_sent += len(data)

    def _numbered(self, data: bytes) -> bytes:
        """The message with ROS's sequence number in its header."""
        self._seq += 1
        return struct.pack("<I", self._seq & 0xFFFFFFFF) + data[4:]


class Publishers:
    """ROS publishers shared by the devices; as in upstream, they stay advertised when a device disconnects."""

    def __init__(self) -> None:
        self._by_name: dict[str, Topic] = {}
        self._resolved: dict[str, Topic] = {}
        self._full: set[Topic] = set()

    def open(self, info: TopicInfo) -> None:
        """Advertise a topic; raises ProtocolError."""
        cls = message_class(info.message_type)
        check_md5(info, cls)
        self._resolved[info.name] = self.advertise(info.name, cls)

    def advertise(self, name: str, cls: Any) -> Topic:
        """Advertise a topic unless it is already; raises ProtocolError."""
        name = rospy.resolve_name(name)
        known = self._by_name.get(name)
        if known is None:
            try:
                known = self._by_name[name] = Topic(name, cls)
            except (rospy.ROSException, ValueError) as err:
                raise ProtocolError("", f"{name} cannot be published: {err}") from err
        elif known.cls._md5sum != cls._md5sum:
            raise ProtocolError("", f"{name} is published as {known.cls._type} already, not as {cls._type}")
        return known

    def put(self, info: TopicInfo, data: bytes) -> None:
        """Take a device's bytes for the next `flush`; raises ProtocolError."""
        topic = self._resolved[info.name]
        topic.put(info, data)
        self._full.add(topic)

    def flush(self) -> None:
        """Publish the messages put since the last call."""
        if self._full:
            now = time.monotonic()
            for topic in self._full:
                topic.flush(now)
            self._full.clear()

    def tick(self) -> None:
        """Publish delayed messages: those of slow subscribers, and those held for the first ones."""
        now = time.monotonic()
        for topic in self._by_name.values():
            topic.flush(now)
