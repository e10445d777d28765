"""Signed frames: both directions, and what somebody in between may try."""

from __future__ import annotations

import random

import pytest

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.device.client_session import Configured, DeviceSession, NotTrusted
from rosbot_patrol.rosserial.device.tcp_client import _TOPIC as ESP
from rosbot_patrol.rosserial.device.tcp_client import PUBLISHER_ID
from rosbot_patrol.rosserial.protocol.packet import Parser, encode
from rosbot_patrol.rosserial.protocol.proof import VERSION, Prover
from rosbot_patrol.rosserial.protocol.signed import FROM_BRIDGE, FROM_SENSOR, OVERHEAD, Checker, Signer, session_key
from rosbot_patrol.rosserial.protocol.topics import TopicId, pack_esp_trigger
from rosbot_patrol.rosserial.server.events import HangUp, Proven, Received
from rosbot_patrol.rosserial.server.policy import Policy
from rosbot_patrol.rosserial.server.session import Session

KEY = bytes(range(32))
SESSION = session_key(KEY, bytes(32), bytes(16), 2)
MOTION, CALM = pack_esp_trigger(2, True), pack_esp_trigger(2, False)


class Line:
    """A bridge and a sensor, and somebody who sees every frame between them.

    Attributes:
        up, down: what is done with a list of frames from the sensor, and from the bridge.
        heard: events of the bridge; said: events of the sensor.
    """

    def __init__(self, version: bytes | None = None) -> None:
        self.bridge = Session(Policy(keys={2: KEY, 3: KEY[::-1]}), 0.0)
        prover = Prover(2, KEY) if version is None else Prover(2, KEY, version)
        self.sensor = DeviceSession([ESP], prover=prover, insist=True)
        self.up = self.down = lambda frames: frames
        self.heard, self.said, self.seen = [], [], []
        self.now = 0.0

    def run(self, rounds: int = 6) -> None:
        for _ in range(rounds):
            self.now += 0.1
            for frame in self.down([self.bridge.sign(each) for each in self.bridge.take_output()]):
                self.said += self.sensor.receive(frame, self.now)
            sent = self.sensor.take_output()
            self.seen += sent
            for frame in self.up(sent):
                self.heard += self.bridge.receive(frame, self.now)

    def say(self, data: bytes) -> None:
        assert self.sensor.publish(PUBLISHER_ID, data)
        self.run(1)

    def believed(self) -> list[bytes]:
        return [event.data for event in self.heard if isinstance(event, Received)]

    def hung_up(self) -> str:
        return next((event.reason for event in self.heard if isinstance(event, HangUp)), "")


@pytest.fixture
def line() -> Line:
    made = Line()
    made.run()
    assert Proven(2, is_signed=True) in made.heard
    assert Configured() in made.said
    return made


def test_a_signed_sensor_is_heard_and_answered(line: Line) -> None:
    line.say(MOTION)
    line.say(CALM)
    assert line.believed() == [MOTION, CALM]
    assert line.sensor.request_receipt(line.now) == 2
    line.run(1)
    line.bridge.answer_time(12, 0)
    line.run(2)
    assert line.sensor.server_time(line.now) == pytest.approx(12.0, abs=0.5)
    assert line.seen[-1].hex().startswith("fffe")


def test_what_is_added_is_not_believed(line: Line) -> None:
    forged = encode(PUBLISHER_ID, MOTION + bytes(4) + bytes(8))
    for frame in (forged, encode(PUBLISHER_ID, MOTION)):
        other = Line()
        other.run()
        other.heard += other.bridge.receive(frame, other.now)
        assert other.believed() == []
        assert "somebody in between has changed" in other.hung_up()
        other.sensor.publish(PUBLISHER_ID, CALM)  # nothing is believed on this connection any more
        other.run(1)
        assert other.believed() == []


