"""The pre-shared key: both sides' frames against openssl's figures, and whatever is no proof."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.rosserial.device.client_session import Configured, DeviceSession, NotTrusted
from rosbot_patrol.rosserial.protocol.packet import Parser, encode
from rosbot_patrol.rosserial.protocol.proof import VERSION, Gate, Prover
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5, REQUEST_TOPICS, TopicId, TopicInfo, pack_topic_info
from rosbot_patrol.rosserial.server.events import Announced, HangUp, Proven, Received, Refused
from rosbot_patrol.rosserial.server.policy import Policy
from rosbot_patrol.rosserial.server.session import Session

KEY, OTHER = bytes(range(32)), bytes(range(1, 33))
SERVER_NONCE, DEVICE_NONCE = bytes(range(32, 64)), bytes(range(64, 80))
# openssl dgst -sha256 -mac HMAC -macopt hexkey:0001..1f, over label, nonces and the byte 02
SENSOR_MAC = "593d14a6917cbcff4cb548b9a69fe6ee5612c4efc1b3171f34e10161b2e61a9e"
BRIDGE_MAC = "dd99c4ea0d473fad7a3d6bda044f9e086be702a9e45e24611a100852422cd78e"

POLICY = Policy(keys={2: KEY, 3: OTHER})
ESP = TopicInfo(topic_id=125, name="motion_trigger", message_type="rosbot_patrol/EspTrigger", md5=ESP_TRIGGER_MD5)
ANNOUNCE = encode(TopicId.PUBLISHER, pack_topic_info(ESP))
PROOF = encode(TopicId.PROOF, b"\x01\x02" + DEVICE_NONCE + bytes.fromhex(SENSOR_MAC))


def keyed(nonce=SERVER_NONCE, policy=POLICY):
    return Session(policy, 0.0, nonce=nonce)


def test_frames_of_both_sides_are_those_of_openssl():
    gate, prover = Gate(POLICY.keys, SERVER_NONCE), Prover(2, KEY, VERSION)
    assert gate.challenge == encode(8, b"\x01" + SERVER_NONCE)
    assert prover.answer(b"\x01" + SERVER_NONCE, DEVICE_NONCE) == PROOF
    assert len(PROOF) == 8 + 50
    sensor_id, answer = gate.check(Parser().feed(PROOF)[0].data)
    assert (sensor_id, answer) == (2, encode(9, b"\x01" + bytes.fromhex(BRIDGE_MAC)))
    assert prover.confirms(Parser().feed(answer)[0].data)


def test_a_good_proof_opens_the_way_for_that_sensor_only():
    it = keyed()
    assert it.take_output() == [encode(TopicId.CHALLENGE, b"\x01" + SERVER_NONCE)]
    assert it.receive(PROOF, 0.1) == [Proven(2)]
    assert it.take_output() == [encode(TopicId.PROOF, b"\x01" + bytes.fromhex(BRIDGE_MAC)), REQUEST_TOPICS]
    assert it.receive(ANNOUNCE, 0.2) == [Announced(TopicId.PUBLISHER, ESP)]
    assert it.receive(encode(125, b"\x02\x01"), 0.3) == [Received(TopicId.PUBLISHER, ESP, b"\x02\x01")]
    (event,) = it.receive(encode(125, b"\x07\x01"), 0.4)
    assert event == Refused("what it says for sensor 7", "it has proved to be sensor 2")


def test_nothing_is_told_before_the_proof():
    it = keyed()
    it.take_output()
    frames = encode(TopicId.TIME, bytes(8)) + encode(TopicId.PARAMETER_REQUEST, b"\x01\0\0\0a") + encode(7, b"\x04")
    assert it.receive(ANNOUNCE[:60] + frames + encode(125, b"\x02\x01"), 0.1)  # what is no frame is told of
    assert it.tick(4.9) == []
    assert it.take_output() == []
    assert not it.configured


@pytest.mark.parametrize(
    ("proof", "reason"),
    [
        (encode(9, b"\x01\x02" + DEVICE_NONCE + bytes(32)), "a wrong proof for sensor 2"),
        (Prover(2, OTHER).answer(b"\x01" + SERVER_NONCE), "a wrong proof for sensor 2"),
        (Prover(3, KEY).answer(b"\x01" + SERVER_NONCE), "a wrong proof for sensor 3"),
        (Prover(2, KEY).answer(b"\x01" + bytes(32)), "a wrong proof for sensor 2"),
        (Prover(7, KEY).answer(b"\x01" + SERVER_NONCE), "sensor 7, which has no key here"),
        (Prover(7, bytes(32)).answer(b"\x01" + SERVER_NONCE), "sensor 7, which has no key here"),
        (encode(9, b"\x03" + PROOF[8:-1]), "no proof of version 1"),
        (encode(9, b""), "0 bytes that are no proof"),
        (encode(9, PROOF[7:-2]), "49 bytes that are no proof"),
        (encode(9, b"\x01" + bytes.fromhex(BRIDGE_MAC)), "33 bytes that are no proof"),
    ],
    ids=itertools.count(),  # a proof holds random bytes
)
def test_what_proves_nothing_ends_the_connection(proof, reason):
    it = keyed()
    it.take_output()
    first, *more = it.receive(proof + PROOF, 0.1)
    assert isinstance(first, HangUp)
    assert first.is_refusal
    assert reason in first.reason
    assert more == []  # there is no second try on one connection
    assert it.take_output() == []


def test_an_overheard_proof_is_worth_nothing_on_another_connection():
    first, second = Session(POLICY, 0.0), Session(POLICY, 0.0)
    challenges = [Parser().feed(it.take_output()[0])[0].data for it in (first, second)]
    assert challenges[0] != challenges[1]
    proof = Prover(2, KEY).answer(challenges[0])
    assert first.receive(proof, 0.1) == [Proven(2, is_signed=True)]
    (event,) = second.receive(proof, 0.1)
    assert isinstance(event, HangUp)


def test_who_does_not_answer_or_talks_too_much_is_hung_up_on():
    (event,) = keyed().tick(5.1)
    assert isinstance(event, HangUp)
    assert "no proof within 5 s" in event.reason
    it = keyed()
    events = [event for i in range(50) for event in it.receive(encode(125, bytes(64)) * 2, 0.01 * i)]
    assert [type(event) for event in events][:1] == [HangUp]
    long = keyed()
    long.receive(encode(125, bytes(65)), 0.1)  # longer than what is read before the proof
    assert long.parser.oversized == 1


@given(data=st.binary(max_size=120), at=st.integers(0, len(PROOF) - 1), value=st.integers(0, 255))
def test_no_bytes_prove_anything_by_chance(data, at, value):
    changed = bytearray(PROOF)
    changed[at] = value
    it = keyed()
    events = it.receive(data + encode(9, data), 0.1)
    assert not any(isinstance(event, Proven) for event in events)
    if bytes(changed) != PROOF:
        assert not any(isinstance(event, Proven) for event in keyed().receive(bytes(changed), 0.1))


def talk(server, device):
    """Carry frames to and fro until there are no more; return the events of both."""
    of_server, of_device = [], []
    for now in (0.1, 0.2, 0.3, 0.4):
        of_device += device.receive(b"".join(map(server.sign, server.take_output())), now)
        of_server += server.receive(b"".join(device.take_output()), now)
    return of_server, of_device


def test_device_with_a_key_and_bridge_with_keys():
    server, device = keyed(), DeviceSession([ESP], prover=Prover(2, KEY), insist=True)
    of_server, of_device = talk(server, device)
    assert of_server[0] == Proven(2, is_signed=True)
    assert of_device == [Configured()]
    assert server.configured
    assert device.closed() == []


def test_device_with_a_key_before_a_bridge_without():
    _, heard = talk(Session(Policy(), 0.0), DeviceSession([ESP], prover=Prover(2, KEY)))
    assert heard == [Configured()]
    _, heard = talk(Session(Policy(), 0.0), DeviceSession([ESP], prover=Prover(2, KEY), insist=True))
    assert heard == [NotTrusted("the bridge did not show that it has this sensor's key")]


def test_device_that_does_not_fit_to_the_bridge_says_so():
    _, (event,) = talk(keyed(), DeviceSession([ESP]))
    assert event == NotTrusted("the bridge asks for a key, and this sensor has none")
    device = DeviceSession([ESP], prover=Prover(2, OTHER))
    talk(keyed(), device)
    (event,) = device.closed()
    assert "did not take the proof" in event.reason
    (event,) = DeviceSession([ESP], prover=Prover(2, KEY)).receive(encode(TopicId.CHALLENGE, b"\x02"), 0.1)
    assert "no challenge of version 1" in event.reason


def test_false_bridge_is_found_out():
    device = DeviceSession([ESP], prover=Prover(2, KEY), insist=True)
    device.receive(encode(TopicId.CHALLENGE, b"\x01" + SERVER_NONCE), 0.1)
    overheard = b"\x01" + bytes.fromhex(BRIDGE_MAC)  # for another device nonce
    assert device.receive(encode(TopicId.PROOF, overheard), 0.2) == [
        NotTrusted("the bridge does not have this sensor's key")
    ]
    (event, *_) = device.receive(REQUEST_TOPICS, 0.3)
    assert isinstance(event, NotTrusted)
    assert not device.configured


def test_a_device_needs_a_whole_key():
    with pytest.raises(ValueError, match="a key has 32 bytes, not 16"):
        Prover(2, bytes(16))
    with pytest.raises(ValueError, match="without a key cannot insist"):
        DeviceSession([ESP], insist=True)
