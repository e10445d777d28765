"""move_base before others' clients: goals, feedback, results, cancelling and replacing in each state.

The client is Debian's actionlib (action_client.py), the base a stand-in in an empty field (light_base.py) with a map of
2000 x 2000 cells, over whose whole extent a goal in the closed square at (4, 4) is searched in vain.
"""

import itertools
import json
import math
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, Teller, wait_for

HERE = Path(__file__).resolve().parent
TUNED = HERE.parents[1] / "config" / "tuned"
AWAY, AWAY_TOO, CLOSED = [12.0, 0.0, 0.0], [-12.0, 3.0, 0.0], [4.0, 4.0, 0.0]
PROMPT = 0.2  # from cancelling to the result and to the zero velocity [s]
RECOVERIES = ["conservative_reset", "rotate_recovery", "aggressive_reset", "rotate_recovery"]
NO_PLAN = "Failed to find a valid plan. Even after executing recovery behaviors."


def parameters():
    """The tuned profile, less patient, turning quickly, and strict about goals."""
    tree = {}
    for name in ("move_base", "trajectory_planner", "local_costmap_params", "global_costmap_params"):
        tree |= yaml.safe_load((TUNED / f"{name}.yaml").read_text())
    common = yaml.safe_load((TUNED / "costmap_common_params.yaml").read_text())
    for costmap in ("global_costmap", "local_costmap"):
        tree[costmap] = common | tree[costmap]
    quick = {"max_rotational_vel": 3.0, "acc_lim_th": 20.0}
    return tree | {
        "planner_patience": 0.6,
        "controller_frequency": 20.0,
        "rotate_recovery": quick,
        "NavfnROS": {"allow_unknown": False, "default_tolerance": 0.0},
    }


class Client(Teller):
    """action_client.py at the other end of two pipes."""

    def __init__(self, ros):
        self._count = 0
        super().__init__(Process([sys.executable, str(HERE / "action_client.py")], ros.env, stdin=subprocess.PIPE))
        ros.processes.append(self.process)

    def since(self, t):
        """What was said after a time, as it sees it."""
        return [said for said in self.heard() if said["t"] > t]

    def tells(self, **command):
        """Tell, and return when it did so."""
        self._count += 1
        self.process.popen.stdin.write(json.dumps(command | {"count": self._count}) + "\n")
        self.process.popen.stdin.flush()
        return self.expect(lambda said: said.get("count") == self._count)["t"]

    def next(self, t, condition, seconds=10.0, what="what comes next"):
        """The first thing said after a time that meets a condition."""
        return wait_for(lambda: next((s for s in self.since(t) if condition(s)), None), seconds, what)

    def speed(self):
        said = [s for s in self.heard() if "v" in s]
        return said[-1]["v"], said[-1]["w"]


@pytest.fixture(scope="module")
def started(master):
    """Base, move_base and client for all tests here: a start takes longer than each of them."""
    master.processes.append(base := Process([sys.executable, str(HERE / "light_base.py")], master.env))
    subprocess.run(
        ["rosparam", "load", "-", "/move_base"], env=master.env, input=yaml.dump(parameters()), text=True, check=True
    )
    node = master.node("move_base")
    client = Client(master)
    node.says("global_costmap: map of 2000 x 2000 cells", 30.0)
    time.sleep(1.5)  # the first update of the global costmap
    yield node, client, base
    master.stop_nodes()


@pytest.fixture
def client(started):
    """The client, the robot idle before and after."""
    node, client, _ = started
    yield client
    t = client.tells(cancel_id=["", None])
    wait_for(lambda: [s for s in client.heard() if "v" in s][-1:] == [] or client.speed() == (0.0, 0.0), 5.0, "rest")
    assert node.popen.poll() is None, node.output
    assert "Traceback" not in node.output
    assert t


def is_driving(said):
    return said.get("v", 0.0) > 0.2


