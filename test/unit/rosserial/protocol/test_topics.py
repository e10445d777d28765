import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.errors import ParamError, ProtocolError
from rosbot_patrol.rosserial.protocol import topics
from rosbot_patrol.rosserial.protocol.topics import ParamValues, TopicId, TopicInfo
from rosbot_patrol.rosserial.server.complaints import Complaints
from rosbot_patrol.rosserial.server.policy import TRUSTED, Policy, Rule, parse_networks, parse_rules
from rosbot_patrol.rosserial.server.settings import SerialNodeParams


def info(name="motion_trigger", message_type="rosbot_patrol/EspTrigger", topic_id=125):
    return TopicInfo(topic_id=topic_id, name=name, message_type=message_type, md5=topics.ESP_TRIGGER_MD5)


def test_topic_info_round_trip():
    assert topics.unpack_topic_info(topics.pack_topic_info(info())) == info()


@given(data=st.binary(max_size=64))
def test_no_bytes_crash_a_reader(data):
    for reader in (
        topics.unpack_topic_info,
        topics.unpack_time,
        topics.unpack_log,
        topics.unpack_param_request,
        topics.unpack_esp_trigger,
    ):
        with contextlib.suppress(ProtocolError):
            reader(data)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (True, ParamValues(ints=(1,))),
        (7, ParamValues(ints=(7,))),
        (0.5, ParamValues(floats=(0.5,))),
        ("a", ParamValues(strings=("a",))),
        ([1, 2], ParamValues(ints=(1, 2))),
        (["a", "b"], ParamValues(strings=("a", "b"))),
    ],
)
def test_param_values(value, expected):
    assert topics.param_values(value) == expected


@pytest.mark.parametrize("value", [{"a": 1}, [1, "a"], 2**31, None])
def test_param_values_refused(value):
    with pytest.raises(ProtocolError):
        topics.param_values(value)


def test_param_answer_bytes():
    expected = bytes.fromhex("01000000 05000000 00000000 01000000 02000000 6869")
    assert topics.pack_param_values(ParamValues(ints=(5,), strings=("hi",))) == expected


def test_default_policy_lets_motion_triggers_through_and_nothing_else():
    policy = Policy()
    assert policy.refusal(TopicId.PUBLISHER, info()) is None
    assert policy.refusal(TopicId.PUBLISHER, info("/motion_trigger", "rosbot_patrol_simulation/EspTrigger")) is None
    assert "may publish" in policy.refusal(TopicId.PUBLISHER, info("cmd_vel", "geometry_msgs/Twist"))
    assert "may publish" in policy.refusal(TopicId.PUBLISHER, info("motion_trigger", "std_msgs/Bool"))
    assert "subscribe" in policy.refusal(TopicId.SUBSCRIBER, info())
    assert "service" in policy.refusal(TopicId.SERVICE_CLIENT_PUBLISHER, info())
    assert not policy.may_read("/secret")


def test_trusted_wire_may_all_but_nonsense():
    assert TRUSTED.refusal(TopicId.SUBSCRIBER, info("cmd_vel", "geometry_msgs/Twist")) is None
    assert TRUSTED.refusal(TopicId.PUBLISHER, info("a b", "geometry_msgs/Twist")) is not None
    assert TRUSTED.refusal(TopicId.PUBLISHER, info("a", "os")) is not None
    assert TRUSTED.may_read("/anything")


def test_rules_and_networks():
    assert parse_rules(["/a std_msgs/Bool"], "x") == (Rule("/a", "std_msgs/Bool"),)
    with pytest.raises(ParamError, match="~allow_publish: expected 'TOPIC PACKAGE/TYPE', got 'motion'"):
        parse_rules(["motion"], "~allow_publish")
    policy = Policy(peers=parse_networks(["192.168.1.0/24", "fc94::/16"], "x"))
    assert policy.may_connect("192.168.1.9")
    assert policy.may_connect("fc94::7%eth0")
    assert not policy.may_connect("10.0.0.1")
    with pytest.raises(ParamError, match=r"allow_peers: expected an address or a network, got 'home'"):
        parse_networks(["home"], "allow_peers")


def test_settings_restrict_tcp_only():
    assert SerialNodeParams(port="tcp").policy("~").restricted
    assert not SerialNodeParams(port="/dev/ttyS1").policy("~").restricted
    assert SerialNodeParams(port="/dev/ttyS1", restrict="always").policy("~").restricted
    assert SerialNodeParams(tcp_port=5, tcp_ports=(5, 6)).all_tcp_ports == (5, 6)


def test_complaints_are_said_once_and_bounded():
    complaints = Complaints(period=10.0, capacity=2)
    assert complaints.is_new("a", 0.0)
    assert not complaints.is_new("a", 9.0)
    assert complaints.is_new("a", 10.5)
    assert complaints.is_new("b", 11.0)
    assert complaints.is_new("c", 11.0)
    assert complaints.is_new("a", 11.0)  # forgotten
    assert [complaints.may_speak("x", t, limit=2) for t in (0.0, 1.0, 2.0, 61.0)] == [True, True, False, True]
