"""base_adapter, wheel_odometry and hlds_laser_publisher with a base and a lidar that are emulated."""

import json
import math
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, wait_for

HERE = Path(__file__).parent
BASE = """
import json, sys, threading
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, LaserScan
from std_msgs.msg import Float32, Int32
from tf2_msgs.msg import TFMessage
rospy.init_node("base", anonymous=True)
lock = threading.Lock()
def tell(**what):
    with lock:
        print(json.dumps(what), flush=True)
def frames(m):
    for t in m.transforms:
        tell(tf=[t.header.frame_id, t.child_frame_id, t.transform.translation.x])
rospy.Subscriber("base/cmd_vel", Twist, lambda m: tell(cmd=[m.linear.x, m.angular.z]), queue_size=10)
rospy.Subscriber("odom", Odometry, lambda m: tell(odom=[m.child_frame_id, m.pose.pose.position.x]))
rospy.Subscriber("battery", BatteryState, lambda m: tell(battery=[m.voltage, m.percentage, m.present]))
rospy.Subscriber("/tf", TFMessage, frames)
rospy.Subscriber("/tf_static", TFMessage, frames)
def scan(m):
    tell(scan=[len(m.ranges), m.ranges[0], m.ranges[90], m.header.frame_id])
rospy.Subscriber("scan", LaserScan, scan, queue_size=1)
rospy.Subscriber("/diagnostics", DiagnosticArray, lambda m: [tell(health=s.message) for s in m.status])
command = rospy.Publisher("cmd_vel", Twist, queue_size=1)
odometry = rospy.Publisher("base/odom", Odometry, queue_size=1)
volts = rospy.Publisher("base/battery", Float32, queue_size=1)
left, right = (rospy.Publisher(f"{side}_ticks", Int32, queue_size=1) for side in ("left", "right"))
def obey():
    for line in sys.stdin:
        words = line.split()
        values = [float(each) for each in words[1:]]
        if words[0] == "cmd":
            message = Twist()
            message.linear.x, message.angular.z = values
            command.publish(message)
        elif words[0] == "odom":
            message = Odometry(child_frame_id="base_footprint")
            message.header.frame_id = "odom"
            message.pose.pose.position.x, message.pose.pose.orientation.w = values[0], 1.0
            odometry.publish(message)
        elif words[0] == "volts":
            volts.publish(Float32(values[0]))
        elif words[0] == "ticks":
            left.publish(Int32(int(values[0])))
            right.publish(Int32(int(values[1])))
            rospy.sleep(0.02)
        elif words[0] == "links":
            tell(links=[p.get_num_connections() for p in (command, odometry, volts, left, right)])
threading.Thread(target=obey, daemon=True).start()
tell(ready=True)
rospy.spin()
"""


class Base:
    """A base, and what it and the guard's side hear."""

    def __init__(self, ros):
        self.process = Process([sys.executable, "-c", BASE], ros.env, stdin=subprocess.PIPE)
        ros.processes.append(self.process)
        self.process.says("ready")

    def tell(self, words):
        self.process.popen.stdin.write(words + "\n")
        self.process.popen.stdin.flush()

    def heard(self, key):
        told = [json.loads(line) for line in list(self.process.lines) if line.startswith("{")]
        return [each[key] for each in told if key in each]

    def tell_until(self, words, key):
        """Tell again and again until `key` is heard: a first message may come before its listener has its link."""

        def is_heard():
            self.tell(words)
            return self.heard(key)

        wait_for(is_heard, what=key)

    def wait_for_link(self, number):
        def is_linked():
            self.tell("links")
            return bool(self.heard("links") and self.heard("links")[-1][number])

        wait_for(is_linked, what=f"link {number}")

    def wait(self, key, value, **close):
        wait_for(lambda: any(each == pytest.approx(value, **close) for each in self.heard(key)), what=f"{key} {value}")


@pytest.fixture
def base(ros):
    return Base(ros)


def test_an_adapter_limits_stops_and_renames(ros, base):
    ros.forget("/base_adapter")
    node = ros.node(
        "base_adapter",
        *("_max_speed:=0.3", "_base_frame:=base_footprint", "_publish_tf:=true", "_battery:=volts"),
        *("_battery_flat:=10.0", "_battery_full:=12.0"),
    )
    node.says("the base sends no odometry: look at its cable and driver")
    for number in range(3):
        base.wait_for_link(number)
    base.tell("cmd 0.9 0.2")
    base.wait("cmd", [0.3, 0.2])
    base.wait("cmd", [0.0, 0.0])  # nobody commands any more
    base.tell_until("odom 1.5", "odom")
    assert base.heard("odom")[0] == ["base_link", 1.5]
    node.says("the base sends odometry")
    base.wait("tf", ["odom", "base_link", 1.5])
    base.wait("tf", ["base_footprint", "base_link", 0.0])
    base.tell_until("volts 11.0", "battery")
    assert base.heard("battery")[0] == [11.0, 0.5, True]
    base.tell("cmd 0.2 0.0")
    base.wait("cmd", [0.2, 0.0])
    before = base.heard("cmd").count([0.0, 0.0])
    node.stop(signal.SIGTERM)
    wait_for(lambda: base.heard("cmd").count([0.0, 0.0]) > before, what="a stop at its end")


def test_odometry_from_ticks(ros, base):
    ros.forget("/wheel_odometry")
    node = ros.node("wheel_odometry", "_wheel_radius:=0.05", "_ticks_per_turn:=1000")
    node.says("no ticks come: look at the base's cable and bridge")
    base.wait_for_link(3)
    base.wait_for_link(4)
    base.tell_until("ticks 0 0", "odom")
    base.tell("ticks 100 100")
    way = 100 * math.tau * 0.05 / 1000.0
    wait_for(lambda: base.heard("odom")[-1][1] == pytest.approx(way), what="the way")
    assert base.heard("odom")[-1][0] == "base_link"
    wait_for(lambda: any(tf[:2] == ["odom", "base_link"] for tf in base.heard("tf")), what="the transform")
    base.tell("ticks 900000 900000")
    node.says("the counters of the wheels have jumped")
    base.process.says("ticks come")


def test_the_lds_of_a_turtlebot3(ros, base, tmp_path):
    ros.forget("/hlds_laser_publisher")
    port = tmp_path / "lds"
    lidar = Process([sys.executable, str(HERE / "lds_room.py"), str(port)], ros.env, stdin=subprocess.PIPE)
    ros.processes.append(lidar)
    lidar.says("ready")
    for folder in ros.env["CMAKE_PREFIX_PATH"].split(":"):
        path = Path(folder, "lib", "hls_lfcd_lds_driver", "hlds_laser_publisher")
        if path.exists():
            node = Process([sys.executable, str(path), f"_port:={port}", "_frame_id:=base_scan"], ros.env)
    ros.processes.append(node)
    wait_for(lambda: len(base.heard("scan")) > 2, what="scans")
    assert base.heard("scan")[-1] == [360, pytest.approx(2.0), pytest.approx(1.5), "base_scan"]
    base.process.says("turns a second")
    lidar.popen.stdin.write("unplug\n")
    lidar.popen.stdin.flush()
    node.says("the lidar is lost, and will be opened again")
    base.process.says(f"{port} is not there: plug the lidar in, or set port")
