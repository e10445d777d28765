"""A launch file written the tutorial's way comes up on our drop-ins and patrols; its commands run as typed."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path

import pytest

pytest.importorskip("rosbot_patrol.ros.campaign.house", reason="the workspace is not on the path: `. scripts/env`")
from rosbot_patrol.ros.campaign.house import House

pytestmark = pytest.mark.system

DATA = Path(__file__).parent / "data"
TRIGGER = "id: 1\nmove: 1"  # as the tutorial types it


def publish(message_type: str) -> None:
    subprocess.run(["rostopic", "pub", "-1", "/motion_trigger", message_type, TRIGGER], check=True, timeout=30)


@pytest.mark.slow
@pytest.mark.parametrize("message_type", ["rosbot_patrol_simulation/EspTrigger"])
def test_the_tutorials_launch_file_patrols(master: object, folder: Path, message_type: str) -> None:
    house = House(folder, str(DATA / "tutorial.launch"), plain=True)
    house.start({"ROS_HOME": str(folder)})
    try:
        house.wait_ready(90.0)
        mission = house.mission(1, timeout=400.0, start=lambda: publish(message_type))
        assert mission.verdict == "clear"
        assert mission.arrival is not None
        assert math.dist(mission.arrival[:2], (2.819, -0.175)) < 0.3
        assert mission.contacts == []

        subprocess.run(["rosrun", "map_server", "map_saver", "-f", "rosbot_map"], check=True, cwd=folder, timeout=60)
        assert (
            (folder / "rosbot_map.pgm")
            .read_bytes()
            .startswith(b"P5\n# CREATOR: map_saver.cpp 0.050 m/pix\n1984 1984\n255\n")
        )
        assert "image: rosbot_map.pgm" in (folder / "rosbot_map.yaml").read_text()
    finally:
        house.stop()
