"""simulator before a real master: topics and frames, driving, contacts, actors, sensors over TCP, pause, bad input."""

import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import PATIENCE, free_port, wait_for

ROOT = Path(__file__).resolve().parents[2]
URDF, WORLD = f"_urdf:={ROOT}/urdf/rosbot.urdf", f"_world:={ROOT}/worlds/house.world"
FRAMES = {
    "/scan": ("sensor_msgs/LaserScan", "laser"),
    "/odom": ("nav_msgs/Odometry", "odom"),
    "/rosbot/imu": ("sensor_msgs/Imu", "imu_link"),
    "/range/fl": ("sensor_msgs/Range", "range_fl"),
    "/battery": ("sensor_msgs/BatteryState", "base_link"),
    "/camera/rgb/camera_info": ("sensor_msgs/CameraInfo", "camera_depth_frame"),
    "/ground_truth/odom": ("nav_msgs/Odometry", "map"),
}
WALK = """
import rospy
from geometry_msgs.msg import Pose2D
from rosbot_patrol.srv import MoveActor, SpawnActor

rospy.wait_for_service("/simulator/spawn_actor")
placed = rospy.ServiceProxy("/simulator/spawn_actor", SpawnActor)("bob", "person", "", "", Pose2D(3, 7, 0))
moved = rospy.ServiceProxy("/simulator/move_actor", MoveActor)(name="bob", path=[Pose2D(3, 8.2, 0)], speed=1.0)
print(placed.success, moved.success)
"""
SPAWN = f"""
import rospy
from geometry_msgs.msg import Pose2D
from rosbot_patrol.srv import SpawnRobot

rospy.wait_for_service("/simulator/spawn_robot")
spawn = rospy.ServiceProxy("/simulator/spawn_robot", SpawnRobot)
urdf = open("{ROOT}/urdf/rosbot.urdf").read()
answers = [spawn("rosbot", urdf, "", pose, 0.0) for pose in (Pose2D(-0.9, -1.2, 0), Pose2D(0, 0, 0))]
box = "<geometry><box size='0.5 0.5 0.5'/></geometry>"
stool = f"<robot name='s'><link name='l'><visual>{{box}}</visual><collision>{{box}}</collision></link></robot>"
crate = box.replace("box size='0.5 0.5 0.5'/", "box><size>1 1 1</size></box")
crate = f"<link name='l'><collision name='c'>{{crate}}</collision></link>"
crate = f"<sdf version='1.6'><model name='m'>{{crate}}</model></sdf>"
bare = "<robot name='b'><link name='l'/></robot>"
for name, text in (("stool", stool), ("stool", stool), ("crate", crate), ("bare", bare)):
    answers.append(spawn(name, text, "", Pose2D(1.5, 0.5, 0), 0.25))
print(*(a.success for a in answers), *(a.message for a in answers), sep="|")
"""


@pytest.fixture
def ros(sim_ros):
    return sim_ros


def test_topics_frames_and_driving_into_a_wall(ros):
    probe = ros.probe()
    for topic, (kind, _) in FRAMES.items():
        probe.tell(subscribe=[topic, kind])
    probe.tell(subscribe=["/ground_truth/contacts", "rosbot_patrol/Contacts"])
    probe.tell(advertise=["/cmd_vel", "geometry_msgs/Twist"])
    node = ros.node("simulator", URDF, WORLD, "_rate:=3.0", "_yaw:=3.0")
    node.says("motion sensors", 20.0)
    for topic, (_, frame) in FRAMES.items():
        said = probe.expect(lambda s, topic=topic: s.get("topic") == topic, 15.0)
        assert f'frame_id: "{frame}"' in said["header"], topic

    def touches():
        probe.tell(publish=["/cmd_vel", {"linear": {"x": 0.4}}])
        return [s for s in probe.heard(topic="/ground_truth/contacts") if "house/Wall_4" in s["contacts"]]

    wait_for(touches, 15.0, "a contact with the wall")


