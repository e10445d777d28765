from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.rosserial.device.client_session import Configured, DeviceSession, Message, Unconfigured
from rosbot_patrol.rosserial.protocol.packet import Parser, encode
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
from rosbot_patrol.rosserial.server.policy import TRUSTED, Policy
from rosbot_patrol.rosserial.server.session import (
    Announced,
    Garbled,
    HangUp,
    LogLine,
    ParamAsked,
    Received,
    Refused,
    Session,
    SyncLost,
    TimeAsked,
)

ESP = TopicInfo(topic_id=125, name="motion_trigger", message_type="rosbot_patrol/EspTrigger", md5=ESP_TRIGGER_MD5)
TRIGGER = encode(125, b"\x02\x01")


def announce(info=ESP, kind=TopicId.PUBLISHER):
    return encode(kind, pack_topic_info(info))


def topic(name, message_type="std_msgs/Bool", topic_id=126):
    return TopicInfo(topic_id=topic_id, name=name, message_type=message_type, md5="x")


def session(policy=None, **options):
    return Session(policy or Policy(), 0.0, **options)


def test_topics_are_asked_for_at_once():
    assert session().take_output() == [REQUEST_TOPICS]


def test_announced_then_received():
    it = session()
    assert it.receive(announce() + TRIGGER, 0.1) == [
        Announced(TopicId.PUBLISHER, ESP),
        Received(TopicId.PUBLISHER, ESP, b"\x02\x01"),
    ]
    assert it.receive(announce(), 0.2) == []  # the same again
    assert it.configured


def test_message_before_negotiation_asks_again_but_not_in_a_flood():
    it = session()
    it.take_output()
    assert it.receive(TRIGGER, 1.5) == []
    assert it.take_output() == [REQUEST_TOPICS]
    it.receive(TRIGGER * 50, 1.6)
    assert it.take_output() == []
    assert it.dropped == 51


def test_refused_topic_is_told_and_its_messages_are_dropped_quietly():
    it = session()
    it.take_output()
    events = it.receive(announce(topic("cmd_vel", "geometry_msgs/Twist")), 2.0)
    assert events == [
        Refused("publisher 'cmd_vel' of type 'geometry_msgs/Twist'", "not on the list of what it may publish")
    ]
    assert it.receive(encode(126, bytes(48)), 3.5) == []
    assert it.take_output() == []


def test_rejected_topic_is_forgotten():
    it = session()
    it.receive(announce(), 0.1)
    it.reject(TopicId.PUBLISHER, ESP)
    assert it.receive(TRIGGER, 0.2) == []
    assert not it.configured


def test_topics_are_limited_and_endless_refusals_end_the_connection():
    it = session(Policy(restricted=False, max_topics=2))
    events = it.receive(b"".join(announce(topic(f"t{i}", topic_id=200 + i)) for i in range(100)), 0.1)
    assert sum(isinstance(e, Announced) for e in events) == 2
    assert any(isinstance(e, HangUp) for e in events)


def test_topic_ids_of_the_protocol_cannot_be_taken():
    it = session(TRUSTED)
    (event,) = it.receive(announce(topic("a", topic_id=10)), 0.1)
    assert isinstance(event, Refused)
    assert "belongs to the protocol" in event.reason


def test_time_log_and_parameters():
    it = session(Policy(parameters=("/name",)))
    it.take_output()
    assert it.receive(encode(TopicId.TIME, bytes(8)), 0.1) == [TimeAsked()]
    it.answer_time(5, 6)
    assert it.receive(encode(TopicId.LOG, pack_log(2, "hot")), 0.1) == [LogLine(2, "hot")]
    request = encode(TopicId.PARAMETER_REQUEST, b"\x05\0\0\0/name")
    assert it.receive(request, 0.1) == [ParamAsked("/name")]
    it.answer_param(ParamValues(strings=("x",)))
    (refused,) = it.receive(encode(TopicId.PARAMETER_REQUEST, b"\x07\0\0\0/secret"), 0.1)
    assert isinstance(refused, Refused)
    assert [p.topic_id for p in Parser().feed(b"".join(it.take_output()))] == [10, 6]


def test_cut_off_announcement_is_refused_not_raised():
    (event,) = session().receive(encode(0, b"\x7d\0\x0e\0"), 0.1)
    assert isinstance(event, Refused)
    assert "ends too early" in event.reason


