"""The lists: who may say what, in which direction, and for which sensor."""

import pytest

from rosbot_patrol.errors import ParamError
from rosbot_patrol.rosserial.protocol.packet import encode
from rosbot_patrol.rosserial.protocol.proof import VERSION, Prover
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5, TopicId, TopicInfo, pack_topic_info
from rosbot_patrol.rosserial.server.events import Announced, HangUp, Received, Refused
from rosbot_patrol.rosserial.server.policy import TRUSTED, Policy, parse_networks, parse_rules, parse_sensors
from rosbot_patrol.rosserial.server.session import Session
from rosbot_patrol.rosserial.server.settings import SerialNodeParams

ESP = TopicInfo(topic_id=125, name="motion_trigger", message_type="rosbot_patrol/EspTrigger", md5=ESP_TRIGGER_MD5)
ANNOUNCE = encode(TopicId.PUBLISHER, pack_topic_info(ESP))


def service(kind, name="/horn", message_type="std_srvs/SetBool"):
    return kind, TopicInfo(topic_id=130, name=name, message_type=message_type, md5="x")


def test_the_rule_of_the_smallest_network_counts():
    rules = parse_sensors(["192.168.1.12 2", "192.168.1.0/24 1 3-5", "fc94::/16 *", "192.168.1.12 9"], "")
    policy = Policy(sensors=rules)
    assert policy.sensor_ids("192.168.1.12") == {2, 9}
    assert policy.sensor_ids("192.168.1.13") == {1, 3, 4, 5}
    assert policy.sensor_ids("fc94:1::2%wlan0") is None
    assert policy.sensor_ids("10.0.0.1") == frozenset()
    assert policy.sensor_ids("/dev/ttyUSB0") is None
    assert Policy().sensor_ids("10.0.0.1") is None


@pytest.mark.parametrize(
    "text", ["", "192.168.1.12", "192.168.1.12 256", "192.168.1.12 5-3", "192.168.1.12 x", "192.168.1.12 * 3", "here 2"]
)
def test_bad_rule_of_sensors_names_its_parameter(text):
    with pytest.raises(ParamError, match=r"^~allow_sensors: expected "):
        parse_sensors([text], "~allow_sensors")


def test_a_peer_speaks_for_its_own_sensor_only():
    policy = Policy(sensors=parse_sensors(["10.0.0.2 2", "10.0.0.7 7"], ""))
    it = Session(policy, 0.0, address="10.0.0.2")
    good, seventh = encode(125, b"\x02\x01"), encode(125, b"\x07\x01")
    assert it.receive(ANNOUNCE + good + seventh + good, 0.1) == [
        Announced(TopicId.PUBLISHER, ESP),
        Received(TopicId.PUBLISHER, ESP, b"\x02\x01"),
        Refused("what it says for sensor 7", "the list has it as another sensor, or as none (~allow_sensors)"),
        Received(TopicId.PUBLISHER, ESP, b"\x02\x01"),
    ]
    again = TopicInfo(topic_id=126, name="/motion_trigger", message_type=ESP.message_type, md5="0" * 32)
    it.receive(encode(TopicId.PUBLISHER, pack_topic_info(again)), 0.2)
    (event,) = it.receive(encode(126, b"\x07\x01"), 0.3)  # a wrong checksum does not make it another message
    assert isinstance(event, Refused)
    unlisted = Session(policy, 0.0, address="10.0.0.9")
    events = unlisted.receive(ANNOUNCE + good, 0.1)
    assert isinstance(events[1], Refused)


def test_the_list_holds_for_who_has_a_key_too():
    policy = Policy(keys={2: bytes(range(32))}, sensors=parse_sensors(["10.0.0.2 2"], ""))
    proof = Prover(2, bytes(range(32)), VERSION).answer(b"\x01" + bytes(32))
    elsewhere = Session(policy, 0.0, address="10.0.0.9", nonce=bytes(32))
    (event,) = elsewhere.receive(proof, 0.1)
    assert isinstance(event, HangUp)
    assert "the list has it elsewhere" in event.reason
    assert elsewhere.proven_id is None


