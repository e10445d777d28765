"""Kill -9 in mid-drive: the base stands within half a second, and after the respawn the patrol goes on.

The last is the patrol itself, as it has just seen somebody: its verdict stands and one mail comes. The whole of it, at
random moments, is `rosrun rosbot_patrol campaign --crash 200`.
"""

from __future__ import annotations

import math
import os
import signal
import time
from pathlib import Path

import pytest

pytest.importorskip("rosbot_patrol.ros.campaign.house", reason="the workspace is not on the path: `. scripts/env`")
import rospy
from nav_msgs.msg import Odometry
from rosbot_patrol.msg import PatrolState

from rosbot_patrol.ros.campaign.house import House
from rosbot_patrol.ros.campaign.mail_sink import kept_mails
from rosbot_patrol.ros.campaign.ports import BRIDGES, free_port

pytestmark = pytest.mark.system

ROOM, ROOM_POINT = 5, (2.682, 7.352)
INTRUDER_AT = (4.8, 7.8)
VICTIMS = ("move_base", "amcl", "map_server")
STANDS_WITHIN = 0.5  # [s] by ground truth at 20 Hz, with the house in real time
STANDS_FOR = 4  # so many messages of 20 Hz on end: after that the patrol may turn the camera, which is its own wish
FAST, STANDING = 0.25, 0.01  # [m/s]
PATIENCE = 180.0  # [s] of wall time, for what is only waited for


class Speedometer:
    """Speeds of the base by ground truth: (stamp [s], [m/s])."""

    def __init__(self) -> None:
        self.heard: list[tuple[float, float]] = []
        self._subscriber = rospy.Subscriber("/ground_truth/odom", Odometry, self._on_truth, queue_size=50)

    def _on_truth(self, message: Odometry) -> None:
        twist = message.twist.twist
        speed = math.hypot(twist.linear.x, twist.linear.y) + 0.2 * abs(twist.angular.z)
        self.heard.append((message.header.stamp.to_sec(), speed))

    def is_fast(self) -> bool:
        return len(self.heard) > 5 and min(speed for _, speed in self.heard[-5:]) > FAST

    def stood_after(self, killed: float) -> float:
        """How long after a stamp it had come to stand [s]; infinite if it never did."""
        after = [(stamp, speed) for stamp, speed in self.heard if stamp > killed]
        for first in range(len(after) - STANDS_FOR + 1):
            if all(speed < STANDING for _, speed in after[first : first + STANDS_FOR]):
                return after[first][0] - killed
        return math.inf

    def stop(self) -> None:
        self._subscriber.unregister()


@pytest.mark.slow
def test_whoever_dies_in_mid_drive_the_base_stands_and_the_patrol_goes_on(master: object, folder: Path) -> None:
    stood: dict[str, float] = {}
    speed = Speedometer()
    with House(folder, bridge_port=free_port(BRIDGES), respawn_delay=2) as house:
        house.wait_ready(90.0)
        house.trigger(ROOM)
        for victim in VICTIMS:
            house.wait(speed.is_fast, PATIENCE, f"the robot driving, to kill {victim}")
            assert house.state is not None
            assert house.state.state == PatrolState.DRIVING
            pid = house.pids()[f"/{victim}"]
            house.wait(speed.is_fast, PATIENCE, "the robot driving still")
            killed = speed.heard[-1][0]
            os.kill(pid, signal.SIGKILL)
            time.sleep(1.2)  # it is not back yet
            stood[victim] = speed.stood_after(killed)
        house.spawn("burglar", *INTRUDER_AT)
        house.wait(lambda: bool(house.alerts), PATIENCE, "the alert")
        os.kill(house.pids()["/patrolling_node"], signal.SIGKILL)
        house.wait(lambda: house.state.state == PatrolState.LOOKING, PATIENCE, f"the arrival in room {ROOM}")
        assert house.pose is not None
        assert math.dist(house.pose[:2], ROOM_POINT) < 0.3
        house.wait(lambda: house.state.state == PatrolState.RETURNING, PATIENCE, "the end of the look around")
        assert house.state.verdict == "confirmed"
        house.wait(lambda: bool(kept_mails([house.maildir / "new"])), 20.0, "the mail")
        assert len(kept_mails([house.maildir / "new"])) == 1
        assert not [contact for contact in house.contacts if contact[0] != "floor"]
    speed.stop()
    assert {victim: took for victim, took in stood.items() if took > STANDS_WITHIN} == {}, stood
