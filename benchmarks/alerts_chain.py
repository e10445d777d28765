"""Delays from a sensor's edge to the goal, and from a visible person to the notice on disk and the mail at the server.

It runs patrol_robot, the rosserial bridge, a virtual ESP32 over TCP, an action server `move_base` and a real SMTP
server (aiosmtpd) with a roscore of their own. This program is camera and detector. It sends pictures of 640 x 480 at 10
Hz, and the boxes of each after the time that our network takes on two cores. The patrol's parameters are the shipped
ones, except those that make it drive and turn fast, and `mail_interval`, which would delay the next mail.

- edge_to_goal_s: from the rise of the sensor's output to the goal at the action server (move_base/goal).
- seen_to_disk_s: from the first picture with the person to the patrol's report that the notice is on disk.
- seen_to_mail_s: from the same picture to the server's 250 after the whole mail.
"""

from __future__ import annotations

import itertools
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

from rosserial import HERE, Bridge, free_port, program

ROOT = HERE.parent
sys.path.insert(0, str(ROOT / "test" / "process" / "alerts"))

MISSIONS = 15
PICTURES = 10.0  # [Hz]
DETECTION = 0.06  # from a picture to its boxes [s]
PATROL = {
    "path_to_params": ROOT / "params" / "room_points.yaml",
    "transport": "smtp",
    "email_to": "owner@example.org",
    "mail_interval": 0,
    "spin_speed": 2.5,
    "spin_deceleration": 3.0,
    "detector_wait": 1.5,
    "linger": 0.3,
    "look_around": "spin",
}


class Senses:
    """Camera and detector, and the messages of patrol and action server."""

    def __init__(self) -> None:
        import rospy
        from darknet_ros_msgs.msg import BoundingBoxes, ObjectCount
        from move_base_msgs.msg import MoveBaseActionGoal
        from rosbot_patrol.msg import Alert, PatrolState
        from sensor_msgs.msg import Image

        self.person = False
        self.appeared = self.goal_at = self.on_disk_at = 0.0
        self.state = ""
        self._image = rospy.Publisher("/camera/rgb/image_raw", Image, queue_size=1)
        self._boxes = rospy.Publisher("/darknet_ros/bounding_boxes", BoundingBoxes, queue_size=1)
        self._count = rospy.Publisher("/darknet_ros/found_object", ObjectCount, queue_size=1)
        rospy.Subscriber("/move_base/goal", MoveBaseActionGoal, self._on_goal, tcp_nodelay=True)
        rospy.Subscriber("/patrol/alerts", Alert, self._on_alert, tcp_nodelay=True)
        rospy.Subscriber("/patrol/state", PatrolState, self._on_state, tcp_nodelay=True)
        threading.Thread(target=self._see, daemon=True).start()

    def _on_goal(self, message: object) -> None:
        self.goal_at = self.goal_at or time.monotonic()

    def _on_alert(self, message) -> None:
        if message.kind == "seen":
            self.on_disk_at = self.on_disk_at or time.monotonic()

    def _on_state(self, message) -> None:
        self.state = message.state

    def _see(self) -> None:
        import rospy
        from darknet_ros_msgs.msg import BoundingBox, BoundingBoxes, ObjectCount
        from sensor_msgs.msg import Image

        pictures = [bytes([shade]) * (640 * 480 * 3) for shade in range(60, 90)]
        due = time.monotonic()
        for data in itertools.cycle(pictures):
            due += 1.0 / PICTURES
            time.sleep(max(due - time.monotonic(), 0.0))
            image = Image(width=640, height=480, encoding="rgb8", step=1920, data=data)
            image.header.stamp = rospy.Time.now()
            person = self.person
            if person and not self.appeared:
                self.appeared = time.monotonic()
            self._image.publish(image)
            time.sleep(DETECTION)
            self._count.publish(ObjectCount(count=int(person)))
            if person:
                box = BoundingBox(probability=0.9, xmin=250, ymin=60, xmax=390, ymax=470, Class="person")
                self._boxes.publish(BoundingBoxes(image_header=image.header, bounding_boxes=[box]))


def measure(missions: int = MISSIONS) -> dict[str, float]:
    from real_smtp import RealSmtp

    from rosbot_patrol.ros.campaign.house import Master
    from rosbot_patrol.rosserial.device.tcp_client import EspClient

    with tempfile.TemporaryDirectory(prefix="alerts-") as name:
        folder = Path(name)
        master, server = Master(folder / "roscore.log"), RealSmtp()
        senses, port = Senses(), free_port()
        patrol = {**PATROL, "smtp_port": server.port, "state_dir": folder / "state"}
        rig = [
            start(folder, "move_base", [str(ROOT / "test" / "rostest" / "move_base_like.py"), "_speed:=20.0"]),
            start(folder, "patrol", [program_of("patrol_robot"), *(f"_{k}:={v}" for k, v in patrol.items())]),
        ]
        bridge = Bridge(program(), port, folder / "bridge.log")
        sensors = {room: EspClient("127.0.0.1", port, room).start() for room in (1, 2, 3)}
        try:
            wait(lambda: senses.state == "idle" and all(s.connected for s in sensors.values()), "the patrol on guard")
            rows = [mission(senses, sensors[1 + i % 3], server) for i in range(missions)]
        except TimeoutError as err:
            raise SystemExit(f"{err}\n{(folder / 'patrol.log').read_text()[-3000:]}") from err
        finally:
            for sensor in sensors.values():
                sensor.stop()
            bridge.stop()
            for process in rig:
                process.terminate()
                process.wait(20.0)
            master.stop()
            server.stop()
    return table(rows)


def mission(senses: Senses, sensor, server) -> tuple[float, float, float]:
    """One trigger, one intruder; returns the three times [s]."""
    senses.goal_at = senses.on_disk_at = senses.appeared = 0.0
    before = len(server.mails)
    edge = time.monotonic()
    sensor.trigger()
    wait(lambda: senses.goal_at, "the goal")
    wait(lambda: senses.state == "looking", "the robot in the room")
    senses.person = True
    wait(lambda: len(server.mails) > before, "the mail")
    mailed = server.times[before]
    wait(lambda: senses.on_disk_at, "the word that the notice is on disk")
    senses.person = False
    wait(lambda: senses.state == "idle", "the robot at home")
    return senses.goal_at - edge, senses.on_disk_at - senses.appeared, mailed - senses.appeared


def table(rows: list[tuple[float, float, float]]) -> dict[str, float]:
    figures = {}
    print(f"{len(rows)} missions, pictures at {PICTURES:g} Hz, boxes {1000 * DETECTION:.0f} ms after each")
    print(f"{'':20}{'median s':>10}{'worst s':>10}")
    for name, values in zip(
        ("edge_to_goal_s", "seen_to_disk_s", "seen_to_mail_s"), zip(*rows, strict=True), strict=True
    ):
        figures[name] = statistics.median(values)
        print(f"{name:20}{figures[name]:10.3f}{max(values):10.3f}")
    return figures


def start(folder: Path, name: str, arguments: list[str]) -> subprocess.Popen[bytes]:
    log = (folder / f"{name}.log").open("wb")
    return subprocess.Popen([sys.executable, *arguments], stdout=log, stderr=subprocess.STDOUT)


def program_of(name: str) -> str:
    return str(Path(program()).with_name(name))


def wait(condition: Callable[[], object], what: str, seconds: float = 40.0) -> None:
    until = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > until:
            raise TimeoutError(f"{what} did not come within {seconds:g} s")
        time.sleep(0.002)
