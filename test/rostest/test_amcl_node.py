"""amcl as a process before a real master, with a made-up room; needs the built workspace."""

import math
import subprocess

import numpy as np
import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Peer, wait_for

from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.map_io import write_map


@pytest.fixture
def room(tmp_path):
    """The yaml of a room of 4 m x 4 m."""
    cells = np.full((100, 100), -1, dtype=np.int8)
    cells[10:91, 10:91] = 100
    cells[11:90, 11:90] = 0
    info = GridInfo(resolution=0.05, width=100, height=100, origin_x=-2.525, origin_y=-2.525)
    write_map(str(tmp_path / "room"), Grid(info, cells))
    return tmp_path / "room.yaml"


def started(ros, room, *arguments):
    ros.node("map_server", str(room))
    node = ros.node("amcl", "_update_min_d:=0.1", "_initial_cov_xx:=0.01", "_initial_cov_yy:=0.01", *arguments)
    node.says("Received a 100 X 100 map", 20.0)
    return node, Peer(ros, "amcl_peer.py")


def test_it_localises_and_sends_a_correction_with_every_scan(ros, room):
    _, peer = started(ros, room)
    first = peer.do("drive", scans=5)
    assert first["poses"] == 1
    assert first["frame"] == "map"
    assert first["tf"] == 5
    assert first["parent"] == "map"
    driven = peer.do("drive", scans=20, step=0.05)
    assert driven["tf"] == 20
    assert 2 <= driven["poses"] <= 5  # every second of the updates at each 0.15 m
    assert abs(driven["odom"] + 5.0) < 0.2
    assert driven["particles"] >= 100


def test_bad_scans_are_named_and_survived(ros, room):
    node, peer = started(ros, room)
    peer.do("drive", scans=3)
    peer.do("drive", scans=2, broken="none")
    node.says("the scan of frame 'laser' is left out: it has no beams; no pose is published")
    peer.do("drive", scans=6, step=0.12, broken="nan")
    node.says("the scan of frame 'laser' is left out: its beams say nothing")
    peer.do("drive", scans=6, step=0.12, broken="inf")
    node.says("no beam of the scan of frame 'laser' measured anything")
    peer.do("drive", scans=2, broken="few")
    node.says("it has 20 beams, 180 before; it is taken as it is")
    peer.do("drive", scans=2, frame="nowhere")
    after = peer.do("drive", scans=10)
    assert after["tf"] >= 10
    assert peer.do("drive", scans=10, range_max=math.inf)["tf"] == 10
    assert node.popen.poll() is None


def test_services_and_initial_poses(ros, room):
    node, peer = started(ros, room)
    peer.do("drive", scans=3)
    peer.do("initialpose", x=0.7, frame="odom")
    node.says("initial pose is ignored: it is in frame 'odom', expected 'map'")
    peer.do("initialpose", x=0.7)
    placed = peer.do("drive", scans=1)
    assert abs(placed["pose"] - 0.7) < 0.1
    peer.do("call", service="request_nomotion_update")
    peer.do("drive", scans=1)
    peer.do("call", service="global_localization")
    assert peer.do("drive", scans=1)["var"] > 0.3


def test_health_a_late_scan_and_parameters_that_change(ros, room):
    _, peer = started(ros, room)
    peer.do("initialpose", x=0.0)  # an amcl before this one saved another
    peer.do("drive", scans=20, step=0.03)
    well = peer.do("wait_for_health", state="localised")
    assert well["state"] == "localised"
    assert well["belief"] > 0.8
    assert not well["turned"]
    assert peer.do("late_scan", ago=0.5)["tf"] == 0
    changed = peer.do("reconfigure", update_min_d=0.02, tf_broadcast=False, max_particles=300)
    assert changed["answer"]["update_min_d"] == 0.02
    driven = peer.do("drive", scans=8, step=0.03)
    assert driven["tf"] == 0
    assert driven["poses"] >= 3  # each second of the updates at each 0.03 m
    assert driven["particles"] <= 300


def test_a_search_by_hand_turns_the_robot(ros, room):
    node, peer = started(ros, room)
    peer.do("drive", scans=5)
    asked = peer.do("relocalize")
    assert asked["answer"]["success"]
    assert asked["turned"]
    node.says("searching the whole map")


def test_a_respawned_node_goes_on_where_it_was(ros, room):
    node, peer = started(ros, room, "_save_pose_rate:=5.0")
    peer.do("initialpose", x=0.5)
    peer.do("drive", scans=10)
    node.stop()
    ros.node("amcl").says("Received a 100 X 100 map", 20.0)
    assert abs(peer.do("drive", scans=2)["pose"] - 0.5) < 0.2


def test_a_pose_saved_in_another_run_is_not_taken(ros, room):
    node, peer = started(ros, room, "_save_pose_rate:=5.0")
    peer.do("initialpose", x=0.5)
    peer.do("drive", scans=10)
    node.stop()
    ask = ("rosparam", "get", "/amcl/saved_pose/stamp")
    stamp = float(subprocess.run(ask, env=ros.env, check=True, capture_output=True, text=True).stdout)
    later = ("rosparam", "set", "/amcl/saved_pose/stamp", str(stamp + 1e4))  # as if the clock had begun anew
    subprocess.run(later, env=ros.env, check=True)
    again = ros.node("amcl")
    again.says("Received a 100 X 100 map", 20.0)
    assert abs(peer.do("drive", scans=2)["pose"]) < 0.2
    again.says("is of another run")


def test_a_bad_parameter_is_named(ros):
    node = ros.node("amcl", "_laser_model_type:=sonar", "__name:=amcl_bad")
    node.says("/amcl_bad/laser_model_type: is 'sonar', expected one of beam, likelihood_field", 20.0)
    assert wait_for(lambda: node.popen.poll() is not None)
    assert node.popen.returncode == 1


def test_the_map_may_come_late_and_by_topic(ros, room):
    node = ros.node("amcl", "_use_map_topic:=true", "__name:=amcl_topic")
    peer = Peer(ros, "amcl_peer.py")
    assert peer.do("drive", scans=3)["tf"] == 0
    ros.node("map_server", str(room))
    node.says("Received a 100 X 100 map", 20.0)
    assert peer.do("drive", scans=3)["tf"] == 3
