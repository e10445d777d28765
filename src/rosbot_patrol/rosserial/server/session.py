"""The server's side of rosserial, without sockets: bytes in, events out, frames to send.

One `Session` serves one connected device. If the `Policy` has keys, the device must first prove that it has one
(`proof`). Its announcements are checked against the policy. The session's owner checks whether a message type exists
and its MD5 sum fits, and calls `reject` if not.
"""

from __future__ import annotations

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.protocol import proof
from rosbot_patrol.rosserial.protocol.packet import Packet, Parser, encode
from rosbot_patrol.rosserial.protocol.signed import FROM_BRIDGE, FROM_SENSOR, OVERHEAD, Checker, Signer
from rosbot_patrol.rosserial.protocol.topics import (
    ESP_TRIGGER_MD5,
    ESP_TRIGGER_TYPES,
    NEGOTIATION_IDS,
    REQUEST_TOPICS,
    ParamValues,
    TopicId,
    TopicInfo,
    pack_param_values,
    pack_time,
    unpack_log,
    unpack_param_request,
    unpack_time,
    unpack_topic_info,
)
from rosbot_patrol.rosserial.server.budget import Budget
from rosbot_patrol.rosserial.server.events import (
    Announced,
    Event,
    Garbled,
    HangUp,
    LogLine,
    ParamAsked,
    Proven,
    Received,
    Refused,
    SyncLost,
    TimeAsked,
)
from rosbot_patrol.rosserial.server.policy import Policy
from rosbot_patrol.rosserial.server.sensor_permissions import Voice

FRAME_TIMEOUT = 1.0  # time after which a stalled frame is given up [s]
RETRY_PERIOD = 3.0  # between two requests for topics
GARBAGE_PER_FRAME = 32  # bytes of garbage that cost as much as one frame
TOPIC_COST = 10.0  # cost of a new topic or a parameter, in frames
QUIET = 5.0  # silence after which a device counts as out of sync [s]
INCOMING = frozenset({TopicId.PUBLISHER, TopicId.SERVICE_SERVER_PUBLISHER, TopicId.SERVICE_CLIENT_PUBLISHER})


