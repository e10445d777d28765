"""ekf_localization_node before a real master: what it is told by topics, parameters and services, and what it says."""

import math
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, wait_for

PEER = """
import json, math, sys, threading
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from tf2_msgs.msg import TFMessage
rospy.init_node("peer", anonymous=True)
lock = threading.Lock()
def out(**said):
    with lock:
        print(json.dumps(said), flush=True)
def estimate(m):
    p, t, q = m.pose.pose.position, m.twist.twist, m.pose.pose.orientation
    yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))
    frames = {"frame": m.header.frame_id, "child": m.child_frame_id}
    out(estimate={"x": p.x, "y": p.y, "yaw": yaw, "vx": t.linear.x, **frames})
rospy.Subscriber("odometry/filtered", Odometry, estimate)
rospy.Subscriber("/tf", TFMessage, lambda m: [out(tf=[t.header.frame_id, t.child_frame_id]) for t in m.transforms])
def health(m):
    for s in m.status:
        if "ekf" in s.name: out(health=s.name, level=s.level, text=s.message)
rospy.Subscriber("/diagnostics", DiagnosticArray, health)
wheels, pose = rospy.Publisher("wheels", Odometry, queue_size=5), rospy.Publisher("pose", PoseStamped, queue_size=5)
imu, told = rospy.Publisher("imu", Imu, queue_size=5), {}
def speak(_):
    now = rospy.Time.now()
    if "vx" in told:
        m = Odometry(child_frame_id=told.get("child", "base_link"))
        m.header.stamp, m.header.frame_id = now, "odom"
        m.pose.pose.orientation.w = 1.0
        m.twist.twist.linear.x, m.twist.twist.angular.z = told["vx"], told.get("wz", 0.0)
        m.twist.covariance = [told.get("spread", 0.001) if i % 7 == 0 else 0.0 for i in range(36)]
        wheels.publish(m)
    if "pose" in told:
        m = PoseStamped(); m.header.stamp, m.header.frame_id = now, "odom"
        told["pose"][0] += told["step"]
        m.pose.position.x, m.pose.position.y, m.pose.orientation.w = *told["pose"], 1.0
        pose.publish(m)
rospy.Timer(rospy.Duration(0.05), speak)
out(ready=True)
def listen():
    for line in sys.stdin:
        told.clear(); told.update(json.loads(line))
threading.Thread(target=listen, daemon=True).start()
rospy.spin()
"""


CLOCK = """
import json, sys, threading, time
import rospy
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
rospy.init_node("clock", anonymous=True)
clock, wheels = rospy.Publisher("/clock", Clock, queue_size=1), rospy.Publisher("wheels", Odometry, queue_size=5)
def hear(m):
    print(json.dumps({"x": m.pose.pose.position.x, "stamp": m.header.stamp.to_sec()}), flush=True)
rospy.Subscriber("odometry/filtered", Odometry, hear)
now = [100.0]
def listen():
    for line in sys.stdin:
        now[0] = float(line)
threading.Thread(target=listen, daemon=True).start()
print(json.dumps({"ready": True}), flush=True)
while not rospy.is_shutdown():
    now[0] += 0.05
    stamp = rospy.Time.from_sec(now[0])
    clock.publish(stamp)
    m = Odometry(child_frame_id="base_link")
    m.header.stamp, m.header.frame_id, m.pose.pose.orientation.w, m.twist.twist.linear.x = stamp, "odom", 1.0, 0.5
    m.twist.covariance = [0.001 if i % 7 == 0 else 0.0 for i in range(36)]
    wheels.publish(m)
    time.sleep(0.05)
"""


class Filter:
    """The node, and a peer that plays the sensors."""

    def __init__(self, ros, *arguments, name="ekf"):
        self.ros = ros
        ros.forget(f"/{name}")
        self.peer = ros.script(PEER)
        for folder in ros.env["CMAKE_PREFIX_PATH"].split(":"):
            path = Path(folder, "lib", "robot_localization", "ekf_localization_node")
            if path.exists():
                break
        self.node = Process([sys.executable, str(path), f"__name:={name}", *arguments], ros.env)
        ros.processes.append(self.node)

    def tell(self, text):
        self.peer.process.popen.stdin.write(text + "\n")
        self.peer.process.popen.stdin.flush()

    def estimate(self, condition=lambda estimate: True):
        """The next estimate that meets a condition."""
        before = len(self.peer.heard())
        found = wait_for(
            lambda: [s["estimate"] for s in self.peer.heard()[before:] if "estimate" in s and condition(s["estimate"])],
            what="an estimate",
        )
        return found[0]


