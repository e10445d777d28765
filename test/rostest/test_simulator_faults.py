"""simulator before a real master: faults, control and scenarios by service and file, seen on their topics."""

import time
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import PATIENCE, free_port, wait_for

ROOT = Path(__file__).resolve().parents[2]
URDF, WORLD = f"_urdf:={ROOT}/urdf/rosbot.urdf", f"_world:={ROOT}/worlds/house.world"
FAULT, CLEAR = (
    ("/simulator/set_fault", "rosbot_patrol/SetFault"),
    ("/simulator/clear_fault", "rosbot_patrol/ClearFault"),
)
STEP, POSE = ("/simulator/step", "rosbot_patrol/StepSimulation"), ("/simulator/set_pose", "rosbot_patrol/SetPose")
WATCH = """
import hashlib, json, rospy, sys, threading
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, JointState, LaserScan

lock = threading.Lock()

def say(**what):
    with lock:
        print(json.dumps(what), flush=True)

def picture(m):
    say(picture=hashlib.md5(m.data).hexdigest(), black=not any(m.data), stamp=m.header.stamp.to_sec())

rospy.init_node("watch", anonymous=True, disable_signals=True)
rospy.Subscriber("/camera/rgb/image_raw", Image, picture, queue_size=1, buff_size=2**24)
def scan(m):
    say(scan=m.header.stamp.to_sec(), nearest=min(r for r in m.ranges if r > 0.0))

rospy.Subscriber("/scan", LaserScan, scan, queue_size=1)
rospy.Subscriber("/joint_states", JointState, lambda m: say(wheels=dict(zip(m.name, m.velocity))), queue_size=1)
for topic in ("/odom", "/ground_truth/odom"):
    rospy.Subscriber(topic, Odometry, lambda m, topic=topic: say(topic=topic, x=m.pose.pose.position.x), queue_size=1)
say(ready=True)
sys.stdin.read()
"""


@pytest.fixture
def ros(sim_ros):
    return sim_ros


def asker(probe):
    def ask(service, *arguments):
        name, kind = service
        before = len(probe.heard(called=name))
        probe.tell(call=[name, kind, list(arguments)])
        return wait_for(lambda: probe.heard(called=name)[before:], 15.0, name)[0]

    return ask


def pictures_of(watch):
    return [s for s in watch.heard() if "picture" in s]


def gap(probe, key, seconds=1.5):
    """How many of something came in a while."""
    time.sleep(0.3)
    before = len([s for s in probe.heard() if key in s])
    time.sleep(seconds)
    return len([s for s in probe.heard() if key in s]) - before


