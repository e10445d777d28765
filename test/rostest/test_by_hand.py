"""Programs that people type: without a master, or where nobody answers, each ends within seconds with one sentence."""

import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import free_port, wait_for

ROOT = Path(__file__).resolve().parents[2]
URDF = str(ROOT / "urdf" / "rosbot.urdf")
WALKS = f"_walks:={ROOT}/config/house_demo.yaml"
# Who needs others, and the exit status without a master.
TOOLS = {
    ("rosbot_patrol", "sensors"): 2,
    ("rosbot_patrol", "sensors", "--follow"): 2,
    ("rosbot_patrol", "record", "a.bag"): 2,
    ("rosbot_patrol", "narrator"): 1,
    ("rosbot_patrol", "narrator", "_exit_after_mission:=true", "_time_limit:=900"): 1,
    ("rosbot_patrol", "mark_rooms", "rooms.yaml"): 1,
    ("rosbot_patrol", "demo_intruder", WALKS): 1,
    ("map_server", "map_saver", "-f", "map"): 1,
    ("gazebo_ros", "spawn_model", "-urdf", "-file", URDF): 1,
    ("teleop_twist_keyboard", "teleop_twist_keyboard.py"): 1,
}
LONGEST = 40.0  # [s] for all of them at once on a busy machine; each waits 5 s at most


def program(package, name):
    for folder in os.environ["CMAKE_PREFIX_PATH"].split(":"):
        path = Path(folder, "lib", package, name)
        if path.exists():
            return [sys.executable, str(path)]
    raise AssertionError(f"{name} is not built")


def start(folder, uri, *words):
    package, name, *arguments = words
    environment = {**os.environ, "ROS_MASTER_URI": uri, "ROS_HOME": str(folder)}
    return subprocess.Popen(
        [*program(package, name), *arguments],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def ends(process, began):
    """Exit status and output of a process that has to end by itself."""
    try:
        output, _ = process.communicate(timeout=max(began + LONGEST - time.monotonic(), 0.1))
    except subprocess.TimeoutExpired:
        process.kill()
        raise AssertionError(f"{process.args} still waits: {process.communicate()[0]}") from None
    return process.returncode, output.strip()


def end_without_master(folder, uri):
    began = time.monotonic()
    processes = {words: start(folder, uri, *words) for words in TOOLS}
    for words, process in processes.items():
        status, output = ends(process, began)
        assert status == TOOLS[words], (words, output)
        assert output.count("\n") == 0, output
        yield words, output


def test_without_a_master_each_ends_with_a_sentence(tmp_path):
    uri = f"http://localhost:{free_port()}"
    for words, output in end_without_master(tmp_path, uri):
        name = words[1].removesuffix(".py")
        sentence = f"{name}: no ROS master answers at {uri}: start the launch file first, or set ROS_MASTER_URI"
        assert output == sentence


def test_a_port_that_never_answers_is_no_master(tmp_path):
    with socket.create_server(("localhost", 0)) as silent:
        uri = f"http://localhost:{silent.getsockname()[1]}"
        for _, output in end_without_master(tmp_path, uri):
            assert f"no ROS master answers at {uri}" in output


@pytest.mark.parametrize("uri", ["localhost:11311", "nonsense", ""])
def test_an_address_that_is_none(tmp_path, uri):
    status, output = ends(start(tmp_path, uri, "rosbot_patrol", "sensors"), time.monotonic())
    assert status == 2
    assert output.startswith("sensors: ")
    assert "expected http://HOST:PORT" in output
    assert "Traceback" not in output


@pytest.mark.parametrize(
    ("words", "status", "sentence"),
    [
        (("rosbot_patrol", "sensors"), 2, "nothing on /sensors/states within 5 s: is sensor_watch running?"),
        (("rosbot_patrol", "narrator"), 1, "nobody publishes /patrol/state: is patrol_robot running?"),
        (("rosbot_patrol", "demo_intruder", WALKS), 1, "nobody publishes /patrol/state: is patrol_robot running?"),
        (
            ("gazebo_ros", "spawn_model", "-urdf", "-file", URDF),
            1,
            "neither /gazebo/spawn_robot nor /simulator/spawn_robot is offered: is the simulator running?",
        ),
    ],
)
def test_with_a_master_but_nobody_else(ros, tmp_path, words, status, sentence):
    found, output = ends(start(tmp_path, ros.env["ROS_MASTER_URI"], *words), time.monotonic())
    assert found == status, output
    assert sentence in output


def test_what_roslaunch_starts_waits(tmp_path):
    words = ("rosbot_patrol", "narrator", f"__log:={tmp_path}/narrator.log")
    process = start(tmp_path, f"http://localhost:{free_port()}", *words)
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(7.0)
    process.kill()
    assert "no ROS master answers" not in process.communicate()[0]


def test_mark_rooms_says_that_no_map_comes(ros):
    process = ros.node("mark_rooms", "/tmp/rooms.yaml", stdin=subprocess.PIPE)
    wait_for(lambda: "no map has been published on /map yet" in process.output, 15.0, "the word")