MASK = [False] * 6 + [True, True, False, False, False, True] + [False] * 3
WHEELS = (
    "_frequency:=30",
    "_two_d_mode:=true",
    "_odom0:=wheels",
    f"_odom0_config:={MASK}".replace("T", "t").replace("F", "f"),
)


def test_a_steady_speed_moves_the_robot_and_the_transform_follows(ros):
    ekf = Filter(ros, *WHEELS)
    ekf.tell('{"vx": 0.5}')
    first = ekf.estimate(lambda e: e["vx"] > 0.45)
    later = ekf.estimate(lambda e: e["x"] > first["x"] + 0.3)
    assert (later["frame"], later["child"]) == ("odom", "base_link")
    assert abs(later["y"]) < 0.05
    ekf.peer.expect(lambda said: said.get("tf") == ["odom", "base_link"])
    ekf.peer.expect(lambda said: said.get("health") == "ekf: odom0" and said["text"] == "heard")


def test_a_pose_is_set_by_topic_and_by_service(ros):
    ekf = Filter(ros, *WHEELS)
    ekf.tell('{"vx": 0.0}')
    ekf.estimate()
    pose = "{header: {frame_id: odom}, pose: {pose: {position: {x: 3.0, y: -2.0}, orientation: {z: 1.0, w: 0.0}}}}"
    subprocess.run(["rosservice", "call", "/set_pose", f"{{pose: {pose}}}"], env=ros.env, check=True, timeout=30)
    found = ekf.estimate(lambda e: abs(e["x"] - 3.0) < 0.01 and abs(e["y"] + 2.0) < 0.01)
    assert abs(abs(found["yaw"]) - math.pi) < 0.01
    message = ["rostopic", "pub", "-1", "/set_pose", "geometry_msgs/PoseWithCovarianceStamped"]
    subprocess.run([*message, pose.replace("3.0", "7.0")], env=ros.env, check=True, timeout=30)
    ekf.estimate(lambda e: abs(e["x"] - 7.0) < 0.01)


def test_it_is_switched_off_and_on(ros):
    ekf = Filter(ros, *WHEELS, "_disabled_at_startup:=true")
    ekf.tell('{"vx": 0.5}')
    ekf.peer.expect(lambda said: said.get("health") == "ekf")
    assert not [said for said in ekf.peer.heard() if "estimate" in said]
    subprocess.run(["rosservice", "call", "/ekf/enable"], env=ros.env, check=True, timeout=30)
    ekf.estimate()
    told = subprocess.run(
        ["rosservice", "call", "/ekf/toggle", "false"],
        env=ros.env,
        check=True,
        timeout=30,
        capture_output=True,
        text=True,
    )
    assert "status: True" in told.stdout


def test_a_frame_that_nobody_tells_is_named(ros):
    ekf = Filter(ros, *WHEELS)
    ekf.tell('{"vx": 0.5, "child": "nowhere"}')
    said = ekf.peer.expect(lambda said: said.get("level") == 2 and "cannot be placed" in said["text"])
    assert "nowhere" in said["text"]


def test_a_sensor_that_falls_silent_is_told_and_the_estimate_goes_on(ros):
    ekf = Filter(ros, *WHEELS)
    ekf.tell('{"vx": 0.5}')
    ekf.estimate(lambda e: e["vx"] > 0.4)
    ekf.tell("{}")
    ekf.peer.expect(lambda said: "silent for" in said.get("text", ""))
    ekf.estimate()


