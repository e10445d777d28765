"""Links to a node that never say a word of ROS, as a port's former owner or a scan of the net makes them."""

import contextlib
import socket
import subprocess
import sys

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, Ros

NODE = """
import rospy
from rosbot_patrol.ros.runtime import greeting
from rosbot_patrol.ros.runtime.node import run_node

greeting.PATIENCE_S = 2.0
run_node("greeted", lambda: (print("ready", flush=True), rospy.spin()))
"""


@pytest.fixture(scope="module")
def ros():
    ros = Ros()
    yield ros
    ros.stop()


def test_calls_are_answered_beside_links_that_say_nothing_or_no_ros(ros):
    node = Process([sys.executable, "-c", NODE], ros.env, stdin=subprocess.DEVNULL)
    ros.processes.append(node)
    node.says("ready")
    call = ["rosservice", "call", "/greeted/get_loggers"]
    where = subprocess.run(["rosservice", "uri", call[-1]], env=ros.env, capture_output=True, text=True, check=True)
    address = ("localhost", int(where.stdout.rsplit(":", 1)[1]))
    with socket.create_connection(address) as silent, socket.create_connection(address) as browser:
        browser.sendall(b"POST /RPC2 HTTP/1.1\r\nHost: localhost\r\n\r\n")
        answer = subprocess.run(call, env=ros.env, capture_output=True, text=True, timeout=30.0, check=True)
        assert "rosbot_patrol" in answer.stdout
        name = "{}:{}".format(*browser.getsockname())
        node.says(f"a link from {name} is closed: what it sends begins with b'POST' and is no header of ROS")
        for link in (silent, browser):
            link.settimeout(10.0)
            with contextlib.suppress(ConnectionResetError):  # of the one whose words were not read
                assert link.recv(1) == b""
    subprocess.run(call, env=ros.env, capture_output=True, timeout=30.0, check=True)
