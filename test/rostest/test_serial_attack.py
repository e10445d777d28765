"""The real serial_node.py with an attacker on its port who tries everything at once; needs the built workspace."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import free_port, wait_for

from rosbot_patrol.rosserial.device.tcp_client import EspClient
from rosbot_patrol.rosserial.protocol.keys import add_key, new_key

ATTACKS = Path(__file__).parents[1] / "process" / "rosserial" / "attacks.py"
SECONDS = 5.0


def resident_mb(process):
    status = Path(f"/proc/{process.popen.pid}/status").read_text(encoding="utf-8")
    return int(status.partition("VmRSS:")[2].split()[0]) / 1024.0


def attack(port, source="127.0.0.66"):
    return subprocess.Popen([sys.executable, str(ATTACKS), str(port), "--source", source, "--seconds", str(SECONDS)])


@pytest.mark.parametrize("protection", ["lists", "keys"])
def test_nothing_gets_through_and_the_sensors_do_not_notice(ros, tmp_path, protection):
    port, probe, keys = free_port(), ros.probe(), {}
    arguments = ["_allow_sensors:=['127.0.0.2 2', '127.0.0.3 3', '127.0.0.66 66']"]
    if protection == "keys":
        keys = {2: new_key(), 3: new_key()}
        for sensor_id, key in keys.items():
            add_key(tmp_path / "keys.yaml", sensor_id, key)
        arguments = [f"_key_file:={tmp_path / 'keys.yaml'}"]
    probe.tell(subscribe=["/motion_trigger", "rosbot_patrol/EspTrigger"])
    probe.tell(subscribe=["/diagnostics", "diagnostic_msgs/DiagnosticArray"])
    bridge = ros.node("serial_node.py", "_port:=tcp", f"_tcp_port:={port}", "__name:=esp_client1", *arguments)
    bridge.says(f"on TCP port {port}")
    sensors = [EspClient("127.0.0.1", port, i, key=keys.get(i), source=f"127.0.0.{i}").start() for i in (2, 3)]
    assert all(sensor.wait_connected(5.0) for sensor in sensors)
    before = resident_mb(bridge)
    attacker = attack(port)
    try:
        for sensor in sensors * 2:
            wait_for(lambda: "bytes that are no frame" in bridge.output or "proof" in bridge.output)
            count = len(probe.heard(topic="/motion_trigger", id=sensor.sensor_id, move=True))
            sensor.trigger()
            wait_for(lambda s=sensor, n=count: len(probe.heard(id=s.sensor_id, move=True)) > n, 4.0, "the trigger")
        assert attacker.wait(SECONDS + 40.0) == 0
    finally:
        attacker.kill()
        attacker.wait()
    for sensor in sensors:
        assert sensor.connected
        lost = [line for line in bridge.lines if f"127.0.0.{sensor.sensor_id}:" in line and "disconnected" in line]
        assert lost == []
        sensor.stop()
    assert {said["id"] for said in probe.heard(topic="/motion_trigger")} == {2, 3}
    for name in ("/cmd_vel", "/t1"):
        probe.tell(topics=name)
    assert all(said["topics"] == [] for said in probe.heard() if "topics" in said)
    probe.expect(lambda said: "somebody wants what is refused" in str(said.get("status")))
    assert bridge.popen.poll() is None
    assert resident_mb(bridge) < before + 40.0
    about = [line for line in bridge.lines if "127.0.0.66" in line]
    assert 5 < len(about) < 150, "\n".join(about)