def assert_stood(client, t):
    """A zero came within the time, and nothing but zeros after it."""
    zero = client.next(t, lambda s: s.get("v") == 0.0 and s.get("w") == 0.0)
    assert zero["t"] - t < PROMPT
    time.sleep(0.3)
    assert all(s["v"] == s["w"] == 0.0 for s in client.since(zero["t"]) if "v" in s)


def test_a_goal_is_told_of_while_driving_and_reached(client):
    x0 = 0.8
    t = client.tells(send=[x0, 0.0, 0.0])
    client.next(t, lambda s: s.get("active"))
    assert client.next(t, lambda s: "current" in s)["current"] == x0
    end = client.next(t, lambda s: "done" in s, 30.0)
    assert (end["done"], end["text"]) == ("SUCCEEDED", "Goal reached.")
    told = [s for s in client.since(t) if "feedback" in s]
    assert {s["frame"] for s in told} == {"map"}
    gaps = [b["t"] - a["t"] for a, b in itertools.pairwise(told)]
    assert sorted(gaps)[len(gaps) // 2] < 0.15  # in each cycle
    assert abs(told[-1]["feedback"] - x0) < 0.2
    twists = [s for s in client.since(t) if "v" in s]
    assert twists[0]["v"] == 0.0  # on accepting
    assert twists[-1]["v"] == twists[-1]["w"] == 0.0


def begin(client, state):
    """Bring it into a state; returns when."""
    t = client.tells(send=AWAY if state == "controlling" else CLOSED)
    if state == "controlling":
        return client.next(t, is_driving)["t"]
    client.next(t, lambda s: s.get("active"))
    if state == "planning":
        time.sleep(0.25)  # within a search: each takes longer than the cycle
        return time.monotonic()
    index = {"clearing": 0, "turning": 1, "clearing again": 2, "turning again": 3}[state]
    for name in RECOVERIES[: index + 1]:
        t = client.next(t, lambda s, name=name: s.get("recovery") == name, 25.0, name)["t"]
    if "turning" in state:
        t = client.next(t, lambda s: s.get("w", 0.0) > 0.2)["t"]
    return t


STATES = ["planning", "controlling", "clearing", "turning", "clearing again", "turning again"]


@pytest.mark.parametrize("state", STATES)
def test_cancelling_ends_every_state_within_200_ms(client, state):
    begin(client, state)
    t = client.tells(cancel=None)
    end = client.next(t, lambda s: "done" in s, 5.0)
    assert end["done"] == "PREEMPTED"
    assert end["t"] - t < PROMPT
    assert_stood(client, t)


@pytest.mark.parametrize("state", ["planning", "controlling", "turning"])
def test_a_new_goal_replaces_the_old_in_every_state(client, state):
    begin(client, state)
    name = f"after {state}"  # ids are not used again: the server remembers them
    t = client.tells(goal=[name, *(AWAY_TOO if state == "planning" else [14.0, 1.0, 0.0])])
    assert client.next(t, lambda s: s.get("result") == "PREEMPTED")["t"] - t < PROMPT
    client.next(t, is_driving)
    if state == "controlling":
        driven = [s for s in client.since(t) if "v" in s]
        assert all(s["v"] > 0.0 for s in driven)  # it does not stop in between
    cancelled = client.tells(cancel_id=[name, None])
    assert client.next(cancelled, lambda s: s.get("id") == name)["result"] == "PREEMPTED"
    assert_stood(client, cancelled)


def test_whose_goal_a_cancelling_means(client):
    t = client.tells(goal=["first", *AWAY])
    client.next(t, is_driving)
    t = client.tells(goal=["second", *AWAY])
    client.next(t, lambda s: s.get("id") == "first")
    t = client.tells(cancel_id=["first", None])  # which is over
    client.tells(cancel_id=["nobody's", None])
    client.tells(cancel_id=["", 60.0])  # all that are older than a minute
    time.sleep(0.4)
    assert not [s for s in client.since(t) if "result" in s]
    assert is_driving({"v": client.speed()[0]})
    t = client.tells(cancel_id=["", 0.0])  # all until now
    assert client.next(t, lambda s: "result" in s)["id"] == "second"
    assert_stood(client, t)


def pose_text(frame="map", x=0.0, y=0.0, z=0.0, w=1.0, stamp="now"):
    return (
        f"{{header: {{stamp: {stamp}, frame_id: {frame}}}, pose: {{position: {{x: {x}, y: {y}}}, "
        f"orientation: {{z: {z}, w: {w}}}}}}}"
    )


def test_goals_by_rostopic_and_rviz(client, started, master):
    # rviz's button and `rostopic pub` both publish a PoseStamped, which becomes a goal of the action
    command = ["rostopic", "pub", "-1", "/move_base_simple/goal", "geometry_msgs/PoseStamped"]
    t = time.monotonic()
    subprocess.run([*command, pose_text(x=30.0, stamp="now")], env=master.env, check=True, timeout=20)
    assert client.next(t, lambda s: "current" in s)["current"] == 30.0
    client.next(t, is_driving)
    t = time.monotonic()
    again = Process([*command, pose_text(x=31.0, stamp="0")], master.env)
    master.processes.append(again)
    assert client.next(t, lambda s: "result" in s)["result"] == "PREEMPTED"
    assert client.next(t, lambda s: "current" in s)["current"] == 31.0
    t = client.tells(cancel_id=["", None])
    assert client.next(t, lambda s: "result" in s)["result"] == "PREEMPTED"


BAD_QUATERNION = "Aborting on goal because it was sent with an invalid quaternion"


@pytest.mark.parametrize(
    ("goal", "text"),
    [
        pytest.param([math.nan, 0.0, 0.0], "it was sent with an invalid position (nan, 0.0)", id="NaN"),
        pytest.param([math.inf, 0.0, 0.0], "it was sent with an invalid position (inf, 0.0)", id="infinite"),
        pytest.param([1.0, 0.0, math.nan], BAD_QUATERNION, id="NaN heading"),
        pytest.param([1.0, 0.0, [0.0, 0.0, 0.0, 0.0]], BAD_QUATERNION, id="zero quaternion"),
        pytest.param([1.0, 0.0, [1.0, 0.0, 0.0, 0.0]], BAD_QUATERNION, id="upside down"),
        pytest.param([1.0, 0.0, 0.0, "nowhere"], "must be in the map frame. It is instead in the nowhere", id="frame"),
        pytest.param([1.0, 0.0, 0.0, ""], "must be in the map frame. It is instead in the  frame.", id="no frame"),
    ],
)
def test_goals_that_make_no_sense_are_aborted_at_once(client, goal, text):
    t = client.tells(send=goal)
    end = client.next(t, lambda s: "done" in s, 3.0)
    assert end["done"] == "ABORTED"
    assert text in end["text"]


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        pytest.param([3.05, 4.0, 0.0], "no plan: ", id="in a wall"),
        pytest.param([500.0, 4.0, 0.0], "is off the global costmap", id="off the map"),
    ],
)
def test_goals_without_a_way_are_aborted_with_upstreams_text_after_recovering(client, started, goal, said):
    t = client.tells(send=goal)
    end = client.next(t, lambda s: "done" in s, 60.0)
    assert (end["done"], end["text"]) == ("ABORTED", NO_PLAN)
    assert said in started[0].output
    names = [s["recovery"] for s in client.since(t) if "recovery" in s]
    assert names == RECOVERIES


def test_a_bad_goal_while_driving_stops_the_robot_with_its_text(client):
    t = client.tells(goal=["good", *AWAY])
    client.next(t, is_driving)
    t = client.tells(goal=["bad", math.nan, 0.0, 0.0])
    ends = {client.next(t, lambda s, i=i: s.get("id") == i)["result"] for i in ("good", "bad")}
    assert ends == {"PREEMPTED", "ABORTED"}
    assert_stood(client, t)
