"""Sensors on two other hosts, one of which is cut off; each host is a network namespace of its own."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

INSIDE = Path(__file__).with_name("two_hosts_inside.py")
TRY = "ip link add try0 type veth peer name try1 && unshare -n true"


def namespace():
    """How to run a command in a network namespace of its own, which may make others; skips where it is not allowed."""
    said = ""
    for command in (["unshare", "-n"], ["unshare", "-r", "-n"]):
        tried = subprocess.run([*command, "sh", "-c", TRY], capture_output=True, text=True, check=False)
        if tried.returncode == 0:
            return command
        said = tried.stderr.strip()
    pytest.skip(f"network namespaces with veth are not permitted here: {said}")


def test_one_host_is_cut_off_and_plugged_in_again():
    alive = ["sh", "-c", 'ip link set lo up && exec "$@"', "sh"]
    command = [*namespace(), *alive, sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(INSIDE)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120.0, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