def test_camera_lidar_and_wheels_break_and_are_whole_again(ros):
    probe = ros.probe()
    ask = asker(probe)
    node = ros.node("simulator", URDF, WORLD)
    node.says("motion sensors", 20.0)
    watch = ros.script(WATCH)
    watch.expect(lambda s: "picture" in s, 20.0)
    probe.tell(subscribe=["/simulator/faults", "diagnostic_msgs/DiagnosticArray"])
    probe.tell(subscribe=["/diagnostics", "diagnostic_msgs/DiagnosticArray"])

    assert ask(FAULT, "camera_frozen", "", "", 0.0)["success"]
    time.sleep(0.4)
    count = len(pictures_of(watch))
    pictures = wait_for(lambda: pictures_of(watch)[count + 3 :] and pictures_of(watch)[count:], what="four pictures")
    assert len({s["picture"] for s in pictures}) == 1
    assert len({s["stamp"] for s in pictures}) == len(pictures)
    probe.expect(lambda s: s.get("topic") == "/simulator/faults" and "camera_frozen" in s["status"])
    probe.expect(lambda s: s.get("topic") == "/diagnostics" and "camera_frozen" in s["status"])
    assert ask(CLEAR, "camera_frozen", "")["message"] == "camera_frozen"
    seen = watch.heard()
    wait_for(
        lambda: len({s["picture"] for s in watch.heard()[len(seen) :] if "picture" in s}) > 3, 10.0, "new pictures"
    )

    assert ask(FAULT, "camera_black", "", "", 2.0)["success"]
    watch.expect(lambda s: s.get("black"))
    wait_for(lambda: not pictures_of(watch)[-1]["black"], 10.0, "a picture that is not black")
    node.says("fault ends at")
    ask(FAULT, "camera_silent", "", "", 0.0)
    ask(FAULT, "lidar_silent", "", "", 0.0)
    assert (gap(watch, "picture"), gap(watch, "scan")) == (0, 0)
    listed = ask(("/simulator/list_faults", "std_srvs/Trigger"))["message"]
    assert "camera_silent since" in listed
    assert "lidar_silent since" in listed
    assert ask(CLEAR, "", "")["message"] == "camera_silent, lidar_silent"
    wait_for(lambda: gap(watch, "scan", 0.2) > 0, what="scans again")

    probe.tell(advertise=["/cmd_vel", "geometry_msgs/Twist"])
    ask(FAULT, "odometry_slip", "", "factor: 0.0", 0.0)

    def x(topic):
        return next(s["x"] for s in reversed(watch.heard()) if s.get("topic") == topic)

    def drives():
        probe.tell(publish=["/cmd_vel", {"linear": {"x": 0.2}}])
        time.sleep(0.1)
        return x("/odom") > 0.3

    wait_for(drives, 15.0, "odometry that goes on")
    assert abs(x("/ground_truth/odom")) < 0.03
    assert not ask(CLEAR, "camera_frozen", "")["success"]


def test_a_doorway_a_wheel_and_a_robot_that_is_carried(ros):
    probe = ros.probe()
    ask = asker(probe)
    ros.node("simulator", URDF, WORLD).says("motion sensors", 20.0)
    watch = ros.script(WATCH)

    def last(key, **fields):
        said = [s[key] for s in watch.heard(**fields) if key in s]
        return said[-1] if said else None

    wait_for(lambda: last("nearest"), 20.0, "a scan")
    assert last("nearest") > 0.85
    ask(FAULT, "doorway_blocked", "", "{x: 0.0, y: 0.7}", 1.0)
    wait_for(lambda: last("nearest") < 0.6, 10.0, "the box in the scan")
    wait_for(lambda: last("nearest") > 0.85, 10.0, "the box gone")
    ask(FAULT, "robot_carried", "", "{x: 1.0, y: 0.5}", 0.0)
    wait_for(lambda: last("x", topic="/ground_truth/odom") == pytest.approx(1.0, abs=1e-3), 10.0, "the robot elsewhere")
    assert abs(last("x", topic="/odom")) < 0.01
    probe.tell(advertise=["/cmd_vel", "geometry_msgs/Twist"])
    ask(FAULT, "wheel_stuck", "left", "", 0.0)

    def pivots():
        probe.tell(publish=["/cmd_vel", {"linear": {"x": 0.1}}])
        time.sleep(0.1)
        speeds = last("wheels") or {}
        left = [speed for name, speed in speeds.items() if "left" in name]
        return left == [0.0, 0.0] and max(speeds.values()) > 1.0

    wait_for(pivots, 10.0, "wheels of one side that turn alone")


