"""The drivers of a TurtleBot3, as its launch file starts them, with an emulated OpenCR and an emulated LDS-01."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, wait_for

HERE = Path(__file__).parent
GUARD = """
import json, sys, threading
import rospy, tf2_ros
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, LaserScan
rospy.init_node("guard", anonymous=True)
lock = threading.Lock()
def out(**said):
    with lock:
        print(json.dumps(said), flush=True)
buffer = tf2_ros.Buffer()
listener = tf2_ros.TransformListener(buffer)
rospy.Subscriber("odom", Odometry, lambda m: out(odom=m.pose.pose.position.x, child=m.child_frame_id))
rospy.Subscriber("battery_state", BatteryState, lambda m: out(battery=m.voltage, share=m.percentage))
rospy.Subscriber("scan", LaserScan, lambda m: out(beams=len(m.ranges), frame=m.header.frame_id))
command, wish = rospy.Publisher("cmd_vel", Twist, queue_size=1), Twist()
def drive(_):
    if rospy.get_param("/drive", False):
        wish.linear.x = 0.5
        command.publish(wish)
    for frame in ("base_scan", "camera_rgb_optical_frame"):
        if buffer.can_transform("odom", frame, rospy.Time()):
            at = buffer.lookup_transform("odom", frame, rospy.Time()).transform.translation
            out(frame_of=frame, z=at.z, x=at.x)
rospy.Timer(rospy.Duration(0.1), drive)
out(ready=True)
rospy.spin()
"""


def test_the_drivers_of_a_turtlebot3_serve_the_guard(ros, tmp_path):
    base = Process([sys.executable, str(HERE / "turtlebot3_base.py"), str(tmp_path / "opencr")], ros.env)
    lidar = Process([sys.executable, str(HERE / "lds_room.py"), str(tmp_path / "lds")], ros.env, stdin=subprocess.PIPE)
    for peer in (base, lidar):
        ros.processes.append(peer)
        peer.says("ready")
    ros.set_param("/drive", False)
    arguments = (f"base_port:={tmp_path / 'opencr'}", f"lidar_port:={tmp_path / 'lds'}", "robot:=turtlebot3_burger")
    command = ["roslaunch", "--skip-log-check", "rosbot_patrol", "turtlebot3_all_hardware.launch", *arguments]
    launch = Process([*command, "camera_url:=http://127.0.0.1:9/stream"], ros.env)
    ros.processes.append(launch)
    guard = ros.script(GUARD)

    launch.says("turtlebot3_msgs")  # the types that only Robotis' package has are refused by name; the rest goes on
    assert guard.expect(lambda said: "odom" in said)["child"] == "base_link"
    assert guard.expect(lambda said: "battery" in said) == {
        "battery": pytest.approx(12.1),
        "share": pytest.approx(1.09009),
    }
    assert guard.expect(lambda said: "beams" in said) == {"beams": 360, "frame": "base_scan"}
    assert guard.expect(lambda said: said.get("frame_of") == "base_scan")["z"] == pytest.approx(0.171)
    assert guard.expect(lambda said: said.get("frame_of") == "camera_rgb_optical_frame")["z"] == pytest.approx(0.12)

    ros.set_param("/drive", True)
    base.says("command 0.220 0.000")  # the Burger's limit
    guard.expect(lambda said: said.get("odom", 0.0) > 0.1)
    ros.set_param("/drive", False)
    wait_for(lambda: base.lines[-1] == "command 0.000 0.000", what="a stop once nobody commands")
