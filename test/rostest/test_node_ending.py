"""How a node ends on a signal, whatever its main thread does at that moment."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, Ros

# As a node does that logs a line: rospy asks the master whether /rosout is to name the topics.
BUSY = """
import rospy
from rosbot_patrol.ros.runtime.node import run_node

def body():
    rospy.on_shutdown(lambda: print("hook", flush=True))
    rospy.Publisher("busy", rospy.AnyMsg, queue_size=1)
    print("busy", flush=True)
    while not rospy.is_shutdown():
        rospy.get_param("/run_id")
    print("left", flush=True)

run_node("busy", body)
"""


@pytest.fixture(scope="module")
def ros():
    ros = Ros()
    yield ros
    ros.stop()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_node_ends_on_a_signal_while_it_talks_to_the_master(ros, number):
    node = Process([sys.executable, "-c", BUSY], ros.env, stdin=subprocess.DEVNULL)
    ros.processes.append(node)
    node.says("busy", 20.0)
    time.sleep(0.3)
    began = time.monotonic()
    node.popen.send_signal(number)
    assert node.popen.wait(8.0) == 0, node.output
    assert time.monotonic() - began < 4.0
    assert node.output.count("hook") == 1
    assert "left" in node.output
    assert "Traceback" not in node.output
    listed = subprocess.run(["rosnode", "list"], env=ros.env, capture_output=True, text=True, check=True).stdout
    assert "/busy" not in listed


# rospy closes topics before it says that it is shut down; who publishes just then gets this.
SPEAKING = """
import rospy
from rosbot_patrol.ros.runtime.node import run_node

def body():
    rospy.signal_shutdown("enough")
    raise rospy.ROSException("publish() to a closed topic")

run_node("speaking", body)
"""


def test_a_node_ends_in_peace_that_publishes_while_it_ends(ros):
    node = Process([sys.executable, "-c", SPEAKING], ros.env, stdin=subprocess.DEVNULL)
    assert node.popen.wait(20.0) == 0, node.output
    assert "Traceback" not in node.output


def test_a_node_that_ends_by_itself_needs_no_signal(ros):
    node = Process(
        [sys.executable, "-c", "from rosbot_patrol.ros.runtime.node import run_node; run_node('brief', lambda: None)"],
        ros.env,
        stdin=subprocess.DEVNULL,
    )
    assert node.popen.wait(20.0) == 0, node.output


# One thread of a node fails while its main thread goes on.
HALF_DEAD = """
import time
from pathlib import Path
import rospy
from rosbot_patrol.ros.runtime.node import Loop, Worker, run_node

def fail(*_):
    raise {error}

def body():
    {start}
    while not rospy.is_shutdown():
        time.sleep(0.05)

run_node("half_dead", body)
"""


@pytest.mark.parametrize("start", ["Worker(fail, name='digger').start()", "Loop(10.0, fail, name='digger').start()"])
@pytest.mark.parametrize("error", ["ZeroDivisionError('of the worker')", "rospy.ROSException('of the worker')"])
def test_a_node_ends_loudly_with_any_of_its_workers(ros, start, error):
    code = HALF_DEAD.format(start=start, error=error)
    node = Process([sys.executable, "-c", code], ros.env, stdin=subprocess.DEVNULL)
    ros.processes.append(node)
    assert node.popen.wait(20.0) == 1, node.output
    assert "'digger' failed, the node ends" in node.output
    assert "of the worker" in node.output


def test_a_node_ends_in_peace_when_a_worker_meets_its_shutdown(ros):
    start = "Worker(lambda: (rospy.sleep(0.5), rospy.signal_shutdown('enough'), rospy.sleep(0.1)), name='d').start()"
    code = HALF_DEAD.format(start=start, error="ValueError")
    node = Process([sys.executable, "-c", code], ros.env, stdin=subprocess.DEVNULL)
    ros.processes.append(node)
    assert node.popen.wait(20.0) == 0, node.output
    assert "failed" not in node.output


# Logs once a line comes in, while the master hangs.
LOGGING = """
import logging, sys
import rospy
from rosbot_patrol.ros.runtime.node import run_node

def body():
    print("at work", flush=True)
    for line in sys.stdin:
        logging.getLogger("rosbot_patrol.patrol").warning("heard %s", line.strip())
        rospy.logwarn("rospy heard %s", line.strip())
        print("done", line.strip(), flush=True)

run_node("logging", body)
"""


@pytest.fixture
def hanging_master(ros):
    """Stop the master's process, as a machine does that swaps; it goes on after the test."""
    parent = ros.core.popen.pid
    children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    master = next(int(pid) for pid in children if "rosmaster" in Path(f"/proc/{pid}/cmdline").read_text())
    yield lambda: os.kill(master, signal.SIGSTOP)
    os.kill(master, signal.SIGCONT)


def test_a_log_line_does_not_wait_for_a_master_that_hangs(ros, hanging_master):
    node = Process([sys.executable, "-c", LOGGING], ros.env, stdin=subprocess.PIPE)
    ros.processes.append(node)
    node.says("at work", 20.0)
    hanging_master()
    for word in ("one", "two"):
        node.popen.stdin.write(word + "\n")
        node.popen.stdin.flush()
        node.says(f"done {word}", 10.0)
    assert "rospy heard two" in node.output
    node.popen.stdin.close()
