"""dynamic_reconfigure of move_base by Debian's own tools: `dynparam`, and the client that rqt_reconfigure uses."""

import json
import math
import re
import subprocess
import sys

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from move_base_bench import start_move_base
from ros_processes import Process, Teller, wait_for

SPACES = [
    "/move_base",
    "/move_base/NavfnROS",
    "/move_base/TrajectoryPlannerROS",
    "/move_base/global_costmap",
    "/move_base/global_costmap/inflation_layer",
    "/move_base/global_costmap/low_obstacle_layer",
    "/move_base/global_costmap/obstacle_layer",
    "/move_base/global_costmap/static_layer",
    "/move_base/local_costmap",
    "/move_base/local_costmap/inflation_layer",
    "/move_base/local_costmap/low_obstacle_layer",
    "/move_base/local_costmap/obstacle_layer",
]
PLANNER = "/move_base/TrajectoryPlannerROS"

DESCRIBE = """
import json, sys, rospy
from dynamic_reconfigure.client import Client
rospy.init_node("asks", anonymous=True)
print(json.dumps({"ready": True}), flush=True)
for space in sys.argv[1:] or %r:
    client = Client(space, timeout=10)
    for row in client.get_parameter_descriptions():
        print(json.dumps({"space": space, **{k: str(row[k]) for k in ("name", "type", "min", "max", "default")}}))
    values = {k: v for k, v in client.get_configuration().items() if k != "groups"}
    print(json.dumps({"asked": space, "values": values}))
print(json.dumps({"end": True}), flush=True)
"""

REQUEST = """
import json, sys, rospy
from dynamic_reconfigure.msg import BoolParameter, Config, DoubleParameter, IntParameter, StrParameter
from dynamic_reconfigure.srv import Reconfigure
rospy.init_node("asks", anonymous=True)
print(json.dumps({"ready": True}), flush=True)
kinds = {"bools": BoolParameter, "ints": IntParameter, "doubles": DoubleParameter, "strs": StrParameter}
for field, name, value in json.loads(%r):
    config = Config(**{field: [kinds[field](name, float(value) if field == "doubles" else value)]})
    try:
        answer = rospy.ServiceProxy(%r + "/set_parameters", Reconfigure)(config).config
        values = {v.name: v.value for v in (*answer.bools, *answer.ints, *answer.doubles, *answer.strs)}
        print(json.dumps({"asked": name, "value": values.get(name)}), flush=True)
    except rospy.ServiceException as err:
        print(json.dumps({"asked": name, "refused": str(err)}), flush=True)
"""


@pytest.fixture(scope="module")
def started(master):
    yield start_move_base(master)
    master.stop_nodes()


@pytest.fixture
def node(started):
    yield started[0]
    assert started[0].popen.poll() is None
    assert "Traceback" not in started[0].output


def dynparam(master, *arguments):
    done = subprocess.run(
        ["rosrun", "dynamic_reconfigure", "dynparam", *arguments],
        env=master.env | {"PATH": f"/usr/bin:{master.env['PATH']}"},  # it wants Debian's python3
        capture_output=True,
        text=True,
        timeout=30,
    )
    return done.stdout + done.stderr


def ask(master, text):
    teller = Teller(Process([sys.executable, "-c", text], master.env))
    wait_for(lambda: teller.process.popen.poll() is not None, 30.0, "the answers")
    return teller


def request(master, space, *requests):
    return ask(master, REQUEST % (json.dumps(requests), space)).heard()[1:]


def test_every_namespace_is_found_and_described(master, node):
    listed = dynparam(master, "list").split()
    assert sorted(listed) == SPACES
    teller = ask(master, DESCRIBE % SPACES)
    assert teller.heard(end=True), teller.process.output
    described = {(row["space"], row["name"]): row for row in teller.heard() if "space" in row}
    speed = described[PLANNER, "max_vel_x"]
    assert (speed["type"], speed["min"], speed["default"]) == ("double", "0.0", "0.55")
    assert described["/move_base/local_costmap/inflation_layer", "enabled"]["type"] == "bool"
    assert described["/move_base/local_costmap", "footprint"]["type"] == "str"
    assert described["/move_base", "max_planning_retries"]["type"] == "int"
    values = {said["asked"]: said["values"] for said in teller.heard() if "asked" in said}
    assert values[PLANNER]["max_vel_x"] == 0.36
    assert (
        values["/move_base/global_costmap"]["footprint"]
        == "[[0.12, 0.14], [0.12, -0.14], [-0.12, -0.14], [-0.12, 0.14]]"
    )
    assert values["/move_base/local_costmap/inflation_layer"]["cost_scaling_factor"] == 6.0


