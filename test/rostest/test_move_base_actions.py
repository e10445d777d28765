"""move_base before others' clients: goals, feedback, results, cancelling and replacing in each state.

The client is Debian's actionlib (action_client.py), the base a stand-in in an empty field (light_base.py) with a map of
2000 x 2000 cells, over whose whole extent a goal in the closed square at (4, 4) is searched in vain.
"""

import itertools
import math
import subprocess
import time

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from move_base_bench import start_move_base
from ros_processes import Process, wait_for

AWAY, AWAY_TOO, CLOSED = [12.0, 0.0, 0.0], [-12.0, 3.0, 0.0], [4.0, 4.0, 0.0]
PROMPT = 0.2  # from cancelling to the result and to the zero velocity [s]
RECOVERIES = ["conservative_reset", "rotate_recovery", "aggressive_reset", "rotate_recovery"]
NO_PLAN = "Failed to find a valid plan. Even after executing recovery behaviors."


@pytest.fixture(scope="module")
def started(master):
    yield start_move_base(master)
    master.stop_nodes()


@pytest.fixture
def client(started):
    """The client, the robot idle before and after."""
    node, client, _ = started
    yield client
    t = client.tells(cancel_id=["", 0.0])  # until now, as the next goal may overtake it
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
    x0 = 0.5
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


def test_it_stands_while_the_lidar_is_blind_and_says_why(client, started, master):
    node, _, _ = started
    begin(client, "controlling")
    subprocess.run(["rosparam", "set", "/light_base/blind", "true"], env=master.env, check=True)
    node.says("we're not going to allow commanding of the base for safety: local_costmap/")
    node.says("the scan of frame 'base_link' is left out: its beams say nothing")
    wait_for(lambda: client.speed() == (0.0, 0.0), 3.0, "a zero")
    time.sleep(0.5)
    assert client.speed() == (0.0, 0.0)
    subprocess.run(["rosparam", "set", "/light_base/blind", "false"], env=master.env, check=True)
    wait_for(lambda: client.speed()[0] > 0.2, 5.0, "the drive")


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
