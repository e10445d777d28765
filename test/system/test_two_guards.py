"""Two guards on one master, each in a flat of its own: neither hears the other. Real patrol, navigation, simulator."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rosbot_patrol.ros.campaign.house", reason="the workspace is not on the path: `. scripts/env`")
import rosgraph
from rosbot_patrol.msg import PatrolState

from rosbot_patrol.alerts.records.query import Query, find_incidents
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.ros.campaign.house import House
from rosbot_patrol.ros.campaign.ports import BRIDGES, free_port

pytestmark = pytest.mark.system

ROOM, OTHER_ROOM = 3, 4
ROOM_POINT, OTHER_POINT = (3.00, 0.30), (-2.25, 0.15)
NEAR = 0.3  # [m]
AT_REST = 0.02  # [m]
SHARED = {"/rosout", "/rosout_agg", "/clock", "/diagnostics"}
# The guard without its camera and detector, which cost most of the time and are no part of what is shown.
REDUCED = {"house": "flat", "detector": "pc", "standby": "false", "teleop": "false", "look_around": "spin"}


class Guard:
    """A house, the bridge of its motion sensors, and what it did while the other was called."""

    def __init__(self, folder: Path, ns: str, **arguments: object) -> None:
        self.ns, self.state_dir = ns, folder / ns / "state"
        port = free_port(BRIDGES)
        self.house = House(folder / ns, ns=ns, bridge_port=port, rate=2.0, **REDUCED, **arguments)
        bridge = ["rosbot_patrol", "esp_connector.launch"]
        self.bridge = House(folder / f"{ns}-bridge", *bridge, plain=True, __ns=ns, bridge_port=port)

    def stays(self) -> StillStanding:
        """Check that the robot does nothing meanwhile."""
        return StillStanding(self.house)

    def rooms(self) -> list[int]:
        """Of the missions on record."""
        with IncidentStore(self.state_dir, read_only=True) as store:
            return [found.room_id for found in find_incidents(store.connection, store.path, Query())]


class StillStanding(contextlib.AbstractContextManager["StillStanding"]):
    """A house whose robot has nothing to do from beginning to end."""

    def __init__(self, house: House) -> None:
        self._house = house

    def __enter__(self) -> StillStanding:
        self._before = self._house.pose
        return self

    def __exit__(self, *error: object) -> None:
        if error[0] is None:
            assert self._house.state.state == PatrolState.IDLE
            assert math.dist(self._house.pose[:2], self._before[:2]) < AT_REST


@pytest.fixture
def guards(master: object, folder: Path) -> Iterator[tuple[Guard, Guard]]:
    first, second = Guard(folder, "robot1"), Guard(folder, "robot2", clock="false")
    with first.house, first.bridge:
        first.house.wait_ready(120.0)
        with second.house, second.bridge:
            second.house.wait_ready(120.0)
            yield first, second


def foreign_names(ns: str) -> list[str]:
    """Topics and services of one guard's nodes that lie outside its namespace."""
    inside = f"/{ns}/"
    published, subscribed, services = rosgraph.Master("/two_guards").getSystemState()
    return [
        f"{node}: {name}"
        for kind in (published, subscribed, services)
        for name, nodes in kind
        for node in nodes
        if node.startswith(inside) and not name.startswith(inside) and name not in SHARED
    ]


@pytest.mark.long
def test_two_guards_on_one_master_do_not_hear_each_other(guards: tuple[Guard, Guard]) -> None:
    first, second = guards
    with second.stays():
        mission = first.house.mission(ROOM)
    assert mission.arrival is not None
    assert math.dist(mission.arrival[:2], ROOM_POINT) < NEAR

    # The other one is called by a simulated motion sensor, through its own bridge.
    second.house.spawn("burglar", -1.5, -0.3)
    with first.stays():
        mission = second.house.mission(OTHER_ROOM, start=lambda: second.house.walk("burglar", [(-2.9, 0.55)], 0.5))
    assert mission.arrival is not None
    assert math.dist(mission.arrival[:2], OTHER_POINT) < NEAR

    assert foreign_names("robot1") == []
    assert foreign_names("robot2") == []
    assert (first.rooms(), second.rooms()) == ([ROOM], [OTHER_ROOM])