def test_garbage_is_told_once_and_too_much_hangs_up():
    it = session(Policy(max_garbage=1000))
    assert it.receive(b"GET / HTTP/1.1\r\n", 0.1) == [Garbled(b"GET / HTTP/1.1\r\n")]
    assert it.receive(b"x" * 500, 0.2) == []
    (event,) = it.receive(b"x" * 600, 0.3)
    assert isinstance(event, HangUp)


def test_frame_after_a_reset_in_mid_frame_is_found_within_a_second():
    it = session(TRUSTED, silence_timeout=None)
    it.receive(announce(), 0.1)
    assert it.receive(encode(125, bytes(300))[:100] + TRIGGER, 0.2) == []
    assert it.tick(1.0) == []
    assert it.tick(1.3) == [Received(TopicId.PUBLISHER, ESP, b"\x02\x01")]


def test_silence_asks_again_and_hangs_up_at_last():
    it = session()
    it.receive(announce(), 0.1)
    it.take_output()
    assert it.tick(4.0) == []
    assert it.tick(5.2) == [SyncLost(5.2 - 0.1)]
    assert it.take_output() == [REQUEST_TOPICS]
    assert it.tick(6.0) == []
    (event,) = it.tick(15.2)
    assert isinstance(event, HangUp)


def test_serial_device_is_never_hung_up_on():
    it = session(TRUSTED, silence_timeout=None)
    it.receive(announce(), 0.1)
    assert not any(isinstance(event, HangUp) for t in range(100) for event in it.tick(float(t)))


def test_fast_client_is_read_more_slowly():
    it = session(Policy(max_rate=100.0))
    it.receive(announce(), 0.0)
    it.receive(TRIGGER * 50, 0.0)
    assert it.pause(0.0) == 0.0
    it.receive(TRIGGER * 100, 0.0)
    assert 0.5 < it.pause(0.0) < 0.7  # 151 frames, and what the topic counts
    assert it.pause(1.0) == 0.0


@given(
    chunks=st.lists(
        st.one_of(
            st.binary(max_size=60),
            st.tuples(st.integers(0, 130), st.binary(max_size=60)).map(lambda pair: encode(*pair)),
        ),
        max_size=15,
    )
)
def test_no_bytes_crash_a_session(chunks):
    for policy in (Policy(), TRUSTED):
        it = session(policy)
        for number, chunk in enumerate(chunks):
            it.receive(chunk, number * 0.4)
            it.tick(number * 0.4 + 0.1)
            it.pause(number * 0.4)
            assert len(it.take_output()) <= 3


def test_device_and_server_negotiate():
    server, device = session(), DeviceSession([ESP])
    events = device.receive(b"".join(server.take_output()), 0.0)
    assert events == [Configured()]
    heard = server.receive(b"".join(device.take_output()), 0.0)
    assert heard == [TimeAsked(), Announced(TopicId.PUBLISHER, ESP)]
    server.answer_time(100, 0)
    device.receive(b"".join(server.take_output()), 0.5)
    assert device.server_time(1.5) == 101.0
    assert device.publish(125, b"\x02\x01")
    assert server.receive(b"".join(device.take_output()), 1.0)[0].data == b"\x02\x01"


def test_device_asks_for_time_and_notices_that_the_server_is_gone():
    device = DeviceSession([ESP])
    assert not device.publish(125, b"")
    device.receive(REQUEST_TOPICS, 0.0)
    device.take_output()
    device.tick(2.6)
    assert device.take_output() == [encode(TopicId.TIME, pack_time(0, 0))]
    assert isinstance(device.tick(11.1)[0], Unconfigured)
    assert not device.configured


def test_device_hears_messages_and_stop():
    device = DeviceSession([], [topic("led", topic_id=100)])
    device.receive(REQUEST_TOPICS, 0.0)
    assert device.receive(encode(100, b"\x01"), 0.1) == [Message(100, b"\x01")]
    assert isinstance(device.receive(TX_STOP, 0.2)[0], Unconfigured)


def test_time_answer_is_the_receipt_for_what_was_published_before():
    device = DeviceSession([ESP])
    device.receive(REQUEST_TOPICS, 0.0)
    device.receive(encode(TopicId.TIME, pack_time(1, 0)), 0.1)
    device.publish(125, b"\x02\x01")
    receipt = device.request_receipt(0.2)
    assert [p.topic_id for p in Parser().feed(b"".join(device.take_output()))][-2:] == [125, TopicId.TIME]
    assert not device.has_receipt(receipt)
    device.receive(encode(TopicId.TIME, pack_time(2, 0)), 0.3)
    assert device.has_receipt(receipt)