def test_a_world_with_missing_files_starts_and_says_so(ros, tmp_path):
    lost = "<include><uri>model://nowhere</uri></include>"
    mesh = "<geometry><mesh><uri>gone.stl</uri></mesh></geometry>"
    wall = f"<model name='w'><link name='l'><collision name='c'>{mesh}</collision></link></model>"
    (tmp_path / "a.world").write_text(f"<sdf version='1.6'><world name='a'>{lost}{wall}</world></sdf>")
    probe = ros.probe()
    probe.tell(subscribe=["/diagnostics", "diagnostic_msgs/DiagnosticArray"])
    node = ros.node("simulator", URDF, f"_world:={tmp_path}/a.world")
    node.says("motion sensors", 20.0)
    assert "2 files cannot be used: 1 model left out, 1 collision left out" in node.output
    said = "2 files of the world cannot be used"
    probe.expect(lambda s: s.get("topic") == "/diagnostics" and said in s["status"], 10.0)


def test_actors_come_walk_trigger_a_sensor_over_tcp_and_go(ros, tmp_path):
    port = free_port()
    sensors = tmp_path / "sensors.yaml"
    sensors.write_text(f"sensors: [{{id: 5, room: 5, port: {port}, x: 5.2, y: 6.36, yaw: 2.3}}]")
    probe = ros.probe()
    probe.tell(subscribe=["/motion_trigger", "rosbot_patrol/EspTrigger"])
    bridge = ros.node("serial_node.py", "tcp", str(port))
    ros.node("simulator", URDF, WORLD, f"_motion_sensors:={sensors}").says("motion sensors", 20.0)
    bridge.says("motion sensor 5", 15.0)

    def answer(service, kind, *arguments):
        before = len(probe.heard(called=service))
        probe.tell(call=[service, kind, list(arguments)])
        return wait_for(lambda: probe.heard(called=service)[before:], 8.0, service)[0]

    refused = answer("/simulator/remove_actor", "rosbot_patrol/RemoveActor", "bob")
    assert not refused["success"]
    assert "is not there" in refused["message"]
    done = subprocess.run([sys.executable, "-c", WALK], env=ros.env, capture_output=True, text=True)
    assert done.stdout.split() == ["True", "True"], done.stderr
    probe.expect(lambda s: s.get("topic") == "/motion_trigger" and s["move"] and s["id"] == 5, 10.0)
    assert answer("/simulator/remove_actor", "rosbot_patrol/RemoveActor", "bob")["success"]


def test_paused_time_stands_still_and_the_robot_comes_by_service(ros):
    probe = ros.probe()
    node = ros.node("simulator", WORLD, "_robot:=false")
    node.says("motion sensors", 20.0)
    probe.tell(subscribe=["/clock", "rosgraph_msgs/Clock"])
    probe.expect(lambda s: s.get("topic") == "/clock")
    probe.tell(call=["/simulator/pause", "std_srvs/Empty", []])
    node.says("is paused")
    count = len(probe.heard(topic="/clock"))
    time.sleep(0.4)
    assert len(probe.heard(topic="/clock")) <= count + 2
    done = subprocess.run([sys.executable, "-c", SPAWN], env=ros.env, capture_output=True, text=True)
    assert done.stdout.split("|")[:6] == ["False", "True", "True", "False", "True", "False"], done.stderr
    for sentence in ("is no place for it", "the name is taken", "has neither wheels to drive by nor any shape"):
        assert sentence in done.stdout
    probe.tell(subscribe=["/scan", "sensor_msgs/LaserScan"], call=["/simulator/unpause", "std_srvs/Empty", []])
    probe.expect(lambda s: s.get("topic") == "/scan")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([URDF, "_world:=/nowhere.world"], "/nowhere.world: cannot be read"),
        ([WORLD], "/robot_description: is missing"),
        ([URDF, WORLD, "_rate:=-1.0"], "/simulator/rate: is -1.0, expected at least 0.0"),
        ([URDF, WORLD, "_odometry:=magic"], "expected one of encoder, ground_truth"),
        ([URDF, WORLD, "_x:=-0.9", "_y:=-1.2"], "is no place for it, 'house/Wall_12' is there"),
        ([URDF, WORLD, "_motion_sensors:=/nowhere.yaml"], "/nowhere.yaml: cannot be read"),
    ],
)
def test_bad_input_is_one_sentence_and_the_end(ros, arguments, sentence):
    node = ros.node("simulator", *arguments)
    node.says(sentence, 20.0)
    assert node.popen.wait(PATIENCE) == 1
    assert "Traceback" not in node.output


