"""The device's side of rosserial, without sockets: bytes in, events out, frames to send.

Behaves as rosserial_client's NodeHandle: it answers a topic request with a time request and its topics, asks for the
time every 2.5 s, and counts as disconnected after 11 s without an answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.protocol.packet import Packet, Parser, encode
from rosbot_patrol.rosserial.protocol.proof import Prover
from rosbot_patrol.rosserial.protocol.signed import FROM_BRIDGE, FROM_SENSOR, OVERHEAD, Checker, Signer
from rosbot_patrol.rosserial.protocol.topics import (
    TopicId,
    TopicInfo,
    pack_log,
    pack_time,
    pack_topic_info,
    unpack_time,
)

SYNC_PERIOD = 2.5
SYNC_TIMEOUT = 11.0
FRAME_TIMEOUT = 1.0  # time after which a stalled frame is given up [s]


@dataclass(frozen=True)
class Message:
    """The server sent a message on a subscribed topic."""

    topic_id: int
    data: bytes


@dataclass(frozen=True)
class Configured:
    """The server asked for the topics and received them."""


@dataclass(frozen=True)
class Unconfigured:
    """The server stopped the traffic, or has not answered for too long."""

    reason: str
    is_gone: bool = False


@dataclass(frozen=True)
class NotTrusted:
    """The server lacks the key or refuses the device; disconnect and try again later."""

    reason: str


DeviceEvent = Message | Configured | Unconfigured | NotTrusted


class DeviceSession:
    """One connection of a device.

    Args:
        publishers: topics that it publishes; subscribers: topics that it subscribes to.
        services: that it offers, each by the announcements of its requests and of its answers.
        max_payload: longest message taken from the server [bytes].
        prover: makes a prover for each challenge of a server with keys; None: a device without a key.
        insist: talk only to a server that has proved that it has the key.
    """

    def __init__(
        self,
        publishers: Sequence[TopicInfo],
        subscribers: Sequence[TopicInfo] = (),
        *,
        services: Sequence[tuple[TopicInfo, TopicInfo]] = (),
        max_payload: int = 512,
        prover: Prover | None = None,
        insist: bool = False,
    ) -> None:
        if insist and prover is None:
            raise ValueError("a device without a key cannot insist on it")
        self._publishers = tuple(publishers)
        self._subscribers = tuple(subscribers)
        self._services = tuple(services)
        self._parser = Parser(max_payload)
        self._output: list[bytes] = []
        self._last_bytes = 0.0
        self._last_request = 0.0
        self._last_answer = 0.0
        self._asked = self._answered = 0  # time requests sent and answered
        self._prover = prover
        self._is_trusted = not insist
        self._awaits_answer = False
        self._signer: Signer | None = None
        self._checker: Checker | None = None
        self._offset: float | None = None
        self.configured = False

    def server_time(self, now: float) -> float | None:
        """The server's time at `now` [s], None before the first answer."""
        return None if self._offset is None else now + self._offset

    def receive(self, data: bytes, now: float) -> list[DeviceEvent]:
        """Process bytes from the server; returns events."""
        self._last_bytes = now
        return self._packets(self._parser.feed(data), now)

    def closed(self) -> list[DeviceEvent]:
        """The server ended the connection; returns events, if there are more."""
        if self._awaits_answer:
            return [NotTrusted("the bridge did not take the proof, it has another key of this sensor or none")]
        return []

    def tick(self, now: float) -> list[DeviceEvent]:
        """Ask for the time when it is due; detect a lost server or a truncated frame."""
        events: list[DeviceEvent] = []
        while self._parser.pending and now - self._last_bytes > FRAME_TIMEOUT:
            events += self._packets(self._parser.give_up(), now)
        if not self.configured:
            return events
        if now - self._last_answer > SYNC_TIMEOUT:
            self.configured = False
            return [*events, Unconfigured("no time from the server for 11 s", is_gone=True)]
        if now - self._last_request > SYNC_PERIOD:
            self._request_time(now)
        return events

    def publish(self, topic_id: int, data: bytes) -> bool:
        """Queue a message; False if the topics have not been negotiated."""
        if not self.configured:
            return False
        self._output.append(encode(topic_id, data))
        return True

    def request_receipt(self, now: float) -> int:
        """Ask the server for a receipt of everything published so far; pass the number to `has_receipt`.

        The request asks for the time: the server answers frames in order, and publishes before it answers.
        """
        self._request_time(now)
        return self._asked

    def has_receipt(self, number: int) -> bool:
        """Whether the server has sent that receipt."""
        return self._answered >= number

    def log(self, level: int, text: str) -> bool:
        """Queue a line for the server's log, level 0 (debug) to 4 (fatal); False without a connection."""
        if not self.configured:
            return False
        self._output.append(encode(TopicId.LOG, pack_log(level, text)))
        return True

    def take_output(self) -> list[bytes]:
        """Frames to send, each in one piece."""
        frames, self._output = self._output, []
        return [self._signer.sign(frame) if self._signer is not None else frame for frame in frames]

    def _packets(self, packets: list[Packet], now: float) -> list[DeviceEvent]:
        return [event for packet in packets for event in self._packet(packet, now)]

    def _packet(self, packet: Packet, now: float) -> list[DeviceEvent]:
        if packet.topic_id in (TopicId.CHALLENGE, TopicId.PROOF):
            return self._prove(packet)
        if not self._is_trusted:
            return [NotTrusted("the bridge did not show that it has this sensor's key")]
        if self._checker is not None:
            try:
                packet = Packet(packet.topic_id, self._checker.check(packet.topic_id, packet.data))
            except ProtocolError as err:
                return [NotTrusted(f"somebody in between has changed what the bridge says: {err.problem}")]
        if packet.topic_id == TopicId.PUBLISHER:
            return self._negotiate(now)
        if packet.topic_id == TopicId.TIME:
            try:
                self._offset = unpack_time(packet.data) - now
            except ProtocolError:
                return []
            self._last_answer = now
            self._answered += 1
            return []
        if packet.topic_id == TopicId.TX_STOP:
            self.configured = False
            return [Unconfigured("the server stopped the traffic")]
        return [Message(packet.topic_id, packet.data)]

    def _prove(self, packet: Packet) -> list[DeviceEvent]:
        if self._prover is None:
            return [NotTrusted("the bridge asks for a key, and this sensor has none")]
        if packet.topic_id == TopicId.PROOF:
            if not self._prover.confirms(packet.data):
                return [NotTrusted("the bridge does not have this sensor's key")]
            self._is_trusted, self._awaits_answer = True, False
            if self._prover.session is not None and self._checker is None:
                self._parser.max_payload += OVERHEAD
                self._checker = Checker(self._prover.session, FROM_BRIDGE)
                self._signer = Signer(self._prover.session, FROM_SENSOR)
            return []
        if self._checker is not None:
            return [NotTrusted("the bridge asks for the key a second time")]
        try:
            self._output.append(self._prover.answer(packet.data))
            self._awaits_answer = True
        except ProtocolError as err:
            return [NotTrusted(f"the bridge sent {err.problem}")]
        return []

    def _negotiate(self, now: float) -> list[DeviceEvent]:
        self._request_time(now)
        for info in self._publishers:
            self._output.append(encode(TopicId.PUBLISHER, pack_topic_info(info)))
        for info in self._subscribers:
            self._output.append(encode(TopicId.SUBSCRIBER, pack_topic_info(info)))
        for requests, answers in self._services:
            self._output.append(encode(TopicId.SERVICE_SERVER_PUBLISHER, pack_topic_info(answers)))
            self._output.append(encode(TopicId.SERVICE_SERVER_SUBSCRIBER, pack_topic_info(requests)))
        self._last_answer = now
        first = not self.configured
        self.configured = True
        return [Configured()] if first else []

    def _request_time(self, now: float) -> None:
        self._last_request = now
        self._asked += 1
        known = self.server_time(now) or 0.0  # its own estimate, so that the server can detect a wrong clock
        self._output.append(encode(TopicId.TIME, pack_time(int(known), int(known % 1.0 * 1e9))))
