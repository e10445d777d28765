"""What the fuzzers drive: each target makes traffic of a tape of bytes, feeds the real code and checks what holds.

The tape is a small program: most of it becomes valid frames with odd contents, so that it gets behind the checksums;
what it decides is what is sent, in which pieces, and when. Used by test_fuzz.py (hypothesis and the corpus of what was
found) and by benchmarks/fuzz_rosserial.py (millions of inputs).
"""

from rosbot_patrol.rosserial.device.client_session import Configured, DeviceSession, Message, NotTrusted, Unconfigured
from rosbot_patrol.rosserial.protocol import proof
from rosbot_patrol.rosserial.protocol.packet import OVERHEAD, Parser, checksum, encode
from rosbot_patrol.rosserial.protocol.topics import (
    ESP_TRIGGER_MD5,
    REQUEST_TOPICS,
    TX_STOP,
    ParamValues,
    TopicId,
    TopicInfo,
    pack_log,
    pack_time,
    pack_topic_info,
)
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
from rosbot_patrol.rosserial.server.policy import TRUSTED, Policy, parse_rules
from rosbot_patrol.rosserial.server.session import Session

KEY = bytes(range(32))
OTHER_KEY = bytes(range(1, 33))
NONCE = bytes(32)
DEVICE_NONCE = bytes(16)
ESP = TopicInfo(topic_id=125, name="motion_trigger", message_type="rosbot_patrol/EspTrigger", md5=ESP_TRIGGER_MD5)
POLICIES = (
    Policy(),
    TRUSTED,
    Policy(keys={2: KEY, 3: OTHER_KEY}),
    Policy(
        subscribe=parse_rules(["/led std_msgs/Bool"], ""),
        services=parse_rules(["* std_srvs/SetBool"], ""),
        parameters=("/name",),
        max_payload=96,
        max_topics=2,
        max_rate=20.0,
        max_garbage=200,
    ),
)
NAMES = ("motion_trigger", "/motion_trigger", "cmd_vel", "/led", "a b", "", "~x", "/name", "x" * 300)
TYPES = (
    "rosbot_patrol/EspTrigger",
    "rosbot_patrol_simulation/EspTrigger",
    "std_msgs/Bool",
    "std_srvs/SetBool",
    "*",
    "",
)
EVENTS = (Announced, Garbled, HangUp, LogLine, ParamAsked, Proven, Received, Refused, SyncLost, TimeAsked)


