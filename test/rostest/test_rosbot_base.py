"""The ROSbot's base, emulated on its serial line: rosbot_ekf's launch file, the bridge, the filter, their topics."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, wait_for

HERE = Path(__file__).parent
LISTEN = """
import json, math, threading
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Imu, Range
rospy.init_node("listener", anonymous=True)
lock = threading.Lock()
def out(**said):
    with lock:
        print(json.dumps(said), flush=True)
def odom(m):
    p, q = m.pose.pose.position, m.pose.pose.orientation
    yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))
    late = (rospy.Time.now() - m.header.stamp).to_sec()
    out(odom=[p.x, p.y, yaw], frames=[m.header.frame_id, m.child_frame_id], late=late)
rospy.Subscriber("odom", Odometry, odom)
rospy.Subscriber("battery", BatteryState, lambda m: out(battery=m.voltage, share=m.percentage, present=m.present))
rospy.Subscriber("range/fl", Range, lambda m: out(range=m.range, frame=m.header.frame_id))
rospy.Subscriber("imu", Imu, lambda m: out(turning=m.angular_velocity.z, gravity=m.linear_acceleration.z))
wheels, wish = rospy.Publisher("cmd_vel", Twist, queue_size=1), Twist()
def drive(_):
    if rospy.get_param("/drive", False):
        wish.linear.x, wish.angular.z = 0.2, 0.3
        wheels.publish(wish)
rospy.Timer(rospy.Duration(0.1), drive)
out(ready=True)
rospy.spin()
"""


class Base:
    """An emulated base, the launch file that drives it, and who listens."""

    def __init__(self, ros, folder, firmware, *arguments):
        self.ros = ros
        self.port = folder / "ttyS1"
        script = [sys.executable, str(HERE / "rosbot_base.py"), firmware, str(self.port)]
        self.device = Process(script, ros.env, stdin=subprocess.PIPE)
        ros.processes.append(self.device)
        self.device.says("ready")
        ros.set_param("/drive", False)
        command = ["roslaunch", "--skip-log-check", "rosbot_ekf", "all.launch", f"serial_port:={self.port}", *arguments]
        debian = {**ros.env, "PATH": "/usr/sbin:/usr/bin:/sbin:/bin"}  # rosservice wants Debian's python3
        self.launch = Process(command, debian)
        ros.processes.append(self.launch)
        self.listener = ros.script(LISTEN)

    def tell(self, words):
        before = len(self.device.lines)
        self.device.popen.stdin.write(words + "\n")
        self.device.popen.stdin.flush()
        wait_for(lambda: len(self.device.lines) > before, what="the base's answer")
        return self.device.lines[before]


def test_the_base_drives_and_the_filter_tells_where(ros, tmp_path):
    base = Base(ros, tmp_path, "0.16.2")
    said = base.listener.expect(lambda said: "odom" in said)
    assert said["frames"] == ["odom", "base_link"]
    ros.set_param("/drive", True)
    base.listener.expect(lambda said: "odom" in said and said["odom"][0] > 0.3 and said["odom"][2] > 0.3)
    assert base.listener.expect(lambda said: said.get("turning", 0.0) > 0.2)["gravity"] == pytest.approx(
        9.8066, abs=1e-3
    )
    ros.set_param("/drive", False)
    wait_for(lambda: "speeds 0.0 0.0" in base.tell("voltage 11.7"), what="the base's own watchdog")
    battery = base.listener.expect(lambda said: abs(said.get("battery", 0.0) - 11.7) < 1e-3)
    assert (battery["share"], battery["present"]) == (0.0, False)
    base.tell("range range/fl -1")
    assert base.listener.expect(lambda said: said.get("range") == -1.0)["frame"] == "range_fl"


def test_the_service_config_reaches_the_firmware(ros, tmp_path):
    base = Base(ros, tmp_path, "0.16.2", "mecanum:=true")
    wait_for(lambda: "('SKIN', 'MEC')" in base.tell("voltage 12.0"), what="the order of the launch file")
    call = ["rosservice", "call", "/config"]
    told = subprocess.run([*call, "NONSENSE", ""], env=ros.env, check=True, timeout=30, capture_output=True, text=True)
    assert "result: 2" in told.stdout


def test_an_old_firmware(ros, tmp_path):
    base = Base(ros, tmp_path, "0.13.1", "serial_baudrate:=500000")
    base.listener.expect(lambda said: "odom" in said)
    assert base.listener.expect(lambda said: "gravity" in said)["gravity"] == pytest.approx(9.8066, abs=1e-3)
    assert base.listener.expect(lambda said: "range" in said)["frame"] == ""


def test_a_base_that_falls_silent_is_told_and_comes_back(ros, tmp_path):
    base = Base(ros, tmp_path, "0.16.2")
    base.listener.expect(lambda said: "odom" in said)
    base.tell("mute on")
    base.launch.says("silent for 5 s, asking for its topics again")
    base.tell("mute off")
    before = len(base.listener.heard())
    wait_for(lambda: [said for said in base.listener.heard()[before:] if "battery" in said], 40.0, "the base again")
