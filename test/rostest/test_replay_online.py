"""Our bags played by rosbag to the real nodes: what they publish is what the same bags give offline."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xmlrpc.client import ServerProxy

import numpy as np
import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import HERE, Process, Ros, wait_for
from rosbags.highlevel import AnyReader

from rosbot_patrol.geometry import wrap_angles
from rosbot_patrol.package_files import package_file
from rosbot_patrol.replay.bags.bag import Bag
from rosbot_patrol.replay.case import SUFFIX, read_case, run_case
from rosbot_patrol.replay.nodes.setup import node_of, read_parameters
from rosbot_patrol.replay.results.tables import Result

BAGS = HERE.parent / "replay"
FIRST = 131.53  # the end of the first mission in patrol.bag [s]; the next begins within a tenth of a second
LATE = 3.0  # a node of a busy machine may say a thing so much later than its replay [s]


class Online:
    """A bag played to a node, and what the node says of it.

    Args:
        ros: a master in simulated time.
        bag: that is played.
        heard: topics of the bag that are played.
        said: topics that are recorded.
    """

    def __init__(self, ros: Ros, bag: Path, folder: Path, *, heard: list[str], said: list[str]) -> None:
        self.ros, self.bag, self.heard, self.said, self.out = ros, bag, heard, said, folder / "said.bag"
        self.recorder = self._start("rosbag", "record", "--quiet", "-O", str(self.out), *said)

    def _start(self, *command: str) -> Process:
        process = Process(list(command), self.ros.env)
        self.ros.processes.append(process)
        return process

    def _is_recorded(self) -> bool:
        """Whether of each topic that is recorded a publisher has the recorder among its links (Slave API)."""
        master: Any = ServerProxy(self.ros.env["ROS_MASTER_URI"])
        links = set()
        for publisher in {
            name for topic, names in master.getSystemState("/test")[2][0] if topic in self.said for name in names
        }:
            node: Any = ServerProxy(master.lookupNode("/test", publisher)[2])
            links |= {row[4] for row in node.getBusInfo("/test")[2] if row[1].startswith("/record_") and row[2] == "o"}
        return links.issuperset(self.said)

    def play(self, *remaps: str, rate: float = 4.0, linger: float = 2.0) -> Bag:
        """Play it, all who hear it and the recorder being there; what was said, with the bag's clock."""
        wait_for(self._is_recorded, 60.0, f"the recorder's link to {self.said}")
        arguments = ["--clock", "--hz", "200", "--quiet", "-r", str(rate), "--wait-for-subscribers"]
        play = self._start("rosbag", "play", str(self.bag), *arguments, "--topics", *self.heard, *remaps)
        with Bag(self.bag) as bag:
            seconds = bag.duration / rate + 60.0
        wait_for(lambda: play.popen.poll() is not None, seconds, "the end of the bag")
        assert play.popen.returncode == 0, play.output
        time.sleep(linger)
        self.recorder.stop()
        wait_for(self.out.exists, 30.0, "the recorder's bag")  # rosbag does not wait for its child, which writes it
        return Bag(self.out)


def offline(case: str) -> Result:
    return run_case(read_case(BAGS / f"{case}{SUFFIX}"))


def parameters(ros: Ros, case: str, name: str, **others: Any) -> None:
    """Those of a case, for a node."""
    setup = read_case(BAGS / f"{case}{SUFFIX}").setup
    tree = setup.tree or read_parameters(package_file(node_of(setup.node).config), setup.node)
    for key, value in {**tree, **others}.items():
        subprocess.run(["rosparam", "set", f"/{name}/{key}", json.dumps(value)], env=ros.env, check=True)


def nearest(stamps: np.ndarray, others: np.ndarray) -> np.ndarray:
    """For each stamp the index of the other that is nearest."""
    return np.abs(others[None, :] - stamps[:, None]).argmin(axis=1)


@pytest.mark.long
def test_amcl_goes_the_same_way(sim_ros: Ros, tmp_path: Path) -> None:
    parameters(sim_ros, "room_amcl", "amcl", use_map_topic=True)
    node = sim_ros.node("amcl", "__name:=amcl")
    topics = ["/scan", "/tf", "/tf_static", "/map", "/initialpose"]
    with Online(sim_ros, BAGS / "room.bag", tmp_path, heard=topics, said=["/amcl_pose"]).play() as said:
        records = [record.content for record in said.records(["/amcl_pose"])]
    assert node.popen.poll() is None
    expected = offline("room_amcl").tables["poses"]
    stamps = np.array([record.stamp for record in records])
    assert len(stamps) >= 0.9 * len(expected["stamp"])
    k = nearest(stamps, expected["stamp"])
    same = np.abs(expected["stamp"][k] - stamps) < 1e-3
    assert same.mean() >= 0.9  # it moved on with the same scans
    there = np.array([record.pose for record in records])
    off = np.hypot(there[:, 0] - expected["x"][k], there[:, 1] - expected["y"][k])[same]
    assert np.median(off) < 0.03
    assert off[3:].max() < 0.1  # the first are drawn about the wide initial pose
    assert off.max() < 0.4
    assert np.abs(wrap_angles(there[:, 2] - expected["yaw"][k]))[same].max() < 0.05


