"""A master of its own for each module, and nodes that end with each test."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

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
    master.set_param("/use_sim_time", True)
    return master


@pytest.fixture
def sim_ros(sim_master: Ros) -> Iterator[Ros]:
    """That master, its nodes ended and the simulator's parameters forgotten after each test."""
    yield sim_master
    sim_master.stop_nodes()
    sim_master.forget("/simulator")


@pytest.fixture(scope="session")
def patrol_master() -> Iterator[int]:
    """The master of the patrol's tests: rospy knows one in a process."""
    import patrol_house  # needs rospy

    with patrol_house.patrol_master() as port:
        yield port


@pytest.fixture
def house(patrol_master: int, tmp_path: Path) -> Iterator[Any]:
    """What surrounds patrol_robot: see patrol_house."""
    import patrol_house

    house = patrol_house.House(tmp_path)
    yield house
    house.close()
