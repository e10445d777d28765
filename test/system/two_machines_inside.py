"""The robot's host and the PC's; run by test_two_machines.py within the robot's network namespace.

robot, eth0, 10.78.0.1, fd78::1  ---  cable.py: 10 ms, 0.5 % lost, 20 Mbit/s  ---  eth0, 10.78.0.2, fd78::2, PC

Their names, robot and pc, stand in a hosts file of their own, for IPv4 or IPv6.
Roscore, simulator, navigation and patrol run on the robot; on the PC the sensors' bridge and the detector.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rospy
from darknet_ros_msgs.msg import ObjectCount
from diagnostic_msgs.msg import DiagnosticArray

from rosbot_patrol.ros.campaign.house import House, Master

CABLE = Path(__file__).with_name("cable.py")
QUALITY = ["--delay", "0.01", "--loss", "0.005", "--rate", "20e6"]
ROOM, INTRUDER = 1, (4.7, 0.2)
OTHER_ROOM, OTHER_INTRUDER = 2, (-4.6, -0.4)


def say(text: str) -> None:
    print(f"two machines: {text}", flush=True)


class Machines:
    """Two hosts and the cable between them; this process is on the robot's.

    Args:
        folder: for logs.
    """

    def __init__(self, folder: Path) -> None:
        self._holder = subprocess.Popen(["unshare", "-n", "sleep", "900"])
        self.enter = ["nsenter", "-t", str(self._holder.pid), "-n"]
        here = Path("/proc/self/ns/net").readlink()
        until(lambda: Path(f"/proc/{self._holder.pid}/ns/net").readlink() != here, 10.0, "the PC's namespace")
        command = [sys.executable, str(CABLE), str(self._holder.pid), *QUALITY]
        self._cable = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self._cable.stdout is not None
        assert self._cable.stdout.readline() == "ready\n"
        for before, last in (([], 1), (self.enter, 2)):
            for words in (
                f"addr add 10.78.0.{last}/24 dev eth0",
                f"addr add fd78::{last}/64 dev eth0 nodad",
                "link set eth0 up",
                "link set lo up",
            ):
                subprocess.run([*before, "ip", *words.split()], check=True)
        self.master = Master(folder / "roscore.log", "robot")
        rospy.set_param("/simulator/bridge_host", "pc")
        self._folder = folder
        self._house: House | None = None
        self.counts: list[tuple[float, str]] = []  # when a detector told of a picture, by the wall's clock, and which
        self.levels: dict[str, tuple[int, str]] = {}
        rospy.Subscriber("/darknet_ros/found_object", ObjectCount, self._count, queue_size=50)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._hear, queue_size=50)

    def start_pc(self) -> None:
        """What runs on the PC."""
        launch = "rosbot_patrol", "rosbot_patrol_pc.launch"
        self._house = House(self._folder / "pc", *launch, plain=True, before=self.enter, network="house")
        self._house.start({"ROS_HOSTNAME": "pc"})

    def cable(self, order: str) -> None:
        """`cut` it or `plug` it in."""
        assert self._cable.stdin is not None
        assert self._cable.stdout is not None
        self._cable.stdin.write(order + "\n")
        self._cable.stdin.flush()
        say(self._cable.stdout.readline().strip())

    def pictures(self, seconds: float) -> dict[str, float]:
        """Pictures a second of each detector, over some seconds from now."""
        begin = time.monotonic()
        time.sleep(seconds)
        names = [name for at, name in self.counts if at >= begin]
        return {name: names.count(name) / seconds for name in sorted(set(names))}

    def stop(self) -> None:
        if self._house is not None:
            self._house.stop()
        self.master.stop()
        self._cable.kill()
        self._holder.kill()

    def _count(self, message: ObjectCount) -> None:
        self.counts.append((time.monotonic(), message._connection_header["callerid"]))

    def _hear(self, message: DiagnosticArray) -> None:
        self.levels.update({status.name: (status.level, status.message) for status in message.status})


def until(condition: Callable[[], bool], seconds: float, what: str) -> float:
    begin = time.monotonic()
    while not condition():
        assert time.monotonic() - begin < seconds, f"{what} did not come within {seconds} s"
        time.sleep(0.05)
    return time.monotonic() - begin


@pytest.fixture
def machines(tmp_path: Path) -> Iterator[Machines]:
    made = Machines(tmp_path)
    yield made
    made.stop()


def mission(house: House) -> None:
    """Somebody walks past the room's sensor, is confirmed and mailed."""
    mails = len(house.mails())
    house.spawn("burglar", INTRUDER[0] + 0.4, INTRUDER[1] + 0.3)
    seen = house.mission(ROOM, start=lambda: house.walk("burglar", [INTRUDER], speed=0.4))
    assert seen.verdict == "confirmed", seen.why
    until(lambda: len(house.mails()) == mails + 1, 30.0, "the mail")
    house.remove("burglar")


def test_the_chain_and_the_cut_cable(machines: Machines, tmp_path: Path) -> None:
    machines.start_pc()
    with House(tmp_path / "robot", detector="pc") as house:
        say(f"on guard after {house.wait_ready(120.0):.1f} s")
        mission(house)
        rates = machines.pictures(10.0)
        say(f"pictures a second of each detector: {rates}")
        assert list(rates) == ["/darknet_ros"]

        machines.cable("cut")
        took = until(lambda: "/darknet_ros_standby" in dict(map(reversed, machines.counts[-3:])), 30.0, "the stand-in")
        say(f"cut: the robot's own detector looks at pictures after {took:.1f} s")
        level = next(value for name, value in machines.levels.items() if "standing in" in name)
        assert level[0] == 1, machines.levels
        say(f"/diagnostics: {level[1]}")
        house.spawn("burglar", *OTHER_INTRUDER)
        seen = house.mission(OTHER_ROOM)  # by hand: the sensors' bridge is beyond the cable
        assert seen.verdict == "confirmed", seen.why
        house.remove("burglar")

        machines.cable("plug")
        took = until(lambda: {name for _, name in machines.counts[-5:]} == {"/darknet_ros"}, 120.0, "the PC's detector")
        say(f"plugged in: the PC's detector is back after {took:.1f} s")
        mission(house)


def test_the_chain(machines: Machines, tmp_path: Path) -> None:
    machines.start_pc()
    with House(tmp_path / "robot", detector="pc") as house:
        say(f"on guard after {house.wait_ready(120.0):.1f} s")
        mission(house)
        say(f"pictures a second of each detector: {machines.pictures(10.0)}")
