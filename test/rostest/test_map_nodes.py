"""map_server and map_saver as processes before a real master; needs the built workspace."""

import numpy as np
import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import wait_for

from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.map_io import write_map

INFO = GridInfo(resolution=0.05, width=30, height=20, origin_x=-1.0, origin_y=-2.0)


@pytest.fixture
def first(tmp_path):
    cells = np.random.default_rng(0).choice(np.array([-1, 0, 100], dtype=np.int8), INFO.shape)
    write_map(str(tmp_path / "first"), Grid(INFO, cells))
    return tmp_path / "first.yaml"


def exit_code(process):
    wait_for(lambda: process.popen.poll() is not None, 20.0, "the end of the program")
    return process.popen.returncode


def test_a_map_goes_round_byte_for_byte(ros, first, tmp_path):
    ros.node("map_server", str(first)).says("Read a 30 X 20 map @ 0.050 m/cell", 20.0)
    saver = ros.node("map_saver", "-f", str(tmp_path / "again"))
    assert exit_code(saver) == 0
    assert (tmp_path / "again.pgm").read_bytes() == (tmp_path / "first.pgm").read_bytes()
    yaml = (tmp_path / "again.yaml").read_text()
    assert yaml == (tmp_path / "first.yaml").read_text().replace("first", "again")


def test_map_saver_crops(ros, tmp_path):
    cells = np.full(INFO.shape, -1, dtype=np.int8)
    cells[8:12, 10:20] = 0
    write_map(str(tmp_path / "wide"), Grid(INFO, cells))
    ros.node("map_server", str(tmp_path / "wide.yaml")).says("Read a", 20.0)
    saver = ros.node("map_saver", "--crop", "0.1", "-f", str(tmp_path / "cropped"))
    saver.says("Its known part has 14 X 8 cells", 20.0)
    assert exit_code(saver) == 0
    assert "origin: [-0.600000, -1.700000, 0.000000]" in (tmp_path / "cropped.yaml").read_text()
    saver = ros.node("map_saver", "--crop", "-1")
    saver.says("is -1.0, expected the margin in metres, 0 or more", 20.0)
    assert exit_code(saver) == 1


def test_map_saver_waits_on_the_topic_it_is_given(ros, first, tmp_path):
    saver = ros.node("map_saver", "-f", str(tmp_path / "late"), "map:=/other/map")
    saver.says("Waiting for the map on /other/map", 20.0)
    ros.node("map_server", str(first), "map:=/other/map")
    assert exit_code(saver) == 0
    assert (tmp_path / "late.pgm").exists()


def test_a_map_as_python_makes_it_is_saved(ros, tmp_path):
    """Its origin's orientation is (0, 0, 0, 0)."""
    probe = ros.probe()
    probe.tell(advertise=["/made", "nav_msgs/OccupancyGrid"])
    saver = ros.node("map_saver", "-f", str(tmp_path / "made"), "map:=/made")

    def is_saved():
        probe.tell(publish=["/made", {"info": {"resolution": 0.05, "width": 2, "height": 1}, "data": [0, 100]}])
        return saver.popen.poll() is not None

    wait_for(is_saved, 20.0, "the end of map_saver")
    saver.says("a map's origin is (0, 0, 0, 0), no quaternion: a heading of 0 is taken")
    assert "origin: [0.000000, 0.000000, 0.000000]" in (tmp_path / "made.yaml").read_text()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("resolution", "resolute"), "key 'resolution' is missing"),
        (("first.pgm", "gone.pgm"), "gone.pgm: the map's picture cannot be read: No such file"),
        (("]", ""), "is no valid yaml"),
    ],
)
def test_a_broken_map_ends_the_program_with_a_sentence(ros, first, change, says):
    first.write_text(first.read_text().replace(*change))
    server = ros.node("map_server", str(first))
    server.says(says, 20.0)
    assert exit_code(server) == 1


@pytest.mark.parametrize(
    ("arguments", "says"),
    [((), "expected `map_server FILE.yaml`"), (("a.pgm", "fine"), "'fine' is no resolution")],
)
def test_arguments_that_make_no_sense(ros, arguments, says):
    server = ros.node("map_server", *arguments)
    server.says(says, 20.0)
    assert exit_code(server) == 1


def test_map_saver_names_a_folder_that_is_not_there(ros, first, tmp_path):
    ros.node("map_server", str(first)).says("Read a", 20.0)
    (tmp_path / "file").write_text("")
    saver = ros.node("map_saver", "-f", str(tmp_path / "file" / "map"))
    saver.says("cannot be written", 20.0)
    assert exit_code(saver) == 1
