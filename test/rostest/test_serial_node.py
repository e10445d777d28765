"""serial_node.py as a process before a real master: TCP and a pseudo-terminal; needs the built workspace."""

import os
import pty
import signal
import socket
import struct
import time
import tty

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

import contextlib

from ros_processes import PATIENCE, free_port, wait_for

from rosbot_patrol.rosserial.device.tcp_client import EspClient
from rosbot_patrol.rosserial.protocol.packet import Parser, encode
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5, TopicId, TopicInfo, pack_log, pack_topic_info

STRING, BOOL = "992ce8a1687cec8c8bd883ec73ca41d1", "8b94c1b53db61fb6aed406028ad6332a"
SET_BOOL_REQUEST, SET_BOOL_RESPONSE = BOOL, "937c9679a518e3a18d831e57125ea522"


def announce(kind, topic_id, name, message_type, md5):
    info = TopicInfo(topic_id=topic_id, name=name, message_type=message_type, md5=md5)
    return encode(kind, pack_topic_info(info))


def text(value):
    return len(value).to_bytes(4, "little") + value.encode()


def tcp_bridge(ros, port, *arguments):
    bridge = ros.node("serial_node.py", "_port:=tcp", f"_tcp_port:={port}", "__name:=esp_client1", *arguments)
    bridge.says(f"waiting for sensors on TCP port {port}")
    return bridge


class Device:
    """A microcontroller at the other end of a pseudo-terminal."""

    def __init__(self):
        self.fd, self._other = pty.openpty()
        tty.setraw(self._other)
        os.set_blocking(self.fd, False)
        self.path = os.ttyname(self._other)
        self._parser = Parser()
        self.packets = []

    def send(self, *frames):
        for frame in frames:
            os.write(self.fd, frame)

    def received(self, topic_id):
        with contextlib.suppress(BlockingIOError):
            self.packets += self._parser.feed(os.read(self.fd, 4096))
        return [packet.data for packet in self.packets if packet.topic_id == topic_id]

    def expect(self, topic_id, data=None):
        return wait_for(lambda: [d for d in self.received(topic_id) if data in (None, d)], 8.0, f"topic id {topic_id}")


def test_first_trigger_of_a_sensor_arrives_and_a_killed_bridge_is_found_again(ros):
    port, probe = free_port(), ros.probe()
    probe.tell(subscribe=["/motion_trigger", "rosbot_patrol/EspTrigger"])
    sensor = EspClient("localhost", port, 5).start()
    sensor.set_motion(True)  # before there is a bridge
    bridge = tcp_bridge(ros, port)
    probe.expect(lambda said: said.get("id") == 5 and said.get("move"))
    bridge.stop(signal.SIGKILL)
    wait_for(lambda: not sensor.connected)
    before = len(probe.heard(id=5, move=True))
    sensor.trigger()
    bridge = tcp_bridge(ros, port)
    wait_for(lambda: len(probe.heard(id=5, move=True)) > before)
    began = time.monotonic()
    assert bridge.stop() == 0
    assert time.monotonic() - began < 3.0
    sensor.stop()


def test_taken_port_is_one_sentence_and_exit_1(ros):
    port = free_port()
    tcp_bridge(ros, port)
    second = ros.node("serial_node.py", "tcp", str(port), "__name:=esp_client2")
    second.says(f"TCP port {port} is already taken by another program")
    assert second.popen.wait(PATIENCE) == 1
    assert "Traceback" not in second.output


def test_wrong_argument_is_one_sentence(ros, tmp_path):
    node = ros.node("serial_node.py", "tcp", "many")
    node.says("argument 2: expected a TCP port, got 'many'")
    assert node.popen.wait(PATIENCE) == 1
    node = ros.node("serial_node.py", "_port:=tcp", "_allow_publish:=['everything']", "__name:=misled")
    node.says("allow_publish: expected 'TOPIC PACKAGE/TYPE', got 'everything'")
    path = tmp_path / "keys.yaml"
    path.write_text(f'keys: {{1: "{"0f1e2d3c4b5a6978" * 4}"}}')
    path.chmod(0o644)
    node = ros.node("serial_node.py", "_port:=tcp", f"_key_file:={path}", "__name:=open")
    node.says(f"/open/key_file: {path}: others can read it (mode 644); 'chmod 600 {path}'")
    assert node.popen.wait(PATIENCE) == 1