class Session:
    """State of one device's connection.

    Args:
        policy: its permissions.
        now: time of the connection [s], any monotonic clock; the same clock in all calls.
        address: of the device, for the list of sensors that peers may be.
        silence_timeout: silence after which the device is disconnected [s], None: never.
        nonce: of the challenge; only tests give one.

    Attributes:
        cost: received since the last `pause`, in frames; garbage and topics count, too.
        clock_offset: lead of the device's clock over ours [s], None if unknown.
    """

    def __init__(
        self,
        policy: Policy,
        now: float,
        *,
        address: str = "",
        silence_timeout: float | None = 15.0,
        nonce: bytes | None = None,
    ) -> None:
        self.policy = policy
        self.cost = 0.0
        self.clock_offset: float | None = None
        self._claimed = 0.0
        self._signer: Signer | None = None
        self._checker: Checker | None = None
        self._gate = proof.Gate(policy.keys, nonce) if policy.keys else None
        self._is_turned_away = False
        self._began = now
        self._bytes_before_proof = 0
        self._voice = Voice(policy.sensor_ids(address), policy.max_sensors)
        self._triggers: set[int] = set()  # topic ids that carry EspTriggers
        self.parser = Parser(min(policy.max_payload, proof.MAX_PAYLOAD) if self._gate else policy.max_payload)
        self.incoming: dict[int, tuple[TopicId, TopicInfo]] = {}
        self.outgoing: dict[int, tuple[TopicId, TopicInfo]] = {}
        self.last_frame = now
        self.last_time_request = float("-inf")
        self.messages = 0
        self.dropped = 0
        self.sync_losses = 0
        self._silence_timeout = silence_timeout
        self._refused_ids: set[int] = set()
        self._refused_topics: set[int] = set()  # hashes, to refuse each topic once although topics are requested again
        self._last_bytes = now
        self._last_request = now
        self._in_sync = True
        self._garbled = False
        self._budget = Budget(policy.max_rate, now)
        self._announcements = 0
        self._frame_began: float | None = None
        self._output: list[bytes] = [self._gate.challenge if self._gate else REQUEST_TOPICS]

    @property
    def configured(self) -> bool:
        """Whether the device has announced a topic that was accepted."""
        return bool(self.incoming or self.outgoing)

    @property
    def proven_id(self) -> int | None:
        """The sensor that the device has proved to be, None if it has not."""
        return self._voice.proven_id

    @property
    def needs_proof(self) -> bool:
        """Whether the device must still prove that it has a key."""
        return self._gate is not None

    @property
    def has_output(self) -> bool:
        """Whether there are frames to send."""
        return bool(self._output)

    def sign(self, frame: bytes) -> bytes:
        """A frame as it goes on the wire, which must be the next to leave: signed, where the device signs, too."""
        return self._signer.sign(frame) if self._signer is not None else frame

    def take_output(self) -> list[bytes]:
        """Frames to send, each in one piece."""
        frames, self._output = self._output, []
        return frames

    def receive(self, data: bytes, now: float) -> list[Event]:
        """Process bytes from the device; returns events."""
        parser = self.parser
        garbage = parser.garbage
        self._last_bytes = now
        packets = parser.feed(data)
        events = self._packets(packets, now)
        if not parser.pending:
            self._frame_began = None
        elif packets or self._frame_began is None:
            self._frame_began = now
        if self._gate is not None:
            self._bytes_before_proof += len(data)
            if self._bytes_before_proof > proof.MAX_BYTES:
                events.append(HangUp("more bytes than a proof has", is_refusal=True))
        if parser.garbage > garbage:
            self.cost += (parser.garbage - garbage) / GARBAGE_PER_FRAME
            events += self._complain(data)
        return events

    def tick(self, now: float) -> list[Event]:
        """Detect missing frames; call it about every half second."""
        if self._gate is not None:
            if now - self._began > proof.PROOF_TIMEOUT:
                return [HangUp(f"no proof within {proof.PROOF_TIMEOUT:.0f} s; has it a key?", is_refusal=True)]
            return []
        events: list[Event] = []
        while self.parser.pending and now - self._last_bytes > FRAME_TIMEOUT:
            events += self._packets(self.parser.give_up(), now)
            self._frame_began = now if self.parser.pending else None
        slow = self.policy.max_frame_time
        if slow and self._frame_began is not None and now - self._frame_began > slow:
            events.append(HangUp(f"a frame that does not end within {slow:.0f} s", is_refusal=True))
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
        """Time for which nothing more is read from this device [s], so that it keeps its rate; settles the `cost`."""
        cost, self.cost = self.cost, 0.0
        return self._budget.spend(cost, now)

    def reject(self, kind: TopicId, info: TopicInfo) -> None:
        """Withdraw the acceptance of a topic."""
        (self.incoming if kind in INCOMING else self.outgoing).pop(info.topic_id, None)
        self._note_refused(info.topic_id)

    def accepts(self, message: Received) -> bool:
        """Whether the topic of a message has not been rejected since it arrived."""
        return self.incoming.get(message.info.topic_id) == (message.kind, message.info)

    def answer_time(self, seconds: int, nanoseconds: int) -> None:
        """Send the time; compare it with the device's own time, if its request holds one."""
        if self._claimed:
            self.clock_offset = self._claimed - (seconds + nanoseconds * 1e-9)
        self._output.append(encode(TopicId.TIME, pack_time(seconds, nanoseconds)))

    def answer_param(self, values: ParamValues) -> None:
        """Send a parameter."""
        self._output.append(encode(TopicId.PARAMETER_REQUEST, pack_param_values(values)))

    def _packets(self, packets: list[Packet], now: float) -> list[Event]:
        events: list[Event] = []
        if packets:
            self.last_frame = now
            self._in_sync = True
            self.cost += len(packets)
        for packet in packets:
            try:
                events += self._packet(packet, now)
            except ProtocolError as err:
                self.dropped += 1
                events.append(Refused(f"a frame with topic id {packet.topic_id}", str(err)))
        return events

    def _packet(self, packet: Packet, now: float) -> list[Event]:
        if self._gate is not None:
            return self._before_proof(self._gate, packet, now)
        if self._is_turned_away:
            return []
        topic_id = packet.topic_id
        if self._checker is not None:
            try:
                packet = Packet(topic_id, self._checker.check(topic_id, packet.data))
            except ProtocolError as err:
                self._is_turned_away = True
                return [HangUp(f"somebody in between has changed what the sensor says: {err.problem}", is_refusal=True)]
        known = self.incoming.get(topic_id)
        if known is not None:
            if topic_id in self._triggers and not self._voice.may_say(packet.data):
                self.dropped += 1
                return [Refused(f"what it says for sensor {packet.data[0]}", self._voice.why_not(packet.data))]
            self.messages += 1
            return [Received(*known, packet.data)]
        if topic_id in NEGOTIATION_IDS:
            return self._announce(TopicId(topic_id), unpack_topic_info(packet.data))
        if topic_id == TopicId.TIME:
            self.last_time_request = now
            self._claimed = unpack_time(packet.data) if len(packet.data) == 8 else 0.0
            return [TimeAsked()]
        if topic_id == TopicId.LOG:
            return [LogLine(*unpack_log(packet.data))]
        if topic_id == TopicId.PARAMETER_REQUEST:
            return self._param(unpack_param_request(packet.data))
        return self._unknown(topic_id, now)

    def _before_proof(self, gate: proof.Gate, packet: Packet, now: float) -> list[Event]:
        if packet.topic_id != TopicId.PROOF or self._is_turned_away:
            self.dropped += 1
            return []
        try:
            sensor_id, answer = gate.check(packet.data)
        except ProtocolError as err:
            self._is_turned_away = True
            return [HangUp(str(err), is_refusal=True)]
        if not self._voice.prove(sensor_id):
            self._is_turned_away = True
            reason = f"sensor {sensor_id} at this address: the list has it elsewhere (~allow_sensors)"
            return [HangUp(reason, is_refusal=True)]
        self._gate = None
        self.parser.max_payload = self.policy.max_payload
        if gate.session is not None:
            self.parser.max_payload += OVERHEAD
            self._signer, self._checker = Signer(gate.session, FROM_BRIDGE), Checker(gate.session, FROM_SENSOR)
        self._output.append(answer)
        self._request_topics(now)
        return [Proven(sensor_id, is_signed=gate.session is not None)]

    def _announce(self, kind: TopicId, info: TopicInfo) -> list[Event]:
        known = self.incoming if kind in INCOMING else self.outgoing
        if known.get(info.topic_id) == (kind, info):
            return []
        if hash((kind, info)) in self._refused_topics:
            return []
        self.cost += TOPIC_COST
        self._announcements += 1
        if self._announcements > 20 * self.policy.max_topics:
            return [HangUp(f"{self._announcements} different topics")]
        reason = self.policy.refusal(kind, info)
        if reason is None and info.topic_id < 100:
            reason = f"topic id {info.topic_id} belongs to the protocol"
        if reason is None and len(self.incoming) + len(self.outgoing) >= self.policy.max_topics:
            reason = f"more than {self.policy.max_topics} topics"
        if reason is not None:
            return self._refuse(kind, info, reason)
        known[info.topic_id] = (kind, info)
        is_trigger = info.md5 == ESP_TRIGGER_MD5 or info.message_type in ESP_TRIGGER_TYPES
        if kind == TopicId.PUBLISHER and is_trigger:
            self._triggers.add(info.topic_id)
        elif kind in INCOMING:
            self._triggers.discard(info.topic_id)
        self._refused_ids.discard(info.topic_id)
        return [Announced(kind, info)]

    def _refuse(self, kind: TopicId, info: TopicInfo, reason: str) -> list[Event]:
        self._note_refused(info.topic_id)
        what = f"{kind.name.lower().replace('_', ' ')} {info.name[:100]!r} of type {info.message_type[:100]!r}"
        self._refused_topics.add(hash((kind, info)))
        return [Refused(what, reason)]

    def _note_refused(self, topic_id: int) -> None:
        if len(self._refused_ids) < 4 * self.policy.max_topics:
            self._refused_ids.add(topic_id)

    def _param(self, name: str) -> list[Event]:
        self.cost += TOPIC_COST
        if self.policy.may_read(name):
            return [ParamAsked(name)]
        return [Refused(f"parameter {name[:100]!r}", "not on the list of what it may know")]

    def _unknown(self, topic_id: int, now: float) -> list[Event]:
        """Handle a message before negotiation, as the sketch sends after a reconnect, or on a refused topic."""
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
            events.append(Garbled(data[:24], self.parser.fault))
        limit = self.policy.max_garbage
        if limit and self.parser.garbage_run > limit:
            events.append(HangUp(f"{self.parser.garbage_run} bytes without a frame in them"))
        return events