class Tape:
    """Bytes that decide; at its end it gives zeros."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def __bool__(self) -> bool:
        return self._at < len(self._data)

    def byte(self) -> int:
        self._at += 1
        return self._data[self._at - 1] if self._at <= len(self._data) else 0

    def take(self, size: int) -> bytes:
        self._at += size
        return self._data[self._at - size : self._at]

    def pick(self, choices):
        return choices[self.byte() % len(choices)]


def topic_info(tape: Tape) -> bytes:
    """A TopicInfo, often a good one, or a damaged one."""
    what = tape.byte()
    info = TopicInfo(
        topic_id=ESP.topic_id if what & 1 else tape.byte() | (tape.byte() & 1) << 8,
        name=ESP.name if what & 2 else tape.pick(NAMES),
        message_type=ESP.message_type if what & 4 else tape.pick(TYPES),
        md5=ESP.md5 if what & 8 else tape.take(tape.byte() % 40).decode("latin-1"),
        buffer_size=512 if what & 16 else tape.byte() - 100,
    )
    data = bytearray(pack_topic_info(info))
    if what & 192 == 192:
        data[tape.byte() % len(data)] = tape.byte()
    return bytes(data[: tape.byte()] if what & 32 else data)


def good_proof(tape: Tape, key: bytes) -> bytes:
    sensor_id = tape.pick((2, 3, 9))
    mac = proof.sensor_mac(key, NONCE, DEVICE_NONCE, sensor_id)
    return b"\x01" + bytes((sensor_id,)) + DEVICE_NONCE + mac


def piece(tape: Tape) -> bytes:
    """The next bytes that come over the line: a frame, a part of one, or anything else."""
    kind = tape.byte() % 14
    if kind == 0:
        return tape.take(tape.byte())
    if kind == 1:
        return encode(tape.byte() | tape.byte() << 8, tape.take(tape.byte()))
    if kind <= 3:
        return encode(tape.byte() % 6, topic_info(tape))
    if kind <= 5:
        return encode(ESP.topic_id, tape.take(tape.byte() % 4))
    if kind == 6:
        return encode(TopicId.TIME, pack_time(tape.byte(), 0)[: tape.byte() % 9])
    if kind == 7:
        return encode(TopicId.LOG, pack_log(tape.byte(), "hot")[: tape.byte() % 10])
    if kind == 8:
        name = tape.pick(NAMES).encode()
        return encode(TopicId.PARAMETER_REQUEST, len(name).to_bytes(4, "little") + name[: tape.byte()])
    if kind == 9:
        data = bytearray(good_proof(tape, tape.pick((KEY, OTHER_KEY))))
        if tape.byte() & 1:
            data[tape.byte() % len(data)] ^= tape.byte()
        return encode(TopicId.PROOF, bytes(data))
    if kind == 10:  # a header that promises more than comes
        length = bytes((tape.byte(), tape.byte()))
        return b"\xff\xfe" + length + bytes((checksum(length),)) + tape.take(tape.byte() % 32)
    if kind == 11:
        frame = bytearray(encode(tape.byte(), tape.take(tape.byte() % 16)))
        frame[tape.byte() % len(frame)] ^= tape.byte()
        return bytes(frame)
    if kind == 12:
        return tape.pick(
            (REQUEST_TOPICS, TX_STOP, encode(TopicId.CHALLENGE, b"\x01" + NONCE), b"\xff\xfe\xff", b"\xff")
        )
    return encode(ESP.topic_id, b"\x02\x01") * (tape.byte() % 64)


def check_frames(frames: list[bytes]) -> None:
    """What we send is whole frames, one by one."""
    for frame in frames:
        parser = Parser()
        assert len(parser.feed(frame)) == 1
        assert parser.garbage == parser.pending == 0


def parser(data: bytes) -> None:
    """Bytes are frames, garbage or pending; how they are cut does not matter; giving up ends."""
    tape = Tape(data)
    limit = tape.pick((64, 512, 0x7FFF))
    whole, cut = Parser(limit), Parser(limit)
    fed = frames = 0
    while tape:
        stream = piece(tape)
        size = tape.byte() % 16 + 1
        packets = whole.feed(stream)
        assert packets == [p for at in range(0, len(stream), size) for p in cut.feed(stream[at : at + size])]
        assert whole.pending == cut.pending < limit + OVERHEAD
        if tape.byte() & 7 == 0:
            packets += whole.give_up()
            cut.give_up()
        fed += len(stream)
        frames += sum(OVERHEAD + len(packet.data) for packet in packets)
        assert frames + whole.garbage + whole.pending == fed
    while whole.pending:
        before = whole.pending
        whole.give_up()
        assert whole.pending < before


def server(data: bytes) -> None:
    """Nothing crashes a session, and nothing comes through that the policy forbids."""
    tape = Tape(data)
    policy = tape.pick(POLICIES)
    session = Session(policy, 0.0, silence_timeout=tape.pick((15.0, None)), nonce=NONCE)
    now, proven, fed = 0.0, None if policy.keys else -1, 0
    while tape:
        stream = b"".join(piece(tape) for _ in range(tape.byte() % 3 + 1))
        fed += len(stream)
        now += tape.byte() / 16
        events = session.receive(stream, now) + session.tick(now)
        for event in events:
            proven = check_event(session, policy, event, proven)
        assert session.pause(now) >= 0.0
        frames = session.take_output()
        assert len(frames) <= len(events) + 3
        check_frames(frames)
        assert session.parser.pending < policy.max_payload + OVERHEAD
        assert len(session.incoming) + len(session.outgoing) <= policy.max_topics
        assert len(session._refused_ids) <= 4 * policy.max_topics
        assert session.parser.garbage <= fed
        if any(isinstance(event, HangUp) for event in events):
            return


def check_event(session: Session, policy: Policy, event: Event, proven: int | None) -> int | None:
    """Whether the policy allows it; -1 stands for "any sensor", None for "not proven"; answers what is asked."""
    assert isinstance(event, EVENTS)
    if isinstance(event, Proven):
        assert proven is None
        assert policy.keys[event.sensor_id]
        return event.sensor_id
    if proven is None:
        assert isinstance(event, (HangUp, Garbled, Refused)), event
    if isinstance(event, (Announced, Received)):
        assert policy.refusal(event.kind, event.info) is None
        assert event.info.topic_id >= 100
    if isinstance(event, Received):
        assert len(event.data) <= policy.max_payload
        if proven != -1 and event.info.md5 == ESP_TRIGGER_MD5 and event.data:
            assert event.data[0] == proven
    if isinstance(event, ParamAsked):
        assert not policy.restricted or event.name in policy.parameters
        session.answer_param(ParamValues(ints=(1,)))
    if isinstance(event, TimeAsked):
        session.answer_time(1, 2)
    if isinstance(event, Announced) and event.info.topic_id % 5 == 0 and event.info != ESP:
        session.reject(event.kind, event.info)
    return proven


def device(data: bytes) -> None:
    """Nothing crashes a device's session, and one that insists tells nothing to a bridge without the key."""
    tape = Tape(data)
    prover = proof.Prover(2, KEY, proof.VERSION) if tape.byte() & 1 else None
    insist = prover is not None and tape.byte() & 1 == 1
    led = TopicInfo(topic_id=100, name="led", message_type="std_msgs/Bool", md5="x")
    session = DeviceSession([ESP], [led], prover=prover, insist=insist)
    now, fed, told = 0.0, 0, 0
    while tape:
        stream = piece(tape)
        fed += len(stream)
        now += tape.byte() / 16
        events = session.receive(stream, now) + session.tick(now)
        for event in events:
            assert isinstance(event, (Configured, Message, NotTrusted, Unconfigured))
            assert not (insist and isinstance(event, (Configured, Message)))  # the tape cannot make the bridge's proof
        frames = session.take_output()
        check_frames(frames)
        told += sum(map(len, frames)) - 16  # a request for the time may be due
        assert told <= 64 * fed
        assert session.publish(125, b"\x02\x01") == session.configured
        check_frames(session.take_output())