def test_a_world_with_something_at_its_origin_moves_the_start(ros, tmp_path):
    box = "<geometry><box><size>1 1 1</size></box></geometry>"
    world = f"""<sdf version="1.6"><world name="w"><model name="table"><static>true</static><pose>0 0 0.5 0 0 0</pose>
    <link name="top"><collision name="c">{box}</collision></link></model></world></sdf>"""
    (tmp_path / "a.world").write_text(world)
    node = ros.node("simulator", URDF, f"_world:={tmp_path / 'a.world'}")
    node.says("because the origin is no place for it; x:= and y:= place it elsewhere", 20.0)


def test_it_ends_soon_on_an_interrupt(ros):
    node = ros.node("simulator", URDF, WORLD, "_rate:=0.0")
    node.says("motion sensors", 20.0)
    began = time.monotonic()
    assert node.stop() == 0
    assert time.monotonic() - began < 5.0


SECOND = ("__ns:=robot2", "__name:=simulator", "/tf:=tf", "/tf_static:=tf_static")


def seconds(said, key="header"):
    """A stamp as the probe prints it."""
    text = said[key]
    return int(re.search(r"secs: *(\d+)", text)[1]) + int(re.search(r"nsecs: *(\d+)", text)[1]) / 1e9


def test_a_second_simulation_needs_a_namespace_and_keeps_to_the_clock_of_the_first(ros):
    first = ros.node("simulator", URDF, WORLD, "_rate:=2.0")
    first.says("motion sensors", 20.0)
    refused = ros.node("simulator", URDF, WORLD, *SECOND)
    refused.says("/clock: is published by /simulator already: give this simulation clock:=false", 20.0)
    assert refused.popen.wait(10.0) == 1

    probe = ros.probe()
    probe.tell(subscribe=["/robot2/odom", "nav_msgs/Odometry"])
    probe.tell(subscribe=["/odom", "nav_msgs/Odometry"])
    probe.tell(advertise=["/robot2/cmd_vel", "geometry_msgs/Twist"])
    second = ros.node("simulator", URDF, WORLD, "_clock:=false", *SECOND)
    second.says("motion sensors", 20.0)
    late = probe.expect(lambda s: s.get("topic") == "/robot2/odom", 20.0)
    wait_for(lambda: len(probe.heard(topic="/robot2/odom")) > 20, 20.0, "the second one's odometry")
    here, there = (seconds(probe.heard(topic=t)[-1]) for t in ("/odom", "/robot2/odom"))
    assert abs(here - there) < 0.5
    assert seconds(late) > 1.0  # the first one's time, not one that begins anew

    def drives():
        probe.tell(publish=["/robot2/cmd_vel", {"linear": {"x": 0.3}}])
        return moved(probe, "/robot2/odom") > 0.2

    wait_for(drives, 20.0, "the second robot's drive")
    assert moved(probe, "/odom") < 0.02
    listed = subprocess.run(["rosnode", "info", "/robot2/simulator"], env=ros.env, capture_output=True, text=True)
    names = re.findall(r"^ \* (/\S+)", listed.stdout, re.MULTILINE)
    assert "/robot2/scan" in names
    assert {n for n in names if not n.startswith("/robot2/")} <= {"/clock", "/rosout", "/diagnostics"}


def moved(probe, topic):
    """How far a robot's odometry has gone [m]."""
    x, y = re.search(r"x: (\S+)\s+y: (\S+)", probe.heard(topic=topic)[-1]["pose"]).groups()
    return abs(float(x)) + abs(float(y))
