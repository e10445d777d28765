"""The device's side of rosserial, without sockets: bytes in, events out, frames to send.

Behaves as rosserial_client's NodeHandle: answers a topic request with a time request and its topics, asks for the time
every 2.5 s, and takes itself for disconnected after 11 s without an answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.packet import Packet, Parser, encode
from rosbot_patrol.rosserial.topics import TopicId, TopicInfo, pack_time, pack_topic_info, unpack_time

SYNC_PERIOD = 2.5
SYNC_TIMEOUT = 11.0


@dataclass(frozen=True)
class Message:
    """The server sent a message on a topic that the device subscribes."""

    topic_id: int
    data: bytes


@dataclass(frozen=True)
class Configured:
    """The server asked for the topics and was told them."""


@dataclass(frozen=True)
class Unconfigured:
    """The server stopped the traffic, or has not answered for long."""

    reason: str


DeviceEvent = Message | Configured | Unconfigured


class DeviceSession:
    """One connection of a device.

    Args:
        publishers: topics that it publishes; subscribers: topics that it listens to.
        max_payload: longest message taken from the server [bytes].
    """

    def __init__(
        self, publishers: Sequence[TopicInfo], subscribers: Sequence[TopicInfo] = (), *, max_payload: int = 512
    ) -> None:
        self._publishers = tuple(publishers)
        self._subscribers = tuple(subscribers)
        self._parser = Parser(max_payload)
        self._output: list[bytes] = []
        self._last_request = 0.0
        self._last_answer = 0.0
        self._offset: float | None = None
        self.configured = False

    def server_time(self, now: float) -> float | None:
        """The server's time at `now` [s], None before the first answer."""
        return None if self._offset is None else now + self._offset

    def receive(self, data: bytes, now: float) -> list[DeviceEvent]:
        """Take bytes of the server; return what they mean."""
        events: list[DeviceEvent] = []
        for packet in self._parser.feed(data):
            events += self._packet(packet, now)
        return events

    def tick(self, now: float) -> list[DeviceEvent]:
        """Ask for the time where it is due; notice that the server is gone."""
        if not self.configured:
            return []
        if now - self._last_answer > SYNC_TIMEOUT:
            self.configured = False
            return [Unconfigured("no time from the server for 11 s")]
        if now - self._last_request > SYNC_PERIOD:
            self._request_time(now)
        return []

    def publish(self, topic_id: int, data: bytes) -> bool:
        """Queue a message; False where the topics have not been negotiated."""
        if not self.configured:
            return False
        self._output.append(encode(topic_id, data))
        return True

    def take_output(self) -> list[bytes]:
        """Frames to send, each in one piece."""
        frames, self._output = self._output, []
        return frames

    def _packet(self, packet: Packet, now: float) -> list[DeviceEvent]:
        if packet.topic_id == TopicId.PUBLISHER:
            return self._negotiate(now)
        if packet.topic_id == TopicId.TIME:
            try:
                self._offset = unpack_time(packet.data) - now
            except ProtocolError:
                return []
            self._last_answer = now
            return []
        if packet.topic_id == TopicId.TX_STOP:
            self.configured = False
            return [Unconfigured("the server stopped the traffic")]
        return [Message(packet.topic_id, packet.data)]

    def _negotiate(self, now: float) -> list[DeviceEvent]:
        self._request_time(now)
        for info in self._publishers:
            self._output.append(encode(TopicId.PUBLISHER, pack_topic_info(info)))
        for info in self._subscribers:
            self._output.append(encode(TopicId.SUBSCRIBER, pack_topic_info(info)))
        self._last_answer = now
        first = not self.configured
        self.configured = True
        return [Configured()] if first else []

    def _request_time(self, now: float) -> None:
        self._last_request = now
        self._output.append(encode(TopicId.TIME, pack_time(0, 0)))
