"""record: a bag by rosbag, of what there is, ended by Ctrl-C or the time."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, Ros, wait_for
from rosbags.highlevel import AnyReader


@pytest.fixture(scope="module")
def ros():
    ros = Ros()
    ros.processes.append(
        Process(
            ["rostopic", "pub", "-r", "10", "/motion_trigger", "rosbot_patrol/EspTrigger", "{id: 3, move: true}"],
            ros.env,
        )
    )
    yield ros
    ros.stop()


def heard(ros):
    """What is known of the topic, with its subscribers."""
    return subprocess.run(["rostopic", "info", "/motion_trigger"], env=ros.env, capture_output=True, text=True).stdout


def record(ros, *arguments):
    return Process([sys.executable, "-m", "rosbot_patrol.ros.tools.record_node", *map(str, arguments)], ros.env)


def test_a_bag_until_it_is_ended(ros, tmp_path: Path):
    file = tmp_path / "night.bag"
    process = record(ros, file, "--no-camera")
    process.says("nobody publishes yet: ")
    assert "/scan" in process.output
    assert "rgb_republish" not in process.output
    wait_for(lambda: "/record_" in heard(ros), what="the recording")
    time.sleep(1.0)
    assert process.stop() == 0
    assert f"{file}: 0.0 MB" in process.output
    with AnyReader([file]) as reader:
        assert {c.topic for c in reader.connections} == {"/motion_trigger"}
        assert reader.message_count > 2


def test_a_bag_of_so_many_seconds(ros, tmp_path: Path):
    process = record(ros, tmp_path / "short.bag", "--duration", "1", "--also", "/rosout")
    wait_for(lambda: process.popen.poll() is not None, what="the end of the recording")
    assert process.popen.returncode == 0
    with AnyReader([tmp_path / "short.bag"]) as reader:
        assert 0.2e9 < reader.duration < 3e9


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("night.txt", "a bag's name ends in .bag"),
        ("there.bag", "is there already: name another, or remove it"),
        ("nowhere/night.bag", "is no folder"),
    ],
)
def test_what_cannot_be_written_is_said(ros, tmp_path: Path, name: str, said: str):
    (tmp_path / "there.bag").touch()
    process = record(ros, tmp_path / name)
    process.says(said)
    wait_for(lambda: process.popen.poll() is not None)
    assert process.popen.returncode == 2


def test_without_a_master_it_says_so(ros, tmp_path: Path):
    command = [sys.executable, "-m", "rosbot_patrol.ros.tools.record_node", str(tmp_path / "night.bag")]
    process = Process(command, {**ros.env, "ROS_MASTER_URI": "http://localhost:9"})
    process.says("no ROS master answers at http://localhost:9")
