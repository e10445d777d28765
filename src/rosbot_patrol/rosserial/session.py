"""The server's side of rosserial, without sockets: bytes in, events out, frames to send.

One `Session` serves one connected device. It checks what the device announces against a `Policy`; whether a message
type exists and its MD5 fits is found by its owner, who calls `reject`.
"""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.packet import Packet, Parser, encode
from rosbot_patrol.rosserial.policy import Policy
from rosbot_patrol.rosserial.topics import (
    NEGOTIATION_IDS,
    REQUEST_TOPICS,
    ParamValues,
    TopicId,
    TopicInfo,
    pack_param_values,
    pack_time,
    unpack_log,
    unpack_param_request,
    unpack_topic_info,
)

FRAME_TIMEOUT = 1.0  # a frame that stalls for longer is given up
RETRY_PERIOD = 3.0  # between two requests for topics
QUIET = 5.0  # without a frame a device counts as out of sync
INCOMING = frozenset({TopicId.PUBLISHER, TopicId.SERVICE_SERVER_PUBLISHER, TopicId.SERVICE_CLIENT_PUBLISHER})


@dataclass(frozen=True)
class Announced:
    """A topic that the policy allows; answer with `Session.reject` where it cannot be had."""

    kind: TopicId
    info: TopicInfo


@dataclass(frozen=True)
class Received:
    """A message of the device on a topic that it announced."""

    kind: TopicId
    info: TopicInfo
    data: bytes


@dataclass(frozen=True)
class Refused:
    """A topic, or what was sent on none, is not accepted."""

    what: str
    reason: str


@dataclass(frozen=True)
class LogLine:
    """The device logs, level 0 (debug) to 4 (fatal)."""

    level: int
    text: str


@dataclass(frozen=True)
class TimeAsked:
    """The device asks for the time; answer with `Session.answer_time`."""


@dataclass(frozen=True)
class ParamAsked:
    """The device asks for a parameter that it may know; answer with `Session.answer_param`."""

    name: str


@dataclass(frozen=True)
class Garbled:
    """Bytes came that are no frame; told once a connection."""

    sample: bytes


@dataclass(frozen=True)
class SyncLost:
    """Nothing was heard for some time; the topics are asked for again."""

    seconds: float


@dataclass(frozen=True)
class HangUp:
    """The connection is not worth keeping."""

    reason: str


Event = Announced | Received | Refused | LogLine | TimeAsked | ParamAsked | Garbled | SyncLost | HangUp


