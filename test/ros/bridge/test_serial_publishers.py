"""What devices publish, on its way to the subscribers; needs the messages, no master."""

import math
import socket
import struct

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseWithCovariance, Twist
from rosbot_patrol.msg import EspTrigger
from sensor_msgs.msg import BatteryState, JointState, Range
from std_msgs.msg import Bool, Empty, Float32MultiArray, String, Time
from std_srvs.srv import SetBoolResponse

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.ros.bridge import publishers as serial_publishers
from rosbot_patrol.ros.bridge.channels import check_md5, serialize
from rosbot_patrol.ros.bridge.layouts import Layout, VaryingLayout, layout, raw_from, raw_message
from rosbot_patrol.ros.bridge.publishers import WAITING, Outlet, Publishers
from rosbot_patrol.rosserial.protocol.old_types import OLD_TYPES
from rosbot_patrol.rosserial.protocol.topics import TopicInfo


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
    ],
)
def test_layout_of_message_classes(cls, expected):
    assert layout(cls) == expected


@pytest.mark.parametrize("cls", [String, Float32MultiArray, KeyValue, Range])
def test_messages_with_texts_and_arrays_vary(cls):
    assert isinstance(layout(cls), VaryingLayout)
    assert layout(cls).check(serialize(cls()), info()) == serialize(cls())


def test_fixed_message_is_checked_by_size_and_its_bools_are_0_or_1():
    trigger = layout(EspTrigger)
    assert trigger.check(b"\x07\x01", info()) == b"\x07\x01"
    assert trigger.check(b"\x07\x80", info()) == b"\x07\x01"
    for data in (b"", b"\x07", b"\x07\x01\x00"):
        with pytest.raises(
            ProtocolError, match=f"motion_trigger: {count_of(len(data), 'byte')}, a rosbot_patrol/EspTrigger has 2"
        ):
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


LATIN = "Küche".encode("latin-1")


def text(data):
    return struct.pack("<I", len(data)) + data


@pytest.mark.parametrize(
    ("cls", "data"),
    [
        (String, text(LATIN)),
        (String, text(bytes(range(256)))),
        (String, text(b"\xc3")),  # a character cut off
        (KeyValue, text(b"\xff") + text(LATIN)),
        (DiagnosticStatus, b"\1" + text(LATIN) + text(b"\xfe") + text(b"") + struct.pack("<I", 1) + text(LATIN) * 2),
        (JointState, bytes(12) + text(LATIN) + struct.pack("<I", 2) + text(LATIN) + text(b"\x80") + bytes(12)),
    ],
)
def test_texts_that_are_no_utf8_are_passed_on_as_they_came(published, cls, data):
    publishers, connection = Publishers(), Connection()
    topic = info("t", cls._type, cls._md5sum)
    publishers.open(topic)
    published["/t"].connections = [connection]
    publishers.put(topic, data)
    publishers.flush()
    came = connection.far.recv(1000)
    seq = 4 if cls._has_header else 0
    assert came[4 + seq :] == data[seq:]
    assert raw_from(cls, data, topic)._buff == data


def test_bools_among_texts_are_0_or_1(published):
    publishers, connection = Publishers(), Connection()
    answer = info("t", "std_srvs/SetBoolResponse", SetBoolResponse._md5sum)
    assert raw_from(SetBoolResponse, b"\x80" + text(LATIN), answer)._buff == b"\1" + text(LATIN)
    battery = info("battery", "sensor_msgs/BatteryState", BatteryState._md5sum)
    publishers.open(battery)
    published["/battery"].connections = [connection]
    data = bytearray(serialize(BatteryState(present=True)))
    data[-17] = 255  # before two arrays and two texts, all of them empty
    publishers.put(battery, bytes(data))
    publishers.flush()
    assert BatteryState().deserialize(connection.far.recv(200)[4:]).present is True


