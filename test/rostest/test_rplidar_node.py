"""rplidarNode on a pseudo-terminal, with an emulated lidar in a process of its own."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, free_port, wait_for

HERE = Path(__file__).parent
LISTEN = """
import json
import numpy as np, rospy
from sensor_msgs.msg import LaserScan
from diagnostic_msgs.msg import DiagnosticArray
rospy.init_node("listener", anonymous=True)
def scan(m):
    r = np.array(m.ranges)
    a = m.angle_min + m.angle_increment * np.arange(len(r))
    with np.errstate(divide="ignore"):
        room = np.minimum(2.0 / np.abs(np.cos(a)), 1.5 / np.abs(np.sin(a)))
    ok = np.isfinite(r)
    off = float(np.abs(r - room)[ok].max()) if ok.any() else -1.0
    told = {"n": len(r), "seen": int(ok.sum()), "off": off, "inc": m.angle_increment, "frame": m.header.frame_id}
    told.update(time=m.scan_time, intensity=max(m.intensities))
    print(json.dumps({"scan": told}), flush=True)
def health(m):
    for s in m.status:
        if "rplidar" in s.name:
            print(json.dumps({"health": s.message}), flush=True)
rospy.Subscriber("scan", LaserScan, scan, queue_size=1)
rospy.Subscriber("/diagnostics", DiagnosticArray, health)
print(json.dumps({"ready": True}), flush=True)
rospy.spin()
"""


class Lidar:
    """An emulated lidar and the node that drives it."""

    def __init__(self, ros, folder, model, *, any_speed=True, port=""):
        self.ros = ros
        ros.forget("/rplidarNode")  # parameters outlive the node that was given them
        self.port = port or folder / "rplidar"
        script = [sys.executable, str(HERE / "rplidar_room.py"), model, str(self.port)]
        self.room = Process([*script, "any_speed"] if any_speed else script, ros.env, stdin=subprocess.PIPE)
        ros.processes.append(self.room)
        self.room.says("ready")

    def order(self, words):
        before = len(self.room.lines)
        self.room.popen.stdin.write(words + "\n")
        self.room.popen.stdin.flush()
        wait_for(lambda: len(self.room.lines) > before, what=f"the lidar that does: {words}")
        return self.room.lines[before]

    def node(self, *arguments):
        for folder in self.ros.env["CMAKE_PREFIX_PATH"].split(":"):
            path = Path(folder, "lib", "rplidar_ros", "rplidarNode")
            if path.exists():
                command = [sys.executable, str(path), f"_serial_port:={self.port}", "_frame_id:=laser", *arguments]
                process = Process(command, self.ros.env)
                self.ros.processes.append(process)
                return process
        raise AssertionError("rplidarNode is not built")


@pytest.fixture
def listener(ros):
    return ros.script(LISTEN).process


def scans(listener):
    return [json.loads(line)["scan"] for line in list(listener.lines) if line.startswith('{"scan"')]


@pytest.mark.parametrize(("model", "count", "off"), [("A1", 400, 0.02), ("A3", 1600, 0.02), ("S2", 3200, 0.02)])
def test_the_room_comes_as_a_scan(ros, listener, tmp_path, model, count, off):
    lidar = Lidar(ros, tmp_path, model)
    node = lidar.node()
    node.says("RPLidar health status : OK.")
    node.says("current scan mode: ")
    wait_for(lambda: len(scans(listener)) > 3, what="scans")
    scan = scans(listener)[-1]
    assert (scan["n"], scan["frame"]) == (count, "laser")
    assert scan["seen"] > 0.99 * count
    assert scan["off"] < off
    assert scan["inc"] * count == pytest.approx(6.2831853, abs=1e-4)
    assert 0.05 < scan["time"] < 0.5
    listener.says("turns a second")


@pytest.mark.parametrize("kind", ["tcp", "udp"])
def test_a_lidar_behind_a_port_is_lost_and_found_again(ros, listener, tmp_path, kind):
    port = free_port()
    lidar = Lidar(ros, tmp_path, "S1" if kind == "tcp" else "S2", port=f"{kind}:{port}")
    node = lidar.node(f"_channel_type:={kind}", f"_{kind}_ip:=127.0.0.1", f"_{kind}_port:={port}")
    wait_for(lambda: len(scans(listener)) > 2, what="scans")
    assert scans(listener)[-1]["off"] < 0.02
    lidar.order("unplug")
    node.says("the lidar is lost, and will be opened again")
    lidar.order("plug_in")
    before = len(scans(listener))
    wait_for(lambda: len(scans(listener)) > before + 2, what="scans again")


def test_services_stop_and_start_and_the_end_leaves_no_motor_running(ros, listener, tmp_path):
    lidar = Lidar(ros, tmp_path, "A2")
    node = lidar.node()
    wait_for(lambda: len(scans(listener)) > 1, what="scans")
    subprocess.run(["rosservice", "call", "/stop_motor"], env=ros.env, check=True, timeout=30)
    wait_for(lambda: "motor 0 scanning False" in lidar.order("tell"), what="the motor at rest")
    listener.says("the motor is off")
    before = len(scans(listener))
    subprocess.run(["rosservice", "call", "/start_motor"], env=ros.env, check=True, timeout=30)
    wait_for(lambda: len(scans(listener)) > before + 1, what="scans again")
    node.stop(signal.SIGTERM)
    told = lidar.order("tell")
    assert "motor 0 scanning False" in told
    assert told.endswith("'a5 25', 'a5 f0 02 00 00 57']")  # STOP comes before the motor ends


def test_a_second_start_while_it_streams(ros, listener, tmp_path):
    lidar = Lidar(ros, tmp_path, "A2")
    first = lidar.node()
    wait_for(lambda: len(scans(listener)) > 1, what="scans")
    os.kill(first.popen.pid, signal.SIGKILL)
    first.popen.wait()
    assert "scanning True" in lidar.order("tell")
    second = lidar.node()
    second.says("current scan mode: Express")
    before = len(scans(listener))
    wait_for(lambda: len(scans(listener)) > before + 2, what="scans of the second")


def test_unplugged_and_plugged_in_again(ros, listener, tmp_path):
    lidar = Lidar(ros, tmp_path, "A2")
    node = lidar.node()
    wait_for(lambda: len(scans(listener)) > 1, what="scans")
    lidar.order("unplug")
    node.says("the lidar is lost, and will be opened again")
    listener.says(f"{lidar.port} is not there: plug the lidar in, or set serial_port")
    lidar.order("plug_in")
    before = len(scans(listener))
    wait_for(lambda: len(scans(listener)) > before + 2, what="scans again")
    assert node.popen.poll() is None


def test_a_device_that_appears_after_the_node_is_waited_for(ros, listener, tmp_path):
    lidar = Lidar(ros, tmp_path, "A2")
    lidar.order("unplug")
    node = lidar.node("_wait_for_port:=60")
    node.says(f"{lidar.port} is not there: waiting up to 60 s for it")
    listener.says(f"waiting for {lidar.port}")
    lidar.order("plug_in")
    wait_for(lambda: len(scans(listener)) > 1, what="scans")


def test_a_motor_that_stalls_is_told_and_started_again(ros, listener, tmp_path):
    lidar = Lidar(ros, tmp_path, "A2")
    node = lidar.node()
    wait_for(lambda: len(scans(listener)) > 1, what="scans")
    lidar.order("stall")
    node.says("does its motor turn?")
    before = len(scans(listener))
    wait_for(lambda: len(scans(listener)) > before + 1, what="scans again")


@pytest.mark.long
def test_the_start_that_fails_is_told_in_upstreams_words_and_explained(ros, tmp_path):
    lidar = Lidar(ros, tmp_path, "A3", any_speed=False)

    def refused(words, why, *arguments):
        node = lidar.node(*arguments)
        assert node.popen.wait(40.0) == 255
        assert words in node.output, node.output
        assert why in node.output, node.output

    cannot_open = "Error, cannot bind to the specified serial port /dev/no_lidar."
    refused(cannot_open, "/dev/no_lidar is not there: plug the lidar in", "_serial_port:=/dev/no_lidar")
    silent = "Error, operation time out. RESULT_OPERATION_TIMEOUT!"
    refused(silent, "it answers at 256000 baud: set serial_baudrate to 256000", "_serial_baudrate:=115200")
    lidar.order("health 2")
    broken = "Error, rplidar internal error detected. Please reboot the device to retry."
    refused(broken, "reports error 0: switch it off and on", "_serial_baudrate:=256000")
    lidar.order("noise")
    refused(silent, "bytes came that are no answer", "_serial_baudrate:=256000")


def test_a_mode_that_it_lacks_lists_those_that_it_has_and_the_node_lives(ros, tmp_path):
    node = Lidar(ros, tmp_path, "A3").node("_scan_mode:=Turbo")
    node.says("scan mode `Turbo' is not supported by lidar, supported modes:")
    node.says("Sensitivity: max_distance: 25.0 m, Point number: 16.0K")
    assert node.popen.poll() is None


def test_a_dark_room_is_a_scan_without_echoes(ros, listener, tmp_path):
    lidar = Lidar(ros, tmp_path, "A2")
    lidar.order("blind")
    lidar.node()
    wait_for(lambda: len(scans(listener)) > 1, what="scans")
    assert scans(listener)[-1]["seen"] == 0
