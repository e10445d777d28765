"""What devices publish, handed to ROS as the bytes that came: no thread, no queue and no message object in between.

A message of fixed size (an EspTrigger has 2 bytes) is checked by its length and sent on as it is; others are read as
what they claim to be and written again. All of one moment go to a subscriber in one piece. A subscriber that does not
read holds nobody up: what it has not taken waits, up to a bound, and then the oldest go.

rospy negotiates with the subscribers; then this writes to their connections itself (`Publisher.impl.connections` of
rospy 1.16), as rospy would have a thread per subscriber do it, which cost half of the bridge's time and up to 5 ms.
"""

from __future__ import annotations

import io
import logging
import re
import socket
import struct
import time
from collections import deque
from dataclasses import dataclass
from typing import Any

import genpy
import roslib.message
import rospy
import rospy.msg

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.ros.serial_channels import check_md5, deserialize, message_class
from rosbot_patrol.rosserial.topics import TopicInfo

log = logging.getLogger(__name__)

SETTLING = 1.0  # subscribers hear of a new publisher through the master [s]
HELD = 1000  # messages kept for them meanwhile
WAITING = 1 << 20  # bytes kept for a subscriber that does not read
_ARRAY = re.compile(r"^(.+)\[(\d*)\]$")
_SIZES = {"time": 8, "duration": 8, "bool": 1, "byte": 1, "char": 1, "float32": 4, "float64": 8}
_SIZES |= {f"{sign}int{bits}": bits // 8 for sign in ("", "u") for bits in (8, 16, 32, 64)}


@dataclass(frozen=True)
class Layout:
    """A message type whose messages all have one size.

    Attributes:
        size: of the message [bytes]; flags: where its bools are.
    """

    size: int
    flags: tuple[int, ...] = ()

    def check(self, data: bytes, info: TopicInfo) -> bytes:
        """The message as it is to be sent, each bool 0 or 1; raises ProtocolError where it has another size."""
        if len(data) != self.size:
            raise ProtocolError("", f"{info.name}: {len(data)} bytes, a {info.message_type} has {self.size}")
        if any(data[at] > 1 for at in self.flags):
            changed = bytearray(data)
            for at in self.flags:
                changed[at] = min(changed[at], 1)
            return bytes(changed)
        return data


def layout(cls: Any) -> Layout | None:
    """How a message class lies in memory; None where its size varies or its header is to be numbered by ROS."""
    if getattr(cls, "_has_header", False):
        return None
    flags: list[int] = []
    size = _measure(cls._slot_types, 0, flags)
    return None if size is None else Layout(size, tuple(flags))


def _measure(types: list[str], at: int, flags: list[int]) -> int | None:
    """Where these fields end that begin `at`; notes bools."""
    for name in types:
        array = _ARRAY.match(name)
        if name == "string" or (array and not array[2]):
            return None
        one = array[1] if array else name
        for _ in range(int(array[2]) if array else 1):
            if one in _SIZES:
                flags += [at] * (one == "bool")
                at += _SIZES[one]
                continue
            inner = roslib.message.get_message_class(one)
            end = None if inner is None else _measure(inner._slot_types, at, flags)
            if end is None:
                return None
            at = end
    return at


class Outlet:
    """The way to one subscriber: never waits.

    Args:
        connection: rospy's, header exchanged; name: of the topic, for messages.

    Attributes:
        lost: messages that it will never get.
    """

    def __init__(self, connection: Any, name: str) -> None:
        self.connection = connection
        self.lost = 0
        self._name = name
        self._waiting: deque[tuple[bytes, int]] = deque()
        self._bytes = 0
        self._silent_until = 0.0

    def put(self, data: bytes, messages: int) -> None:
        """Send, or keep until it reads again; raises OSError where the subscriber has gone."""
        self._waiting.append((data, messages))
        self._bytes += len(data)
        self.flush()
        while self._bytes > WAITING and len(self._waiting) > 1:
            dropped, count = self._waiting[1]  # the first may be half sent
            del self._waiting[1]
            self._bytes -= len(dropped)
            self.lost += count
            self._complain()

    def flush(self) -> None:
        """Send what it takes; raises OSError where the subscriber has gone."""
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
    """One ROS publisher; in its first second it keeps messages back until the subscribers have found it."""

    def __init__(self, name: str, cls: Any) -> None:
        self.cls = cls
        self._name = name
        self._layout = layout(cls)
        self._publisher = rospy.Publisher(name, cls, queue_size=1, tcp_nodelay=True)
        self._publisher.impl.set_queue_size(None)  # connections without rospy's thread
        self._opens_at = time.monotonic() + SETTLING
        self._seq = 0
        self._batch: list[bytes] = []
        self._connections: list[Any] = []
        self._outlets: list[Outlet] = []

    def put(self, info: TopicInfo, data: bytes) -> None:
        """Take a message, to be sent by `flush`; raises ProtocolError where it is none of this type."""
        if self._layout is None:
            framed = self._rewrite(info, data)
        else:
            framed = struct.pack("<I", self._layout.size) + self._layout.check(data, info)
        if self._opens_at and len(self._batch) >= HELD:
            del self._batch[0]
        self._batch.append(framed)

    def flush(self, now: float) -> None:
        """Send what was put, and what a subscriber had not taken."""
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
                outlet.connection.close()  # rospy forgets it
        impl.message_data_sent += len(data)

    def _rewrite(self, info: TopicInfo, data: bytes) -> bytes:
        message = deserialize(self.cls, data, info.name)
        self._seq += 1
        buffer = io.BytesIO()
        try:
            rospy.msg.serialize_message(buffer, self._seq, message)
        except (genpy.SerializationError, rospy.ROSException) as err:
            raise ProtocolError("", f"{info.name}: {err}") from err
        framed = buffer.getvalue()
        seq = 4 if getattr(self.cls, "_has_header", False) else 0  # written anew
        if framed[4 + seq :] != data[seq:]:  # genpy takes a text that is cut off, and leaves what is too much
            raise ProtocolError("", f"{info.name}: {len(data)} bytes that are no {info.message_type}")
        return framed


class Publishers:
    """ROS publishers that the devices share; they stay advertised when a device goes, as upstream's do."""

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
        """Advertise a topic where it is not yet; raises ProtocolError."""
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
        """Take the bytes of a device, to be published by `flush`; raises ProtocolError."""
        topic = self._resolved[info.name]
        topic.put(info, data)
        self._full.add(topic)

    def flush(self) -> None:
        """Publish what was put since."""
        if self._full:
            now = time.monotonic()
            for topic in self._full:
                topic.flush(now)
            self._full.clear()

    def tick(self) -> None:
        """Publish what had to wait, for a subscriber that did not read or for the first ones to come."""
        now = time.monotonic()
        for topic in self._by_name.values():
            topic.flush(now)
