"""slam_gmapping as a process before a real master, with a made-up room; needs the built workspace."""

import math

import numpy as np
import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Peer, wait_for

from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.map_io import write_map

SMALL = ("_xmin:=-8", "_ymin:=-8", "_xmax:=8", "_ymax:=8", "_particles:=5", "_linearUpdate:=0.08")


def until_map(peer):
    """Scans from one place until the first map is there, and what was said then."""
    return wait_for(lambda: (said := peer.do("drive", scans=2))["maps"] and said, 30.0, "the first map")


def started(ros, *arguments):
    node = ros.node("slam_gmapping", *SMALL, *arguments)
    node.says("Mapping 320 X 320 cells @ 0.050 m with 5 particles")
    return node, Peer(ros, "gmapping_peer.py")


def test_it_maps_and_corrects_the_odometry(ros):
    node, peer = started(ros, "_map_update_interval:=0.2", "_transform_publish_period:=0.02")
    first = until_map(peer)
    assert first["frame"] == "map"
    assert first["size"] == [320, 320]
    assert first["origin"] == [-8.0, -8.0]
    assert first["infos"] >= 1
    assert 100 < first["walls"] < 600
    assert first["free"] > 3000
    assert first["entropy"] == pytest.approx(math.log(5))
    driven = peer.do("drive", scans=12, step=0.1, slip=0.02)
    assert driven["maps"] >= 2
    assert driven["tf"] > 30
    assert driven["parent"] == "map"
    assert driven["ahead"] > -0.6
    assert abs(driven["odom"] + 0.2) < 0.08  # the wheels slipped by 0.22 m in all
    assert peer.do("call")["answer"] == [320, 320, 320 * 320]
    assert node.popen.poll() is None


def test_bad_scans_are_named_and_survived(ros):
    node, peer = started(ros, "__name:=slam_gmapping")
    assert "there is no map yet" in peer.do("call")["answer"]
    until_map(peer)
    peer.do("drive", scans=2, broken="none")
    node.says("the scan of frame 'laser' is left out: it has no beams; nothing is mapped")
    peer.do("drive", scans=3, step=0.12, broken="nan")
    node.says("the scan of frame 'laser' is left out: its beams say nothing")
    peer.do("drive", scans=3, step=0.12, broken="inf")
    node.says("no beam of the scan of frame 'laser' measured anything")
    peer.do("drive", scans=2, broken="few")
    node.says("it has 90 beams, 180 before; it is taken as it is")
    peer.do("drive", scans=2, back=3.0)
    wait_for(lambda: peer.do("drive", scans=10, frame="tilted") and "the laser 'tilted' is tilted by" in node.output)
    assert peer.do("drive", scans=2)["tf"] > 0
    assert node.popen.poll() is None


def test_a_saved_map_is_gone_on_with(ros, tmp_path):
    cells = np.full((160, 160), -1, dtype=np.int8)
    cells[38:122, 38:122] = 100
    cells[40:120, 40:120] = 0
    info = GridInfo(resolution=0.05, width=160, height=160, origin_x=-3.5, origin_y=-4.0)
    write_map(str(tmp_path / "room"), Grid(info, cells))  # the room stands half a metre off
    node, peer = started(ros, f"_map_file:={tmp_path}/room.yaml", "_initial_pose_x:=0.45")
    node.says("Going on with the map", 20.0)
    until_map(peer)
    said = peer.do("drive", scans=4)
    assert abs(said["odom"] - 0.5) < 0.06


@pytest.mark.parametrize(
    ("argument", "sentence"),
    [
        ("_particles:=0", "particles: is 0, expected at least 1"),
        ("_xmin:=20", "expected xmin < xmax"),
        ("_map_file:=/nowhere.yaml", "/nowhere.yaml"),
    ],
)
def test_a_bad_parameter_is_named(ros, argument, sentence):
    node = ros.node("slam_gmapping", *(a for a in SMALL if a[:6] != argument[:6]), argument, "__name:=slam_bad")
    node.says(sentence, 20.0)
    assert wait_for(lambda: node.popen.poll() is not None)
    assert node.popen.returncode == 1