def test_services_have_a_direction():
    rules = parse_rules(["offer /horn std_srvs/SetBool", "call /lamp *", "/both *"], "", verbs=("offer", "call"))
    policy = Policy(services=rules)
    offers, calls = TopicId.SERVICE_SERVER_PUBLISHER, TopicId.SERVICE_CLIENT_SUBSCRIBER
    assert policy.refusal(*service(offers)) is None
    assert policy.refusal(*service(calls)) == "not on the list of what it may call as a service"
    assert policy.refusal(*service(calls, "/lamp")) is None
    assert policy.refusal(*service(offers, "/lamp")) == "not on the list of what it may offer as a service"
    assert policy.refusal(*service(offers, "/both")) is policy.refusal(*service(calls, "/both")) is None
    with pytest.raises(ParamError, match=r"expected '\[offer\|call\] TOPIC PACKAGE/TYPE', got 'give /a b/C'"):
        parse_rules(["give /a b/C"], "~allow_services", verbs=("offer", "call"))


@pytest.mark.parametrize("name", ["cmd_vel\n", "", "1st", "a" * 300, "a b", "\x1b[31m", "//a", "ä"])
def test_names_that_ros_does_not_allow_are_refused_even_where_nothing_is_restricted(name):
    info = TopicInfo(topic_id=130, name=name, message_type="std_msgs/Bool", md5="x")
    assert TRUSTED.refusal(TopicId.PUBLISHER, info) == "the name or the type is none that ROS allows"
    assert Policy(publish=parse_rules(["* *"], "")).refusal(TopicId.PUBLISHER, info)


def test_peers():
    policy = Policy(peers=parse_networks(["192.168.1.0/24", "fc94::/16"], ""))
    assert policy.may_connect("192.168.1.200")
    assert policy.may_connect("fc94::1")
    assert not policy.may_connect("192.168.2.1")
    assert not policy.may_connect("fe80::1%eth0")


def test_a_device_that_is_asked_again_is_not_refused_again():
    it = Session(Policy(), 0.0)
    wrong = encode(0, pack_topic_info(TopicInfo(topic_id=126, name="cmd_vel", message_type="a/B", md5="x")))
    assert len(it.receive(wrong, 0.1)) == 1
    assert it.receive(wrong * 1000, 0.2) == []


def test_slow_bytes_end_the_connection():
    it = Session(Policy(), 0.0)
    events = []
    for number, byte in enumerate(encode(125, bytes(500))):
        now = 0.9 * number
        events += it.receive(bytes((byte,)), now) + it.tick(now + 0.1)
        if any(isinstance(event, HangUp) for event in events):
            break
    assert HangUp("a frame that does not end within 5 s", is_refusal=True) in events
    assert now < 6.5
    honest = Session(Policy(), 0.0)
    for number in range(100):  # each frame begins in the piece of data that ends the one before it
        honest.receive(encode(10, bytes(8))[8:] + encode(10, bytes(8))[:8], number * 0.5)
        assert not any(isinstance(event, HangUp) for event in honest.tick(number * 0.5 + 0.1))


def test_slow_bytes_on_a_serial_device_are_a_slow_device():
    it = Session(TRUSTED, 0.0, silence_timeout=None)
    for number, byte in enumerate(encode(125, bytes(500))):
        it.receive(bytes((byte,)), 0.9 * number)
        assert not any(isinstance(event, HangUp) for event in it.tick(0.9 * number + 0.1))


def test_garbage_and_topics_cost_as_frames_do():
    it = Session(Policy(max_rate=100.0, max_garbage=0), 0.0)
    it.receive(bytes(32 * 300), 0.0)
    assert 1.9 < it.pause(0.0) < 2.1
    it = Session(Policy(max_rate=100.0), 0.0)
    for number in range(30):
        info = TopicInfo(topic_id=200 + number, name=f"t{number}", message_type="a/B", md5="x")
        it.receive(encode(0, pack_topic_info(info)), 0.0)
    assert 2.2 < it.pause(0.0) < 2.4


def test_limits_of_the_node():
    params = SerialNodeParams(port="tcp", allow_sensors=("::1 3",), max_topics=3, max_clients=50)
    policy = params.policy("~")
    assert policy.sensor_ids("::1") == {3}
    assert policy.max_topics == 3
    assert (params.limits.clients, params.limits.per_address, params.limits.strangers) == (50, 64, 32)