def test_strangers_get_nothing_through_and_the_sensor_does_not_notice(ros):
    port, probe = free_port(), ros.probe()
    probe.tell(subscribe=["/motion_trigger", "rosbot_patrol/EspTrigger"])
    bridge = tcp_bridge(ros, port)
    sensor = EspClient("::1", port, 3).start()
    link = socket.create_connection(("127.0.0.1", port))
    link.sendall(os.urandom(5000))
    link.sendall(announce(TopicId.PUBLISHER, 126, "cmd_vel", "geometry_msgs/Twist", "x") + encode(126, bytes(48)))
    link.sendall(announce(TopicId.PUBLISHER, 127, "motion_trigger", "rosbot_patrol/EspTrigger", "0" * 32))
    link.sendall(announce(TopicId.SUBSCRIBER, 100, "/patrol/state", "rosbot_patrol/PatrolState", "x"))
    bridge.says("refused publisher 'cmd_vel' of type 'geometry_msgs/Twist'")
    bridge.says("refused subscriber '/patrol/state'")
    bridge.says(f"here {ESP_TRIGGER_MD5} (uint8 id bool move), the device has {'0' * 32}")
    bridge.says("bytes that are no frame")
    assert sensor.wait_connected(5.0)
    sensor.set_motion(True)
    probe.expect(lambda said: said.get("id") == 3 and said.get("move"))
    probe.tell(topics="/cmd_vel")
    assert probe.heard(topics=[])
    assert bridge.popen.poll() is None
    sensor.stop()
    link.close()


def test_diagnostics_name_sensors_and_clients(ros):
    port, probe = free_port(), ros.probe()
    probe.tell(subscribe=["/diagnostics", "diagnostic_msgs/DiagnosticArray"])
    bridge = tcp_bridge(ros, port, "_sensor_timeout:=1.5")
    sensor = EspClient("127.0.0.1", port, 6).start()  # localhost may be ::1
    said = probe.expect(lambda said: "esp_client1: sensor 6" in str(said.get("status")))
    assert "heard of" in str(said["status"])
    sensor.stop()
    bridge.says("motion sensor 6 (127.0.0.1) has not been heard of for")
    probe.expect(lambda said: "silent: 6" in str(said.get("status")))


def test_serial_device_publishes_subscribes_and_logs(ros):
    probe, device = ros.probe(), Device()
    probe.tell(subscribe=["/greeting", "std_msgs/String"], advertise=["/led", "std_msgs/Bool"])
    ros.node("serial_node.py", f"_port:={device.path}", "_baud:=525000")
    device.expect(TopicId.PUBLISHER)
    device.send(
        announce(TopicId.PUBLISHER, 125, "greeting", "std_msgs/String", STRING),
        announce(TopicId.SUBSCRIBER, 100, "led", "std_msgs/Bool", BOOL),
        encode(TopicId.LOG, pack_log(2, "battery is low")),
        encode(TopicId.TIME, bytes(8)),
    )
    probe.expect(lambda said: "battery is low" in said.get("log", ""))
    device.expect(TopicId.TIME)

    def heard():
        device.send(encode(125, text("hello")))
        return probe.heard(topic="/greeting", data="hello")

    wait_for(heard)

    def lit():
        probe.tell(publish=["/led", {"data": True}])
        return b"\x01" in device.received(100)

    wait_for(lit)


def test_services_and_parameters_of_a_serial_device(ros):
    probe, device = ros.probe(), Device()
    probe.tell(serve=["/lamp", "std_srvs/SetBool", [True, "lit"]])
    bridge = ros.node("serial_node.py", device.path)
    device.expect(TopicId.PUBLISHER)
    device.send(
        announce(TopicId.SERVICE_SERVER_PUBLISHER, 125, "/horn", "std_srvs/SetBool", SET_BOOL_RESPONSE),
        announce(TopicId.SERVICE_SERVER_SUBSCRIBER, 125, "/horn", "std_srvs/SetBool", SET_BOOL_REQUEST),
        announce(TopicId.SERVICE_CLIENT_PUBLISHER, 126, "/lamp", "std_srvs/SetBool", SET_BOOL_REQUEST),
        announce(TopicId.SERVICE_CLIENT_SUBSCRIBER, 126, "/lamp", "std_srvs/SetBool", SET_BOOL_RESPONSE),
        encode(TopicId.PARAMETER_REQUEST, text("/rosversion")),
        encode(TopicId.PARAMETER_REQUEST, text("/no_such")),
    )
    probe.tell(call=["/horn", "std_srvs/SetBool", [True]])
    device.expect(125, b"\x01")
    device.send(encode(125, b"\x01" + text("beep")))
    said = probe.expect(lambda said: said.get("called") == "/horn")
    assert (said.get("success"), said.get("message")) == (True, "beep")
    device.send(encode(126, b"\x01"))
    probe.expect(lambda said: said.get("served") == "/lamp" and said.get("data"))
    device.expect(126, b"\x01" + text("lit"))
    assert b"1." in device.expect(TopicId.PARAMETER_REQUEST)[0]
    bridge.says("parameter /no_such is not set")