@pytest.mark.long
def test_a_motion_sensor_flaps_reboots_and_falls_silent_over_tcp(ros, tmp_path):
    port = free_port()
    sensors = tmp_path / "sensors.yaml"
    sensors.write_text(f"sensors: [{{id: 5, room: 5, port: {port}, x: 5.2, y: 6.36, yaw: 2.3}}]")
    probe = ros.probe()
    ask = asker(probe)
    probe.tell(subscribe=["/motion_trigger", "rosbot_patrol/EspTrigger"])
    bridge = ros.node("serial_node.py", "tcp", str(port))
    ros.node("simulator", URDF, WORLD, f"_motion_sensors:={sensors}").says("motion sensors", 20.0)
    bridge.says("motion sensor 5", 15.0)

    def calls():
        return len([s for s in probe.heard(topic="/motion_trigger") if s["move"]])

    ask(FAULT, "motion_stuck", "5", "", 2.0)
    wait_for(lambda: calls() == 1, 10.0, "the call of a stuck sensor")
    time.sleep(2.5)
    assert calls() == 1
    ask(FAULT, "motion_flapping", "5", "period: 0.5", 0.0)
    wait_for(lambda: calls() >= 5, 10.0, "the calls of a flapping sensor")
    ask(CLEAR, "", "")
    links = bridge.output.count("connect")
    ask(FAULT, "motion_rebooting", "5", "", 0.0)
    wait_for(lambda: bridge.output.count("connect") > links, 15.0, "the bridge's word of a new connection")
    wait_for(lambda: gap(probe, "move", 1.0) >= 1, what="heartbeats")
    ask(FAULT, "motion_silent", "5", "", 0.0)
    assert gap(probe, "move", 2.0) == 0
    ask(CLEAR, "motion_silent", "5")
    wait_for(lambda: gap(probe, "move", 1.0) >= 1, 20.0, "heartbeats")
    ask(FAULT, "link_poor", "", "{delay: 1.5}", 0.0)
    time.sleep(2.0)
    before, began = calls(), time.monotonic()
    ask(FAULT, "motion_stuck", "5", "", 0.0)
    wait_for(lambda: calls() > before, 10.0, "a late call")
    assert time.monotonic() - began > 1.2


def test_pause_steps_poses_and_gazebos_names(ros):
    ask = asker(ros.probe())
    node = ros.node("simulator", URDF, WORLD)
    node.says("motion sensors", 20.0)
    refused = ask(STEP, 5)
    assert not refused["success"]
    assert "runs: pause it before you step it" in refused["message"]
    ask(("/gazebo/pause_physics", "std_srvs/Empty"))
    node.says("is paused")
    at = ask(STEP, 1)["now"]
    assert ask(STEP, 50)["now"] == pytest.approx(at + 0.5)
    assert "expected 1 to 1000" in ask(STEP, 0)["message"]

    def put(name, x, y):
        return ask(POSE, name, {"x": x, "y": y, "theta": 0.0})["message"]

    assert put("", 1.0, 0.5) == ""
    assert put("rosbot", -0.9, -1.2) == "robot 'rosbot': (-0.90, -1.20) is no place for it, 'house/Wall_12' is there"
    assert put("", float("nan"), 0.0).startswith("robot 'rosbot': (nan, 0.0, 0.0) is no pose")
    assert put("bob", 1.0, 0.0) == "actor 'bob': is not there (there: none)"
    assert "is not known here, did you mean 'camera_black'" in ask(FAULT, "camera_blak", "", "", 0.0)["message"]
    assert "there is no motion sensor 3" in ask(FAULT, "motion_stuck", "3", "", 0.0)["message"]
    assert "set_fault: values: expected keys and values" in ask(FAULT, "lidar_silent", "", "slow", 0.0)["message"]
    assert "the robot is there" in ask(FAULT, "doorway_blocked", "", "{x: 1.0, y: 0.5}", 0.0)["message"]
    ask(("/gazebo/reset_simulation", "std_srvs/Empty"))
    assert ask(FAULT, "doorway_blocked", "", "{x: 1.0, y: 0.5}", 0.0)["success"]
    assert ask(("/simulator/remove_robot", "std_srvs/Trigger"))["success"]
    assert "has no robot" in ask(("/simulator/remove_robot", "std_srvs/Trigger"))["message"]
    ask(("/gazebo/unpause_physics", "std_srvs/Empty"))
    node.says("goes on")