def test_differential_poses_count_by_their_change(ros):
    mask = str([True, True, False, False, False, True] + [False] * 9).replace("T", "t").replace("F", "f")
    from_far = (
        "_frequency:=30",
        "_two_d_mode:=true",
        "_odom0:=odom/wheel",
        f"_odom0_config:={mask}",
        "_odom0_differential:=true",
    )
    for folder in ros.env["CMAKE_PREFIX_PATH"].split(":"):
        path = Path(folder, "lib", "rosbot_ekf", "msgs_conversion")
        if path.exists():
            break
    ros.processes.append(Process([sys.executable, str(path)], ros.env))
    ekf = Filter(ros, *from_far)
    ekf.tell('{"pose": [40.0, 9.0], "step": 0.01}')
    first = ekf.estimate()
    assert abs(first["x"]) < 1.0
    ekf.estimate(lambda e: e["x"] > first["x"] + 0.2 and abs(e["vx"] - 0.2) < 0.1)  # after a pause it settles anew


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("_odom0_config:=[true, false]", "/ekf/odom0_config: has 2 values, expected 15"),
        ("_process_noise_covariance:=[1.0, 2.0]", "has 2 values, expected 225"),
        ("_frequency:=0", "/ekf/frequency: is 0"),
    ],
)
def test_a_parameter_that_cannot_be_used_ends_it_with_a_sentence(ros, argument, words):
    ekf = Filter(ros, *WHEELS, argument)
    assert ekf.node.popen.wait(30.0) == 1
    assert words in ekf.node.output


def test_what_grows_without_bound_is_said(ros):
    mask = str([False] * 6 + [True] + [False] * 8).replace("T", "t").replace("F", "f")
    ekf = Filter(ros, "_two_d_mode:=true", "_odom0:=wheels", f"_odom0_config:={mask}")
    ekf.tell('{"vx": 0.5}')
    ekf.peer.expect(lambda said: "yaw is not measured: its error grows without bound" in said.get("text", ""))


def test_numbers_that_are_not_finite_and_a_covariance_of_zero_are_told(ros):
    ekf = Filter(ros, *WHEELS)
    ekf.tell('{"vx": 0.5}')
    ekf.estimate(lambda e: e["vx"] > 0.4)
    ekf.tell('{"vx": NaN}')
    ekf.peer.expect(lambda said: said.get("text") == "it sends numbers that are not finite: they do not count")
    ekf.tell('{"vx": 0.5, "spread": 0.0}')
    ekf.peer.expect(lambda said: "it sends a covariance of 0" in said.get("text", ""))
    assert math.isfinite(ekf.estimate()["x"])


@pytest.mark.parametrize(
    ("arguments", "frames"),
    [
        (("_invert_tf:=true",), ["base_link", "odom"]),
        (("_world_frame:=map", "_map_frame:=map"), ["map", "odom"]),
        (("_publish_tf:=false",), None),
    ],
)
def test_the_transform_is_the_one_that_is_wanted(ros, arguments, frames):
    origin = [*("0" * 6), "odom", "base_link"]
    ros.processes.append(Process(["rosrun", "tf2_ros", "static_transform_publisher", *origin], ros.env))
    ekf = Filter(ros, *WHEELS, *arguments)
    ekf.tell('{"vx": 0.5}')
    ekf.estimate(lambda e: e["vx"] > 0.4)
    if frames is None:
        assert not [said for said in ekf.peer.heard() if "tf" in said]
    else:
        ekf.peer.expect(lambda said: said.get("tf") == frames)


@pytest.mark.parametrize("resets", [True, False])
def test_time_that_goes_back_begins_anew_if_that_is_wanted(ros, resets):
    """As between two runs of a bag, with its clock."""
    ros.set_param("/use_sim_time", True)
    try:
        ekf = Filter(ros, *WHEELS, f"_reset_on_time_jump:={str(resets).lower()}")
        clock = ros.script(CLOCK)
        first = clock.expect(lambda said: said.get("x", 0.0) > 0.5)
        assert first["stamp"] > 100.0
        clock.process.popen.stdin.write("20.0\n")
        clock.process.popen.stdin.flush()
        if resets:
            ekf.node.says("ROS time went back by")
            again = clock.expect(lambda said: said.get("stamp", 100.0) < 30.0)
            assert again["x"] < 0.3
            clock.expect(lambda said: said.get("stamp", 100.0) < 30.0 and said["x"] > again["x"] + 0.2)
        else:
            ekf.peer.expect(lambda said: "its stamps have gone back" in said.get("text", ""))
            assert not [said for said in clock.heard() if said.get("stamp", 100.0) < 30.0]
    finally:
        ros.forget("/use_sim_time")
