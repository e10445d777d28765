"""Loops of nodes in simulated time: when they step, how often they wake, and what they do when time jumps or stops."""

import json
import signal
import subprocess
import sys

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process

# The node publishes the simulated time that it lives in: `pace` times the wall's, in ticks of 10 ms.
NODE = """
import json, sys, threading, time
from pathlib import Path
import rospy
from rosgraph_msgs.msg import Clock
from rosbot_patrol.ros.runtime.node import Loop, now, run_node

def body():
    clock = rospy.Publisher("/clock", Clock, queue_size=10)
    while not clock.get_num_connections():
        time.sleep(0.01)
    told = 1000.0
    def tick(seconds, pace):
        nonlocal told
        for _ in range(round(seconds * 100.0)):
            told += 0.01
            clock.publish(rospy.Time.from_sec(told))
            time.sleep(0.01 / pace)
    tick(0.5, 1.0)
    steps = []
    task = []
    def step(at):
        steps.append(at)
        task[:] = [threading.get_native_id()]
    loop = Loop(1.0, step)
    loop.start()
    tick(0.5, 1.0)
    def wakes():
        status = Path(f"/proc/self/task/{task[0]}/status").read_text()
        return int(status.split("voluntary_ctxt_switches:")[1].split()[0])
    said = {}
    def phase(name, seconds, pace):
        steps.clear()
        began, woke = now(), wakes()
        tick(seconds, pace)
        said[name] = {"steps": list(steps), "began": began, "ended": now(), "wakes": wakes() - woke}
    phase("even", 4.0, 1.0)
    phase("fast", 40.0, 10.0)
    told -= 500.0
    tick(0.1, 1.0)
    phase("back", 4.0, 1.0)
    tick(0.3, 1.0)
    steps.clear()
    loop.hurry()
    time.sleep(1.0)  # time stands still
    said["hurried"] = len(steps)
    print(json.dumps(said), flush=True)
    Loop(1.0, step).run()  # of the main thread, as some nodes do it

run_node("loop", body)
"""


@pytest.fixture(scope="module")
def node(sim_master):
    node = Process([sys.executable, "-c", NODE], sim_master.env, stdin=subprocess.DEVNULL)
    sim_master.processes.append(node)
    return node


@pytest.fixture(scope="module")
def said(node):
    node.says('{"even"', 60.0)
    return json.loads(next(line for line in node.output.splitlines() if line.startswith('{"even"')))


@pytest.mark.parametrize("phase", ["even", "fast", "back"])
def test_it_steps_once_a_period_of_ros_time(said, phase):
    found = said[phase]
    seconds = found["ended"] - found["began"]
    assert seconds - 2.0 <= len(found["steps"]) <= seconds + 2.0
    assert found["steps"] == sorted(found["steps"])


def test_it_sleeps_between_its_steps(said):
    """A tick of the clock wakes nothing: at 100 ticks a second that would cost more than the steps."""
    assert said["even"]["wakes"] < 40 * (said["even"]["ended"] - said["even"]["began"])


def test_it_is_hurried_while_time_stands_still(said):
    assert said["hurried"] == 1


def test_it_ends_with_its_node_while_time_stands_still(node, said):
    node.popen.send_signal(signal.SIGINT)
    assert node.popen.wait(10.0) == 0, node.output
