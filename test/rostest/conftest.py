"""A master of its own for each module, and nodes that end with each test."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator

import pytest
from ros_processes import Ros


@pytest.fixture(scope="module")
def master() -> Iterator[Ros]:
    ros = Ros()
    yield ros
    ros.stop()


@pytest.fixture
def ros(master: Ros) -> Iterator[Ros]:
    yield master
    master.stop_nodes()


@pytest.fixture(scope="module")
def sim_master(master: Ros) -> Ros:
    """A master whose nodes live in simulated time."""
    subprocess.run(["rosparam", "set", "/use_sim_time", "true"], env=master.env, check=True)
    return master


@pytest.fixture
def sim_ros(sim_master: Ros) -> Iterator[Ros]:
    """That master, its nodes ended and the simulator's parameters forgotten after each test."""
    yield sim_master
    sim_master.stop_nodes()
    subprocess.run(["rosparam", "delete", "/simulator"], env=sim_master.env, stderr=subprocess.DEVNULL)
