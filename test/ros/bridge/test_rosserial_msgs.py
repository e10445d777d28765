"""Our frames' contents against genpy's serialisation of rosserial_msgs (ours where the real package is absent)."""

import io

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from rosbot_patrol.msg import EspTrigger
from rosserial_msgs.msg import Log, TopicInfo
from rosserial_msgs.srv import RequestParamRequest, RequestParamResponse
from std_msgs.msg import Time

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.ros.bridge.channels import DeviceService, message_class, serialize, service_class
from rosbot_patrol.rosserial.protocol import topics


def test_md5_sums_are_upstreams():
    assert TopicInfo._md5sum == "0ad51f88fc44892f8c10684077646005"
    assert Log._md5sum == "11abd731c25933261cd6183bd12d6295"
    assert EspTrigger._md5sum == topics.ESP_TRIGGER_MD5


def test_topic_info():
    info = topics.TopicInfo(topic_id=125, name="t", message_type="std_msgs/Bool", md5="0" * 32, buffer_size=-5)
    message = TopicInfo(125, "t", "std_msgs/Bool", "0" * 32, -5)
    assert topics.pack_topic_info(info) == serialize(message)
    assert topics.unpack_topic_info(serialize(message)) == info


def test_ids_are_upstreams():
    ours = {topic.value for topic in topics.TopicId} - {8, 9}  # the proof's
    theirs = {
        TopicInfo.ID_PUBLISHER,
        TopicInfo.ID_SUBSCRIBER,
        TopicInfo.ID_SERVICE_SERVER + TopicInfo.ID_PUBLISHER,
        TopicInfo.ID_SERVICE_SERVER + TopicInfo.ID_SUBSCRIBER,
        TopicInfo.ID_SERVICE_CLIENT + TopicInfo.ID_PUBLISHER,
        TopicInfo.ID_SERVICE_CLIENT + TopicInfo.ID_SUBSCRIBER,
        TopicInfo.ID_PARAMETER_REQUEST,
        TopicInfo.ID_LOG,
        TopicInfo.ID_TIME,
        TopicInfo.ID_TX_STOP,
    }
    assert ours == theirs


@pytest.mark.parametrize("level", [Log.ROSDEBUG, Log.INFO, Log.WARN, Log.ERROR, Log.FATAL])
def test_log(level):
    assert topics.unpack_log(serialize(Log(level, "hot"))) == (level, "hot")
    assert topics.pack_log(level, "hot") == serialize(Log(level, "hot"))


def test_time():
    message = Time()
    message.data.secs, message.data.nsecs = 7, 500_000_000
    assert topics.pack_time(7, 500_000_000) == serialize(message)


@pytest.mark.parametrize("value", [5, True, 0.5, "x", [1, 2], [0.5, 1.5], ["a", "b"], []])
def test_parameter(value):
    assert topics.unpack_param_request(serialize(RequestParamRequest("/name"))) == "/name"
    values = topics.param_values(value)
    answer = RequestParamResponse(list(values.ints), list(values.floats), list(values.strings))
    assert topics.pack_param_values(values) == serialize(answer)
    back = RequestParamResponse().deserialize(io.BytesIO(topics.pack_param_values(values)).getvalue())
    items = value if isinstance(value, list) else [value]
    assert [*back.ints, *back.floats, *back.strings] == items


def test_service_whose_definition_differs_is_told_with_both():
    info = topics.TopicInfo(topic_id=125, name="/horn", message_type="std_srvs/SetBool", md5="0" * 32)
    service = DeviceService(info, lambda *_: None)
    for tell in (service.set_answer_topic, service.set_request_topic):
        with pytest.raises(
            ProtocolError, match=r"/horn: checksum of std_srvs/SetBool does not match: here .*, the dev"
        ):
            tell(info)


def test_types_that_are_not_built_here():
    for kind, load in (("message", message_class), ("service", service_class)):
        for name in ("no_such_pkg/Thing", "std_msgs/NoSuchThing"):
            with pytest.raises(ProtocolError, match=f"{kind} type {name}"):
                load(name)