def test_texts_that_are_no_utf8_come_back_as_they_were_sent(ros):
    """From the device through ROS to the device again: a topic, and a service that it both offers and calls."""
    device, latin = Device(), len(b"K\xfcche").to_bytes(4, "little") + b"K\xfcche"
    bridge = ros.node("serial_node.py", device.path)
    device.expect(TopicId.PUBLISHER)
    device.send(
        announce(TopicId.PUBLISHER, 125, "room_name", "std_msgs/String", STRING),
        announce(TopicId.SUBSCRIBER, 100, "room_name", "std_msgs/String", STRING),
        announce(TopicId.SERVICE_SERVER_PUBLISHER, 126, "/siren", "std_srvs/SetBool", SET_BOOL_RESPONSE),
        announce(TopicId.SERVICE_SERVER_SUBSCRIBER, 126, "/siren", "std_srvs/SetBool", SET_BOOL_REQUEST),
        announce(TopicId.SERVICE_CLIENT_PUBLISHER, 127, "/siren", "std_srvs/SetBool", SET_BOOL_REQUEST),
        announce(TopicId.SERVICE_CLIENT_SUBSCRIBER, 127, "/siren", "std_srvs/SetBool", SET_BOOL_RESPONSE),
        encode(TopicId.LOG, b"\2" + latin),
    )
    bridge.says("K\ufffdche")

    def heard():
        device.send(encode(125, latin))
        return latin in device.received(100)

    wait_for(heard)
    device.send(encode(127, b"\1"))
    device.expect(126, b"\1")
    device.send(encode(126, b"\1" + latin))
    device.expect(127, b"\1" + latin)


def test_battery_of_old_firmware(ros):
    """A ROSbot's of ROS melodic's time: voltage only, and no temperature in the definition."""
    probe, device = ros.probe(), Device()
    probe.tell(subscribe=["/battery", "sensor_msgs/BatteryState"])
    bridge = ros.node("serial_node.py", device.path)
    device.expect(TopicId.PUBLISHER)
    melodic = "476f837fa6771f6e16e3bf4ef96f8770"
    device.send(announce(TopicId.PUBLISHER, 125, "battery", "sensor_msgs/BatteryState", melodic))
    bridge.says("battery: sensor_msgs/BatteryState as ROS melodic had it")

    def heard():
        device.send(encode(125, bytes(16) + struct.pack("<6f4B", 12.5, 0, 0, 0, 0, 0, 0, 0, 2, 0) + bytes(12)))
        return probe.heard(topic="/battery", voltage=12.5, percentage=0.0, present=False)

    wait_for(heard)


def test_device_that_comes_back_with_another_id_hears_its_topic_again(ros):
    probe, device = ros.probe(), Device()
    probe.tell(advertise=["/led", "std_msgs/Bool"])
    ros.node("serial_node.py", device.path)
    device.expect(TopicId.PUBLISHER)
    device.send(announce(TopicId.SUBSCRIBER, 100, "led", "std_msgs/Bool", BOOL))

    def lit(topic_id):
        probe.tell(publish=["/led", {"data": True}])
        return b"\x01" in device.received(topic_id)

    wait_for(lambda: lit(100))
    device.send(b"boot\r\n", announce(TopicId.SUBSCRIBER, 101, "led", "std_msgs/Bool", BOOL))
    wait_for(lambda: lit(101))
    before = len(device.received(100))
    wait_for(lambda: lit(101) and len(device.received(101)) > 3)
    assert len(device.received(100)) == before