class Session:
    """One device.

    Args:
        policy: what it may do.
        now: time of the connection [s], any monotonic clock; the same clock in all calls.
        silence_timeout: hang up on a device not heard of for that long [s], None for never.
    """

    def __init__(self, policy: Policy, now: float, *, silence_timeout: float | None = 15.0) -> None:
        self.policy = policy
        self.parser = Parser(policy.max_payload)
        self.incoming: dict[int, tuple[TopicId, TopicInfo]] = {}
        self.outgoing: dict[int, tuple[TopicId, TopicInfo]] = {}
        self.last_frame = now
        self.last_time_request = float("-inf")
        self.messages = 0
        self.dropped = 0
        self.sync_losses = 0
        self._silence_timeout = silence_timeout
        self._refused_ids: set[int] = set()
        self._refusals = 0
        self._last_bytes = now
        self._last_request = now
        self._in_sync = True
        self._garbled = False
        self._credit = policy.max_rate
        self._credit_at = now
        self._output: list[bytes] = [REQUEST_TOPICS]

    @property
    def configured(self) -> bool:
        """Whether the device has announced a topic that was accepted."""
        return bool(self.incoming or self.outgoing)

    def take_output(self) -> list[bytes]:
        """Frames to send, each in one piece."""
        frames, self._output = self._output, []
        return frames

    def receive(self, data: bytes, now: float) -> list[Event]:
        """Take bytes of the device; return what they mean."""
        garbage = self.parser.garbage
        self._last_bytes = now
        events = self._packets(self.parser.feed(data), now)
        if self.parser.garbage > garbage:
            events += self._complain(data)
        return events

    def tick(self, now: float) -> list[Event]:
        """Notice what did not come; call it every half second or so."""
        events: list[Event] = []
        while self.parser.pending and now - self._last_bytes > FRAME_TIMEOUT:
            events += self._packets(self.parser.give_up(), now)
        quiet = now - self.last_frame
        if self._silence_timeout is not None and quiet > self._silence_timeout:
            events.append(HangUp(f"nothing that makes sense was heard for {quiet:.0f} s"))
        elif quiet > QUIET and self._in_sync:
            self._in_sync = False
            self.sync_losses += 1
            events.append(SyncLost(quiet))
        if (quiet > QUIET or not self.configured) and now - self._last_request >= RETRY_PERIOD:
            self._request_topics(now)
        return events

    def pause(self, now: float) -> float:
        """How long to read nothing more from this device [s], so that it keeps to its rate."""
        rate = self.policy.max_rate
        if rate <= 0.0:
            return 0.0
        self._credit = min(rate, self._credit + (now - self._credit_at) * rate)
        self._credit_at = now
        return max(0.0, -self._credit / rate)

    def reject(self, kind: TopicId, info: TopicInfo) -> None:
        """Take back the acceptance of a topic."""
        (self.incoming if kind in INCOMING else self.outgoing).pop(info.topic_id, None)
        self._note_refused(info.topic_id)

    def accepts(self, message: Received) -> bool:
        """Whether the topic of a message has not been rejected since it came."""
        return self.incoming.get(message.info.topic_id) == (message.kind, message.info)

    def answer_time(self, seconds: int, nanoseconds: int) -> None:
        """Tell the time."""
        self._output.append(encode(TopicId.TIME, pack_time(seconds, nanoseconds)))

    def answer_param(self, values: ParamValues) -> None:
        """Tell a parameter."""
        self._output.append(encode(TopicId.PARAMETER_REQUEST, pack_param_values(values)))

    def _packets(self, packets: list[Packet], now: float) -> list[Event]:
        events: list[Event] = []
        if packets:
            self.last_frame = now
            self._in_sync = True
            self._credit -= len(packets)
        for packet in packets:
            try:
                events += self._packet(packet, now)
            except ProtocolError as err:
                self.dropped += 1
                events.append(Refused(f"a frame with topic id {packet.topic_id}", str(err)))
        return events

    def _packet(self, packet: Packet, now: float) -> list[Event]:
        topic_id = packet.topic_id
        known = self.incoming.get(topic_id)
        if known is not None:
            self.messages += 1
            return [Received(*known, packet.data)]
        if topic_id in NEGOTIATION_IDS:
            return self._announce(TopicId(topic_id), unpack_topic_info(packet.data))
        if topic_id == TopicId.TIME:
            self.last_time_request = now
            return [TimeAsked()]
        if topic_id == TopicId.LOG:
            return [LogLine(*unpack_log(packet.data))]
        if topic_id == TopicId.PARAMETER_REQUEST:
            return self._param(unpack_param_request(packet.data))
        return self._unknown(topic_id, now)

    def _announce(self, kind: TopicId, info: TopicInfo) -> list[Event]:
        known = self.incoming if kind in INCOMING else self.outgoing
        if known.get(info.topic_id) == (kind, info):
            return []
        reason = self.policy.refusal(kind, info)
        if reason is None and info.topic_id < 100:
            reason = f"topic id {info.topic_id} belongs to the protocol"
        if reason is None and len(self.incoming) + len(self.outgoing) >= self.policy.max_topics:
            reason = f"more than {self.policy.max_topics} topics"
        if reason is not None:
            return self._refuse(kind, info, reason)
        known[info.topic_id] = (kind, info)
        self._refused_ids.discard(info.topic_id)
        return [Announced(kind, info)]

    def _refuse(self, kind: TopicId, info: TopicInfo, reason: str) -> list[Event]:
        self._note_refused(info.topic_id)
        what = f"{kind.name.lower().replace('_', ' ')} {info.name[:100]!r} of type {info.message_type[:100]!r}"
        events: list[Event] = [Refused(what, reason)]
        if self._refusals > 20 * self.policy.max_topics:
            events.append(HangUp(f"{self._refusals} refused topics"))
        return events

    def _note_refused(self, topic_id: int) -> None:
        self._refusals += 1
        if len(self._refused_ids) < 4 * self.policy.max_topics:
            self._refused_ids.add(topic_id)

    def _param(self, name: str) -> list[Event]:
        if self.policy.may_read(name):
            return [ParamAsked(name)]
        return [Refused(f"parameter {name[:100]!r}", "not on the list of what it may know")]

    def _unknown(self, topic_id: int, now: float) -> list[Event]:
        """A message before negotiation, as the sketch sends after a reconnect, or on a topic that was refused."""
        self.dropped += 1
        if topic_id not in self._refused_ids and now - self._last_request >= 1.0:
            self._request_topics(now)
        return []

    def _request_topics(self, now: float) -> None:
        self._last_request = now
        self._output.append(REQUEST_TOPICS)

    def _complain(self, data: bytes) -> list[Event]:
        events: list[Event] = []
        if not self._garbled:
            self._garbled = True
            events.append(Garbled(data[:24]))
        limit = self.policy.max_garbage
        if limit and self.parser.garbage_run > limit:
            events.append(HangUp(f"{self.parser.garbage_run} bytes without a frame in them"))
        return events
