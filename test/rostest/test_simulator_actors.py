"""Actors and doors of the simulator by service, before a real master."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")


ROOT = Path(__file__).resolve().parents[2]
URDF = f"_urdf:={ROOT}/urdf/rosbot.urdf"
CALLS = """
import json, math
import rospy
from geometry_msgs.msg import Pose2D
from sensor_msgs.msg import LaserScan
from rosbot_patrol.srv import MoveActor, RemoveActor, SetDoor, SpawnActor, SpawnDoor

rospy.init_node("caller")

def call(service, kind, **request):
    rospy.wait_for_service(f"/simulator/{service}", 20.0)
    answer = rospy.ServiceProxy(f"/simulator/{service}", kind)(**request)
    return [answer.success, answer.message]

def hits():
    return sum(math.isfinite(r) for r in rospy.wait_for_message("/scan", LaserScan, 10.0).ranges)

def wait(wanted):
    for _ in range(100):
        now = hits()
        if wanted(now):
            break
    return now

said = {}
said["empty"] = hits()
said["spawned"] = call("spawn_door", SpawnDoor, name="gate", hinge=Pose2D(1.0, 0.45, -math.pi / 2))  # opens away
said["closed"] = wait(lambda n: n > 0)
said["opened"] = call("set_door", SetDoor, name="gate", opening=1.0, speed=3.0)
said["open"] = wait(lambda n: n < 40)
said["shut"] = call("set_door", SetDoor, name="gate", opening=0.0, at_once=True)
said["wrong"] = call("set_door", SetDoor, name="gate", opening=2.0)
said["narrow"] = call("spawn_door", SpawnDoor, name="slit", width=-1.0)
said["gone"] = call("remove_actor", RemoveActor, name="gate")
said["cat"] = call("spawn_actor", SpawnActor, name="tom", model="cat", look="ginger", pose=Pose2D(1, 0, 0))
said["roams"] = call("move_actor", MoveActor, name="tom", roam=1.0, speed=0.6, pause=1.0)
said["both"] = call("move_actor", MoveActor, name="tom", roam=1.0, speed=0.6, path=[Pose2D()])
said["elk"] = call("spawn_actor", SpawnActor, name="x", model="elk")
print(json.dumps(said))
"""


@pytest.fixture
def ros(sim_ros):
    return sim_ros


def test_doors_and_pets_come_by_service_and_the_lidar_sees_them(ros):
    ros.node("simulator", URDF).says("motion sensors", 20.0)
    done = subprocess.run([sys.executable, "-c", CALLS], env=ros.env, capture_output=True, text=True, timeout=90.0)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout.splitlines()[-1])
    assert said["empty"] == 0
    assert said["spawned"] == said["opened"] == said["shut"] == said["gone"] == [True, ""]
    assert said["closed"] > 60
    assert said["open"] < 40
    assert said["wrong"] == [False, "door 'gate': opens from 0 to 1, not to 2.0"]
    assert not said["narrow"][0]
    assert said["cat"] == said["roams"] == [True, ""]
    assert said["both"] == [False, "actor 'tom': walks along a path or wanders, not both"]
    assert "expected one of person, fire_hydrant, cat, dog" in said["elk"][1]