def test_a_speed_set_while_driving_is_driven(master, started, node):
    client = started[1]
    t = client.tells(send=[30.0, 0.0, 0.0])
    t = client.next(t, lambda s: s.get("v", 0.0) > 0.3)["t"]
    assert dynparam(master, "set", PLANNER, "max_vel_x", "0.2") == ""
    node.says(f"{PLANNER}/max_vel_x: 0.2, was 0.36")
    t = client.heard()[-1]["t"]
    t = client.next(t, lambda s: 0.15 < s.get("v", 0.0) <= 0.2)["t"]
    client.next(t + 1.0, lambda s: "v" in s)
    speeds = [s["v"] for s in client.since(t + 0.3) if "v" in s]
    assert max(speeds) <= 0.2
    assert sorted(speeds)[len(speeds) // 2] > 0.1  # it did not stop for it, but may on a busy machine
    got = subprocess.run(["rosparam", "get", f"{PLANNER}/max_vel_x"], env=master.env, capture_output=True, text=True)
    assert float(got.stdout) == 0.2  # as a respawned node finds it
    assert request(master, PLANNER, ("bools", "restore_defaults", True))[0]["value"] is False
    client.next(t, lambda s: s.get("v", 0.0) > 0.3)
    client.tells(cancel=None)


def test_what_is_out_of_bounds_is_clamped_and_what_is_wrong_refused(master, node):
    requests = [
        ("doubles", "sim_time", 1000.0),
        ("ints", "sim_time", 2),
        ("doubles", "vx_samples", 7.0),
        ("doubles", "vx_samples", 7.5),
        ("strs", "max_vel_x", "fast"),
        ("bools", "max_vel_x", True),
        ("doubles", "max_vel_x", float("nan")),
        ("doubles", "max_vel_xx", 0.2),
        ("strs", "y_vels", "left,right"),
    ]
    clamped, whole, seven, half, text, truth, nan, unknown, speeds = request(master, PLANNER, *requests)
    assert clamped["value"] == 10.0
    node.says("sim_time: 1000.0 is out of bounds, 10.0 is taken")
    assert (whole["value"], seven["value"]) == (2.0, 7)
    assert "vx_samples: expected int, got 7.5" in half["refused"]
    assert "max_vel_x: expected double, got 'fast'" in text["refused"]
    assert "max_vel_x: expected double, got True" in truth["refused"]
    assert "max_vel_x: expected a number, got nan" in nan["refused"]
    assert "'max_vel_xx' is not known here, did you mean 'max_vel_x'?" in unknown["refused"]
    assert "y_vels: expected speeds such as" in speeds["refused"]
    node.says(f"not changed: {PLANNER}/max_vel_x: expected double, got 'fast'")
    request(master, PLANNER, ("bools", "restore_defaults", True))


def test_costmaps_and_layers_follow(master, started, node):
    local = "/move_base/local_costmap"
    probe = master.probe()
    probe.tell(subscribe=[f"{local}/costmap", "nav_msgs/OccupancyGrid"])
    probe.tell(subscribe=[f"{local}/footprint", "geometry_msgs/PolygonStamped"])

    def grid(text):
        probe.expect(lambda said: said.get("topic") == f"{local}/costmap" and text in said.get("info", ""), 10.0)

    grid("width: 80")
    answers = request(
        master, local, ("doubles", "width", 6.0), ("doubles", "resolution", 0.1), ("strs", "footprint", "[1]")
    )
    assert "local_costmap/footprint: expected at least three pairs of numbers" in answers[2]["refused"]
    grid("width: 60")
    square = "[[0.2, 0.2], [0.2, -0.2], [-0.2, -0.2], [-0.2, 0.2]]"
    request(master, local, ("strs", "footprint", square), ("doubles", "footprint_padding", 0.0))

    def edge(polygon):
        at = [float(text) for text in re.findall(r"[xy]: (\S+)", polygon)[:4]]
        return math.dist(at[:2], at[2:])

    probe.expect(lambda s: s.get("topic") == f"{local}/footprint" and abs(edge(s["polygon"]) - 0.4) < 1e-3, 10.0)
    layer = f"{local}/inflation_layer"
    answers = request(master, layer, ("doubles", "inflation_radius", 0.3), ("bools", "enabled", False))
    assert [a["value"] for a in answers] == [0.3, False]
    client = started[1]  # and it still drives
    t = client.tells(send=[30.0, 0.0, 0.0])
    client.next(t, lambda s: s.get("v", 0.0) > 0.3)
    client.tells(cancel=None)


def test_patience_and_rate_are_move_bases_own(master, started, node):
    client = started[1]
    answers = request(
        master,
        "/move_base",
        ("doubles", "planner_patience", 0.2),
        ("bools", "recovery_behavior_enabled", False),
        ("doubles", "controller_frequency", 2.0),
    )
    assert [a["value"] for a in answers] == [0.2, False, 2.0]
    t = client.tells(send=[4.0, 4.0, 0.0])  # where nothing leads
    end = client.next(t, lambda s: "done" in s, 8.0)
    assert end["text"] == "Failed to find a valid plan. Even after executing recovery behaviors."
    assert not [s for s in client.since(t) if "recovery" in s]
    t = client.tells(send=[30.0, 0.0, 0.0])
    client.next(t, lambda s: s.get("v", 0.0) > 0.2)
    t = client.tells(cancel=None)
    assert client.next(t, lambda s: "done" in s)["t"] - t < 0.2  # although a cycle takes half a second
