"""A shell of scripts/env: ROS's own tools work in it."""

import os
import subprocess
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

ROOT = Path(__file__).resolve().parents[2]


def shell(command, **environment):
    """What a command says in a fresh shell of scripts/env, and its exit status."""
    outer = {name: value for name, value in os.environ.items() if not name.startswith("ROS_")}
    done = subprocess.run(
        ["bash", "-c", f'. "{ROOT}/scripts/env" && {command}'],
        env={**outer, **environment},
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60.0,
    )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize("arguments", ["", "--all", "launch/demo.launch"])
def test_roswtf_comes_to_its_end_without_a_master(arguments):
    status, output = shell(f"roswtf {arguments}", ROS_MASTER_URI="http://localhost:1")
    assert status == 0, output
    assert "Static checks summary" in output
    assert "ROS_ROOT" not in output
    assert "Traceback" not in output
    assert "ROS Master does not appear to be running" in output


def test_roswtf_comes_to_its_end_with_nodes(ros):
    ros.node("map_server", str(ROOT / "maps" / "rosbot_map.yaml")).says("Read a")
    status, output = shell("roswtf", ROS_MASTER_URI=ros.env["ROS_MASTER_URI"])
    assert status == 0, output
    assert "Online checks summary" in output
    assert "Traceback" not in output


def test_a_root_that_is_set_stays(tmp_path):
    assert shell('echo "$ROS_ROOT"', ROS_ROOT=str(tmp_path / "ros")) == (0, f"{tmp_path}/ros\n")


@pytest.mark.parametrize("command", ["rosversion -d", "rospack find rosbot_patrol", "rosmsg show std_msgs/String"])
def test_other_tools_that_ask_for_the_surroundings(command):
    status, output = shell(command)
    assert status == 0, output
    assert "Traceback" not in output
