"""kill -9 of the bridge under roslaunch: the sensors come back by themselves, and no trigger is lost.

What is promised: a trigger whose sensor has the bridge's answer to the request for the time that followed it has been
given to the subscribers; any other is reported again by the sensor when it is back.
"""

import os
import re
import signal
import socket
import time

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, free_port, wait_for

from rosbot_patrol.rosserial.device.tcp_client import EspClient
from rosbot_patrol.rosserial.protocol.packet import Parser, encode
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5, REQUEST_TOPICS, TopicId, TopicInfo, pack_topic_info

LAUNCH = """
<launch>
  <node pkg="rosbot_patrol" type="serial_node.py" name="esp_client1" respawn="true" respawn_delay="0.2" output="screen">
    <param name="port" value="tcp"/>
    <param name="tcp_port" value="{port}"/>
  </node>
</launch>
"""


class Respawned:
    """The bridge as roslaunch runs it."""

    def __init__(self, ros, folder):
        self.port = free_port()
        file = folder / "bridge.launch"
        file.write_text(LAUNCH.format(port=self.port))
        self._process = Process(["roslaunch", str(file)], ros.env)
        ros.processes.append(self._process)
        self.wait_ready(1)

    def pids(self):
        return [int(pid) for pid in re.findall(r"started with pid \[(\d+)\]", self._process.output)]

    def wait_ready(self, times):
        """Wait until it has been started so many times."""
        ready = f"waiting for sensors on TCP port {self.port}"
        wait_for(lambda: self._process.output.count(ready) >= times, 30.0, f"start {times} of the bridge")

    def send_signal(self, number):
        os.kill(self.pids()[-1], number)


def test_sensors_come_back_and_no_trigger_is_lost(ros, tmp_path):
    probe = ros.probe()
    probe.tell(subscribe=["/motion_trigger", "rosbot_patrol/EspTrigger"])
    bridge = Respawned(ros, tmp_path)
    sensors = [EspClient("localhost", bridge.port, number).start() for number in range(9)]

    def heard(sensor):
        return len(probe.heard(id=sensor.sensor_id, move=True))

    for kills in (1, 2):
        for sensor in sensors:
            assert sensor.wait_connected(15.0)
        before = [heard(sensor) for sensor in sensors]
        for sensor in sensors[:3]:
            sensor.trigger()  # on its way while the bridge dies
        if kills == 2:
            time.sleep(0.002)
        bridge.send_signal(signal.SIGSTOP)
        for sensor in sensors[3:6]:
            sensor.trigger()  # taken by the system, never read by the bridge
        time.sleep(0.2)
        bridge.send_signal(signal.SIGKILL)
        wait_for(lambda: not any(sensor.connected for sensor in sensors))
        for sensor in sensors[6:]:
            sensor.trigger()  # nobody there
        bridge.wait_ready(kills + 1)
        for sensor, count in zip(sensors, before, strict=True):
            wait_for(lambda s=sensor, c=count: heard(s) > c, 15.0, f"trigger {kills} of sensor {sensor.sensor_id}")
    for sensor in sensors:
        sensor.stop()


def test_answered_trigger_is_out_even_if_the_bridge_dies_at_once(ros, tmp_path):
    probe = ros.probe()
    probe.tell(subscribe=["/motion_trigger", "rosbot_patrol/EspTrigger"])
    bridge = Respawned(ros, tmp_path)
    info = TopicInfo(topic_id=125, name="motion_trigger", message_type="rosbot_patrol/EspTrigger", md5=ESP_TRIGGER_MD5)
    for number in (1, 2):
        with socket.create_connection(("localhost", bridge.port), timeout=10.0) as link:
            assert link.recv(8) == REQUEST_TOPICS
            announce = encode(TopicId.PUBLISHER, pack_topic_info(info))
            link.sendall(announce + encode(125, bytes((40 + number, 1))) + encode(TopicId.TIME, bytes(8)))
            assert [packet.topic_id for packet in Parser().feed(link.recv(100))] == [TopicId.TIME]
            bridge.send_signal(signal.SIGKILL)
        probe.expect(lambda said, number=number: said.get("id") == 40 + number and said.get("move"))
        bridge.wait_ready(number + 1)
