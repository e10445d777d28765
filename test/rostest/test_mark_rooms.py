"""mark_rooms as a process: clicks by topic, names on its standard input, the file that comes of it."""

import subprocess

import numpy as np
import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import wait_for

from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.map_io import write_map
from rosbot_patrol.patrol.house.rooms import load_rooms


@pytest.fixture
def clicks(ros, tmp_path):
    """A map of 5 x 4 m with a wall at x = 3, and who clicks on it."""
    cells = np.zeros((80, 100), np.int8)
    cells[:, 60] = cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = 100
    write_map(str(tmp_path / "flat"), Grid(GridInfo(resolution=0.05, width=100, height=80), cells))
    ros.node("map_server", str(tmp_path / "flat.yaml")).says("Read a", 20.0)
    probe = ros.probe()
    probe.tell(advertise=["/clicked_point", "geometry_msgs/PointStamped"])

    def click(x, y, frame="map"):
        probe.tell(publish=["/clicked_point", {"header": {"frame_id": frame}, "point": {"x": x, "y": y, "z": 0.0}}])

    click.probe = probe
    return click


def marker(ros, *arguments):
    process = ros.node("mark_rooms", *arguments, stdin=subprocess.PIPE)

    def answer(text):
        process.popen.stdin.write(text + "\n")
        process.popen.stdin.flush()

    process.answer = answer
    return process


def rooms_of(path):
    return [(room.id, room.name, room.pose.x, room.pose.y) for room in load_rooms(path)] if path.exists() else []


def test_clicks_become_a_points_file_that_can_be_added_to(ros, clicks, tmp_path):
    path = tmp_path / "points.yaml"
    first = marker(ros, str(path))
    first.says("Click on the base")
    clicks(1.0, 1.0, "nowhere")
    first.says("the click is left out")
    clicks(1.0, 1.0)
    first.answer("base")
    first.says("room 0 (base) at (1.00, 1.00)")
    clicks(4.0, 1.0)
    first.says("(4.00, 1.00) is left out: no way leads there from room 0 (base)")
    clicks(3.04, 1.0)
    first.says(
        "(3.04, 1.00) is left out: it is 0.05 m from the nearest thing, and the robot needs 0.20 m to turn; the nearest"
    )
    clicks(2.0, 3.0)
    first.answer("base")
    first.says("room 0 (base) has that name; another one?")
    first.answer("Küche")
    first.says("room 1 (Küche) at (2.00, 3.00) is in")
    clicks(2.0, 2.0)
    first.answer("")
    first.says("left out")
    assert rooms_of(path) == [(0, "base", 1.0, 1.0), (1, "Küche", 2.0, 3.0)]
    first.popen.stdin.close()
    clicks(2.0, 2.0)
    wait_for(lambda: first.popen.poll() is not None, 20.0, "the end of mark_rooms")
    assert first.popen.returncode == 0
    assert "2 points in" in first.output

    second = marker(ros, str(path))
    second.says("Click on room 2")
    clicks(2.0, 2.0)
    second.answer("hall")
    second.says("room 2 (hall)")
    assert [name for _, name, _, _ in rooms_of(path)] == ["base", "Küche", "hall"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [((), "expected mark_rooms [--new] FILE"), (("/nowhere/points.yaml",), "there is no folder /nowhere")],
)
def test_arguments_that_make_no_sense(ros, arguments, says):
    process = marker(ros, *arguments)
    process.says(says, 20.0)
    wait_for(lambda: process.popen.poll() is not None, 20.0, "the end of mark_rooms")
    assert process.popen.returncode == 1