@pytest.mark.long
def test_slam_gmapping_makes_the_same_map(sim_ros: Ros, tmp_path: Path) -> None:
    parameters(sim_ros, "room_slam", "slam_gmapping")
    node = sim_ros.node("slam_gmapping", "__name:=slam_gmapping")
    topics = ["/scan", "/tf", "/tf_static"]
    with Online(sim_ros, BAGS / "room.bag", tmp_path, heard=topics, said=["/map"]).play() as said:
        last = [record.content.grid for record in said.records(["/map"])][-1]
    assert node.popen.poll() is None
    expected = offline("room_slam").grids["map"]
    found = set(map(tuple, walls(last)))
    wanted = set(map(tuple, walls(expected)))
    assert len(found & wanted) >= 0.85 * max(len(found), len(wanted))


def walls(grid: Any) -> np.ndarray:
    """Cells that are occupied, by their place in steps of a cell, shape (N, 2)."""
    iy, ix = np.nonzero(grid.cells == 100)
    i = grid.info
    return np.column_stack((np.rint(ix + i.origin_x / i.resolution), np.rint(iy + i.origin_y / i.resolution)))


@pytest.mark.long
def test_the_patrol_decides_the_same(sim_ros: Ros, tmp_path: Path) -> None:
    first = tmp_path / "first.bag"
    which = f"topic != '/motion_trigger' or t.to_sec() < {FIRST}"
    subprocess.run(["rosbag", "filter", str(BAGS / "patrol.bag"), str(first), which], check=True, capture_output=True)
    mine = {"path_to_params": str(BAGS / "patrol_rooms.yaml"), "state_dir": str(tmp_path / "state"), "image_topic": ""}
    mail = {"maildir": str(tmp_path / "mail"), "transport": "maildir", "network": "house"}
    parameters(sim_ros, "patrol", "patrolling_node", **mine, **mail)
    base = Process(["/usr/bin/python3", str(HERE / "bag_move_base.py")], sim_ros.env)
    sim_ros.processes.append(base)
    base.says("ready")
    node = sim_ros.node("patrol_robot", "__name:=patrolling_node")
    topics = ["/tf", "/tf_static", "/motion_trigger", "/move_base/result"]
    topics += ["/darknet_ros/bounding_boxes", "/darknet_ros/found_object"]
    online = Online(sim_ros, first, tmp_path, heard=topics, said=["/patrol/state", "/move_base/goal"])
    with online.play("/move_base/result:=/recorded/result", rate=2.0) as said:
        heard = list(raw(said.path))
    assert node.popen.poll() is None, node.output
    expected = offline("patrol").tables
    goals = [message.goal.target_pose.pose.position for _, topic, message in heard if topic == "/move_base/goal"]
    sent = [expected["goals"][name][expected["goals"]["stamp"] < FIRST].tolist() for name in ("x", "y")]
    assert [(round(goal.x, 3), round(goal.y, 3)) for goal in goals] == list(zip(*sent, strict=True))
    states = [(at, m.state, m.room_id, m.last_verdict) for at, topic, m in heard if topic == "/patrol/state"]
    rows = expected["reports"]
    columns = [rows[name][rows["stamp"] < FIRST].tolist() for name in ("stamp", "state", "room", "last_verdict")]
    found, wanted = turns_of_events(states), turns_of_events(list(zip(*columns, strict=True)))
    assert [what for _, *what in found] == [what for _, *what in wanted]
    late = [at - when for (at, *_), (when, *_) in zip(found, wanted, strict=True)]
    assert max(map(abs, late[1:])) < LATE, late  # its first word is said when it begins


def turns_of_events(states: list[tuple[float, str, int, str]]) -> list[tuple[float, str, int, str]]:
    """The first of each run of states that say the same but for their time."""
    return [state for i, state in enumerate(states) if i == 0 or state[1:] != states[i - 1][1:]]


def raw(path: Path) -> Iterator[tuple[float, str, Any]]:
    """Time [s], topic and message of all that is in a bag."""
    with AnyReader([path]) as reader:
        for connection, stamp, data in reader.messages():
            yield stamp * 1e-9, connection.topic, reader.deserialize(data, connection.msgtype)
