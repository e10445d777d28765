"""What devices publish, on its way to the subscribers; needs the messages, no master."""

import socket
import struct

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from diagnostic_msgs.msg import KeyValue
from geometry_msgs.msg import PoseWithCovariance, Twist
from rosbot_patrol.msg import EspTrigger
from sensor_msgs.msg import Range
from std_msgs.msg import Bool, Empty, Float32MultiArray, String, Time

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.ros import serial_publishers
from rosbot_patrol.ros.serial_channels import serialize
from rosbot_patrol.ros.serial_publishers import WAITING, Layout, Outlet, Publishers, layout
from rosbot_patrol.rosserial.topics import TopicInfo


def info(name="motion_trigger", message_type="rosbot_patrol/EspTrigger", md5=EspTrigger._md5sum):
    return TopicInfo(topic_id=125, name=name, message_type=message_type, md5=md5)


@pytest.mark.parametrize(
    ("cls", "expected"),
    [
        (EspTrigger, Layout(2, (1,))),
        (Bool, Layout(1, (0,))),
        (Twist, Layout(48)),
        (PoseWithCovariance, Layout(7 * 8 + 36 * 8)),
        (Time, Layout(8)),
        (Empty, Layout(0)),
        (String, None),
        (Float32MultiArray, None),
        (KeyValue, None),
        (Range, None),  # its header is numbered by ROS
    ],
)
def test_layout_of_message_classes(cls, expected):
    assert layout(cls) == expected


def test_fixed_message_is_checked_by_size_and_its_bools_are_0_or_1():
    trigger = layout(EspTrigger)
    assert trigger.check(b"\x07\x01", info()) == b"\x07\x01"
    assert trigger.check(b"\x07\x80", info()) == b"\x07\x01"
    for data in (b"", b"\x07", b"\x07\x01\x00"):
        with pytest.raises(ProtocolError, match=f"motion_trigger: {len(data)} bytes, a rosbot_patrol/EspTrigger has 2"):
            trigger.check(data, info())


class Connection:
    """What rospy keeps of a subscriber."""

    endpoint_id = "http://there:1/"
    stat_bytes = stat_num_msg = 0

    def __init__(self):
        self.socket, self.far = socket.socketpair()
        self.far.settimeout(2.0)

    def close(self):
        self.socket.close()
        self.socket = None


def test_subscriber_that_does_not_read_holds_nobody_up_and_loses_the_oldest(caplog):
    connection = Connection()
    outlet = Outlet(connection, "/t")
    frame = struct.pack("<I", 996) + bytes(996)
    sent = 3 * WAITING // 1000
    for _ in range(sent):
        outlet.put(frame, 1)
    assert outlet.lost > 0
    assert len([r for r in caplog.records if "does not keep up" in r.message]) == 1
    came = b""
    while len(came) < (sent - outlet.lost) * 1000:
        came += connection.far.recv(1 << 20)
        outlet.flush()
    assert came == frame * (sent - outlet.lost)  # whole messages, none torn
    assert connection.stat_num_msg == sent - outlet.lost


class Impl:
    def __init__(self, *connections):
        self.connections = list(connections)
        self.message_data_sent = 0

    def set_queue_size(self, size):
        assert size is None


@pytest.fixture
def published(monkeypatch):
    """Publishers without a node; calls of rospy.Publisher are kept."""
    made = {}

    class Publisher:
        def __init__(self, name, cls, **options):
            assert options["tcp_nodelay"]
            self.impl = made[name] = Impl()

    monkeypatch.setattr(serial_publishers.rospy, "Publisher", Publisher)
    monkeypatch.setattr(serial_publishers.rospy, "resolve_name", lambda name: "/" + name.lstrip("/"))
    monkeypatch.setattr(serial_publishers, "SETTLING", 0.0)
    return made


def test_messages_of_one_moment_go_out_in_one_piece(published):
    publishers, connection = Publishers(), Connection()
    publishers.open(info())
    publishers.tick()
    published["/motion_trigger"].connections = [connection]
    for number in range(3):
        publishers.put(info(), bytes((number, 1)))
    publishers.flush()
    expected = b"".join(struct.pack("<IBB", 2, number, 1) for number in range(3))
    assert connection.far.recv(100) == expected
    assert published["/motion_trigger"].message_data_sent == len(expected)


def test_first_messages_wait_for_the_subscribers(published, monkeypatch):
    monkeypatch.setattr(serial_publishers, "SETTLING", 3600.0)
    publishers = Publishers()
    publishers.open(info())
    for number in range(serial_publishers.HELD + 5):
        publishers.put(info(), bytes((number % 256, 0)))
    publishers.flush()
    (topic,) = publishers._by_name.values()
    assert len(topic._batch) == serial_publishers.HELD
    connection = Connection()
    published["/motion_trigger"].connections = [connection]
    topic._opens_at = 1e-9
    publishers.tick()
    assert connection.far.recv(1 << 16)[:6] == struct.pack("<IBB", 2, 5, 0)


def test_gone_subscriber_is_closed_and_the_others_hear(published):
    publishers, gone, there = Publishers(), Connection(), Connection()
    publishers.open(info())
    published["/motion_trigger"].connections = [gone, there]
    gone.far.close()
    publishers.put(info(), b"\x01\x01")
    publishers.flush()
    assert gone.socket is None
    assert there.far.recv(100) == struct.pack("<IBB", 2, 1, 1)


def test_message_of_varying_size_is_read_before_it_is_sent(published):
    publishers, connection = Publishers(), Connection()
    text = info("hello", "std_msgs/String", String._md5sum)
    publishers.open(text)
    published["/hello"].connections = [connection]
    publishers.put(text, b"\x02\0\0\0hi")
    publishers.flush()
    assert connection.far.recv(100) == b"\x06\0\0\0\x02\0\0\0hi"
    for wrong in (b"\xff\0\0\0h", b"\x02\0", b"\x01\0\0\0hi"):
        with pytest.raises(ProtocolError, match=f"hello: {len(wrong)} bytes that are no std_msgs/String"):
            publishers.put(text, wrong)


def test_topic_has_one_type(published):
    publishers = Publishers()
    publishers.open(info())
    with pytest.raises(ProtocolError, match="is published as rosbot_patrol/EspTrigger already, not as std_msgs/String"):
        publishers.open(info(message_type="std_msgs/String", md5=String._md5sum))
    with pytest.raises(ProtocolError, match="checksum of rosbot_patrol/EspTrigger does not match"):
        publishers.open(info(md5="0" * 32))


def test_header_of_a_device_is_numbered_anew(published):
    publishers, connection = Publishers(), Connection()
    sonar = info("sonar", "sensor_msgs/Range", Range._md5sum)
    publishers.open(sonar)
    published["/sonar"].connections = [connection]
    message = Range(range=1.5)
    message.header.seq, message.header.frame_id = 77, "sonar_front"
    publishers.put(sonar, serialize(message))
    publishers.flush()
    came = Range().deserialize(connection.far.recv(200)[4:])
    assert (came.header.seq, came.header.frame_id, came.range) == (1, "sonar_front", 1.5)