def test_a_scenario_wins_over_parameters_and_follows_the_patrol(ros, tmp_path):
    play = tmp_path / "play.yaml"
    play.write_text(
        f"world: {ROOT}/worlds/house.world\nrobot: {{x: 1.0}}\n"
        "actors: [{name: cat_1, model: cat, after: start, at: 0.5, start: [2, 0]}]\n"
        "faults: [{kind: lidar_silent, at: 1.0, duration: 1.0}, {kind: camera_black, after: driving}]\n"
    )
    probe = ros.probe()
    probe.tell(subscribe=["/simulator/scenario", "std_msgs/String"])
    probe.tell(advertise=["/patrol/state", "rosbot_patrol/PatrolState"])
    node = ros.node("simulator", URDF, "_world:=/nowhere.world", f"_scenario:={play}")
    node.says("scenario at 0.50 s: cat_1 (cat) appears at (2.0, 0.0)", 25.0)
    assert "lidar_silent" not in node.output
    probe.tell(publish=["/patrol/state", {"state": "idle"}])
    node.says("fault begins", 10.0)
    node.says("fault ends", 10.0)
    probe.tell(publish=["/patrol/state", {"state": "driving"}])
    node.says("fault: camera_black", 10.0)
    probe.expect(lambda s: s.get("data") == "Everything in the scenario has happened.")


def test_a_scenario_that_is_watched_waits_for_its_watch(ros, tmp_path):
    play = tmp_path / "play.yaml"
    play.write_text(
        f"world: {ROOT}/worlds/house.world\n"
        "actors: [{name: cat_1, model: cat, after: start, at: 0.5, start: [2, 0]}]\n"
    )
    node = ros.node("simulator", URDF, f"_scenario:={play}", "_scenario_watched:=true")
    node.says("motion sensors", 25.0)
    time.sleep(2.0)
    assert "cat_1" not in node.output
    probe = ros.probe()
    probe.tell(subscribe=["/simulator/scenario", "std_msgs/String"])
    probe.expect(lambda s: s.get("data") == "cat_1 (cat) appears at (2.0, 0.0)")
    probe.expect(lambda s: s.get("data") == "Everything in the scenario has happened.")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("actros: []", "play.yaml: actros: 'actros' is not known here, did you mean 'actors'?"),
        ("robot: {x: -0.9, y: -1.2}", "is no place for it, 'house/Wall_12' is there"),
        ("faults: [{kind: motion_stuck, target: 5}]", "play.yaml: faults[0]/target: there is no motion sensor 5"),
        ("triggers: [{sensor: 5, at: -2}]", "play.yaml: triggers[0]/at: is -2.0, expected at least 0.0 s"),
    ],
)
def test_a_bad_scenario_is_one_sentence_and_the_end(ros, tmp_path, text, sentence):
    play = tmp_path / "play.yaml"
    play.write_text(text)
    node = ros.node("simulator", URDF, WORLD, f"_scenario:={play}")
    node.says(sentence, 20.0)
    assert node.popen.wait(PATIENCE) == 1
    assert "Traceback" not in node.output


def test_in_lockstep_a_dead_consumer_is_named(ros):
    probe = ros.probe()
    probe.tell(subscribe=["/diagnostics", "diagnostic_msgs/DiagnosticArray"])
    node = ros.node("simulator", URDF, WORLD, "_rate:=0", "_lockstep/topics:=['/looks']", "_lockstep/slack:=0.1")
    node.says("motion sensors", 20.0)
    probe.tell(advertise=["/looks", "std_msgs/String"])
    for _ in range(10):  # until the simulator has heard one
        time.sleep(1.0)
        probe.tell(publish=["/looks", {"data": "one look"}])
        if "the clock waited" in node.output:
            break
    node.says("the clock waited 0.4 s for /looks of /probe", 10.0)
    probe.expect(lambda s: s.get("topic") == "/diagnostics" and "goes on without /looks of /probe" in s["status"])
