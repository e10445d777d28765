"""The house through a robot's drivers (`simulation:=hardware`): lidar, base and camera on their emulated wires."""

from __future__ import annotations

import math
import threading
import time
from pathlib import Path

import pytest

pytest.importorskip("rosbot_patrol.ros.campaign.house", reason="the workspace is not on the path: `. scripts/env`")
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from rosbot_patrol.srv import SetFault

from rosbot_patrol.ros.campaign.house import House, Mission
from rosbot_patrol.ros.campaign.ports import BRIDGES, free_port

pytestmark = pytest.mark.system

ROOM, INTRUDER_AT = 1, (4.7, 0.2)
PULLED = 4.0  # [s] that each plug is out


def house_of(folder: Path) -> House:
    return House(
        folder,
        simulation="hardware",
        bridge_port=free_port(BRIDGES),
        camera_port=free_port(),
        hardware_folder=str(folder / "devices"),
    )


def check_home(mission: Mission) -> None:
    assert mission.end is not None
    assert math.hypot(mission.end.x, mission.end.y) < 0.25
    assert not [contact for contact in mission.contacts if contact[0] != "floor"]


@pytest.mark.slow
def test_an_intruder_is_found_through_the_drivers_of_a_robot(master: object, folder: Path) -> None:
    with house_of(folder) as house:
        house.wait_ready(90.0)
        house.spawn("burglar", *INTRUDER_AT)
        mission = house.mission(ROOM, timeout=600.0)
        assert mission.verdict == "confirmed"
        check_home(mission)
        house.wait(lambda: any(alert.delivered for alert in house.alerts), 30.0, "the delivery of the mail")
        assert len(house.mails()) == 1


@pytest.mark.long
def test_plugs_that_are_pulled_in_a_mission_are_told_and_it_goes_on(master: object, folder: Path) -> None:
    told: list[str] = []
    subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, lambda m: told.extend(s.message for s in m.status))
    with house_of(folder) as house:
        house.wait_ready(90.0)
        mission = house.mission(1, timeout=600.0, start=lambda: trigger_and_pull(house))
        assert mission.verdict == "clear"
        check_home(mission)
    subscriber.unregister()
    for words in ("lost: ", "silent for", "cannot be reached"):  # rplidarNode, the filter, the camera
        assert any(words in text for text in told), words


def trigger_and_pull(house: House) -> None:
    """Call for room 1, and pull one plug after the other meanwhile."""
    set_fault = rospy.ServiceProxy(house.name("simulator/set_fault"), SetFault)

    def pull() -> None:
        for kind in ("lidar_silent", "base_silent", "camera_silent"):
            time.sleep(2.0 * PULLED)
            set_fault(kind=kind, target="", values="", duration=PULLED)

    house.trigger(1)
    threading.Thread(target=pull, daemon=True).start()