@pytest.mark.parametrize(
    ("cls", "data"),
    [
        (Float32MultiArray, b"\xff\xff\xff\xff" + bytes(8)),
        (JointState, bytes(12) + text(b"") + b"\xff\xff\xff\xff"),
        (DiagnosticStatus, b"\0" + text(b"") * 3 + struct.pack("<I", 1 << 31) + text(b"") * 2),
        (KeyValue, text(b"")),
        (KeyValue, text(b"") * 3),
        (String, b""),
    ],
)
def test_lengths_that_make_no_sense_are_refused(cls, data):
    with pytest.raises(ProtocolError, match=f"t: {len(data)} bytes that are no {cls._type}"):
        raw_from(cls, data, info("t", cls._type))


def test_raw_messages_are_of_the_same_type_for_ros():
    raw = raw_message(String)
    assert (raw._type, raw._md5sum, raw._full_text) == (String._type, String._md5sum, String._full_text)
    assert raw_message(String) is raw
    assert serialize(raw().deserialize(text(LATIN))) == text(LATIN)


# -- definitions of ROS melodic

MELODIC = "476f837fa6771f6e16e3bf4ef96f8770"


def melodic_battery(*, cells=(), share=0.0, tail=b"\0" * 8):
    """A BatteryState as firmware of ROS melodic's time sends it: 12.4 V, LION, no temperatures."""
    levels = struct.pack("<6f4B", 12.4, 1.0, 2.0, 3.0, 4.0, share, 0, 0, 2, 0)
    return bytes(12) + text(b"") + levels + struct.pack(f"<I{len(cells)}f", len(cells), *cells) + tail


@pytest.mark.parametrize("cells", [(), (4.0, 4.25)])
def test_battery_of_old_firmware_is_read(published, cells):
    publishers, connection = Publishers(), Connection()
    battery = info("battery", "sensor_msgs/BatteryState", MELODIC)
    publishers.open(battery)
    published["/battery"].connections = [connection]
    publishers.put(battery, melodic_battery(cells=cells, tail=text(b"slot") + text(b"7")))
    publishers.flush()
    came = BatteryState().deserialize(connection.far.recv(300)[4:])
    assert came.voltage == pytest.approx(12.4)
    assert math.isnan(came.temperature)
    assert (came.current, came.charge, came.capacity, came.design_capacity) == (1.0, 2.0, 3.0, 4.0)
    assert (came.percentage, came.power_supply_technology, came.present) == (0.0, 2, False)
    assert (tuple(came.cell_voltage), len(came.cell_temperature)) == (cells, len(cells))
    assert (came.location, came.serial_number, came.header.seq) == ("slot", "7", 1)
    (old,) = OLD_TYPES
    assert old.downgrade(old.upgrade(melodic_battery(cells=cells))) == melodic_battery(cells=cells)
    assert old.new == BatteryState._md5sum


@pytest.mark.parametrize("cut", [0, 10, 14, 20, 40, 47])
def test_old_battery_that_is_cut_off_is_refused(published, cut):
    publishers = Publishers()
    battery = info("battery", "sensor_msgs/BatteryState", MELODIC)
    publishers.open(battery)
    with pytest.raises(ProtocolError, match="BatteryState"):
        publishers.put(battery, melodic_battery()[:cut])


def test_old_and_new_firmware_share_a_topic(published):
    publishers, connection = Publishers(), Connection()
    old, new = (info("battery", "sensor_msgs/BatteryState", md5) for md5 in (MELODIC, BatteryState._md5sum))
    publishers.open(old)
    publishers.open(new)
    published["/battery"].connections = [connection]
    publishers.put(old, melodic_battery())
    publishers.put(new, serialize(BatteryState(voltage=7.0)))
    publishers.flush()
    assert len(connection.far.recv(1000)) == 2 * (4 + len(serialize(BatteryState())))


def test_the_old_sum_is_of_that_type_only():
    with pytest.raises(ProtocolError, match="checksum of std_msgs/String does not match"):
        check_md5(info("hello", "std_msgs/String", MELODIC), String)
    with pytest.raises(ProtocolError, match="checksum of sensor_msgs/BatteryState does not match"):
        check_md5(info("battery", "sensor_msgs/BatteryState", "0" * 32), BatteryState)


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