def both(data: bytes) -> None:
    """A device and the server with noise between them: when the noise ends, a trigger comes through within 15 s."""
    tape = Tape(data)
    keyed = tape.byte() & 1
    policy = Policy(keys={2: KEY}) if keyed else Policy()
    now, ends = 0.0, connect(policy, 0.0)
    while tape:
        now += tape.byte() / 32
        if exchange(ends, now, tape):
            ends = connect(policy, now)
    for _ in range(60):
        now += 0.25
        if exchange(ends, now, None):
            ends = connect(policy, now)
        server_end, device_end = ends
        if device_end.publish(125, b"\x02\x01"):
            heard = server_end.receive(b"".join(device_end.take_output()), now)
            answer(server_end, heard)
            if any(isinstance(event, Received) and event.data == b"\x02\x01" for event in heard):
                return
    raise AssertionError("no trigger came through after the noise")


def connect(policy: Policy, now: float) -> tuple[Session, DeviceSession]:
    return Session(policy, now, nonce=NONCE), DeviceSession([ESP], prover=proof.Prover(2, KEY, proof.VERSION))


def answer(session: Session, events: list[Event]) -> None:
    for event in events:
        if isinstance(event, TimeAsked):
            session.answer_time(1, 2)


def exchange(ends: tuple[Session, DeviceSession], now: float, tape: Tape | None) -> bool:
    """Both ends send what they have, through the noise of a tape; whether the connection ends."""
    server_end, device_end = ends
    events = server_end.tick(now)
    if stream := noisy(b"".join(device_end.take_output()), tape):
        events += server_end.receive(stream, now)
    answer(server_end, events)
    told = device_end.tick(now)
    if stream := noisy(b"".join(server_end.take_output()), tape):
        told += device_end.receive(stream, now)
    return any(isinstance(event, (HangUp, NotTrusted)) for event in [*events, *told])


def noisy(stream: bytes, tape: Tape | None) -> bytes:
    if tape is None:
        return stream
    kind = tape.byte() % 6
    if kind == 0:
        return stream[: tape.byte()]
    if kind == 1:
        return stream + tape.take(tape.byte() % 32)
    if kind == 2 and stream:
        damaged = bytearray(stream)
        damaged[tape.byte() % len(stream)] ^= tape.byte()
        return bytes(damaged)
    if kind == 3:  # cut off and run into the next one
        return stream[: tape.byte()] + stream[tape.byte() :]
    return stream


TARGETS = (parser, server, device, both)


def run_one(data: bytes) -> None:
    """The first byte chooses the target, so that one corpus serves all."""
    TARGETS[data[0] % len(TARGETS)](data[1:]) if data else None