def test_what_is_sent_again_is_not_believed(line: Line) -> None:
    line.say(MOTION)
    line.heard += line.bridge.receive(line.seen[-1], line.now)
    assert line.believed() == [MOTION]
    assert "came again" in line.hung_up()


def test_what_was_overheard_on_another_connection_is_not_believed(line: Line) -> None:
    line.say(MOTION)
    other = Line()
    other.run()
    other.heard += other.bridge.receive(line.seen[-1], other.now)
    assert other.believed() == []


def test_frames_in_another_order_are_noticed(line: Line) -> None:
    line.sensor.publish(PUBLISHER_ID, CALM)
    line.sensor.publish(PUBLISHER_ID, MOTION)
    line.up = lambda frames: frames[::-1]
    line.run(1)
    assert line.believed() == []
    assert "came instead" in line.hung_up()


def test_a_frame_that_is_kept_back_is_noticed_at_the_next(line: Line) -> None:
    line.up = lambda frames: []
    line.say(MOTION)
    line.up = lambda frames: frames
    line.say(CALM)
    assert line.believed() == []
    assert "came instead" in line.hung_up()


def test_a_changed_frame_is_noticed(line: Line) -> None:
    def change(frames: list[bytes]) -> list[bytes]:
        return [encode(PUBLISHER_ID, CALM + frame[9:-1]) for frame in frames]

    line.up = change
    line.say(MOTION)
    assert line.believed() == []
    assert line.hung_up()


def test_the_bridge_is_protected_in_the_other_direction(line: Line) -> None:
    said = line.sensor.receive(encode(TopicId.TX_STOP, b""), line.now)
    assert isinstance(said[0], NotTrusted)
    assert "changed what the bridge says" in said[0].reason
    again = line.sensor.receive(encode(TopicId.CHALLENGE, VERSION + bytes(32)), line.now)
    assert isinstance(again[0], NotTrusted)


def test_older_firmware_speaks_without() -> None:
    line = Line(VERSION)
    line.run()
    assert Proven(2, is_signed=False) in line.heard
    line.say(MOTION)
    assert line.believed() == [MOTION]


def test_a_proof_is_of_one_version_alone() -> None:
    """Nobody in between makes an unsigned session of a signed one."""
    line = Line()
    line.up = lambda frames: [encode(TopicId.PROOF, VERSION + frame[8:-1]) for frame in frames]
    line.run()
    assert "a wrong proof for sensor 2" in line.hung_up()


def test_forged_frames_by_the_thousand_are_never_believed() -> None:
    rng = random.Random(53)
    checker, signer = Checker(SESSION, FROM_SENSOR), Signer(SESSION, FROM_SENSOR)
    good = Parser().feed(signer.sign(encode(PUBLISHER_ID, MOTION)))[0]
    for _ in range(20_000):
        payload = bytearray(good.data)
        for _ in range(rng.randint(1, 4)):
            payload[rng.randrange(len(payload))] ^= 1 << rng.randrange(8)
        if bytes(payload) == good.data:
            continue
        with pytest.raises(ProtocolError):
            checker.check(PUBLISHER_ID, bytes(payload))
    assert checker.check(PUBLISHER_ID, good.data) == MOTION


def test_directions_and_topics_have_signatures_of_their_own() -> None:
    frame = Parser().feed(Signer(SESSION, FROM_SENSOR).sign(encode(PUBLISHER_ID, MOTION)))[0]
    assert len(frame.data) == 2 + OVERHEAD
    for checker, topic in ((Checker(SESSION, FROM_BRIDGE), PUBLISHER_ID), (Checker(SESSION, FROM_SENSOR), 126)):
        with pytest.raises(ProtocolError, match="its signature is wrong"):
            checker.check(topic, frame.data)
    for short in (b"", MOTION, bytes(OVERHEAD - 1)):
        with pytest.raises(ProtocolError):
            Checker(SESSION, FROM_SENSOR).check(PUBLISHER_ID, short)
