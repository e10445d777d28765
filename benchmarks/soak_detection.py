#!/usr/bin/env python3
"""An hour of detection at the camera's full rate: does the memory of darknet_ros and republish stay constant?

    python3 benchmarks/soak_detection.py [--minutes 60] [--rate 30] [--json FILE] [--log FILE]

It starts a master on a free port, the node darknet_ros with our network, and two republish nodes (to jpeg and back) in
front of it, as in the tutorial. It sends 640x480 rgb8 pictures with people at the rate and subscribes to all outputs
(to the drawn picture for 20 seconds in ten minutes). Now and then it sends goals to the action and switches the
detector off and on. Once a minute it records each node's memory. Constant: after the first ten minutes a node's memory
rises by less than 2 MB an hour, as the median of the slopes between all pairs of minutes (Theil and Sen). This shows a
leak, also one in small steps, but not one single step, such as a receive buffer that was once filled on a busy machine.
The table also has that step, and the slope of the straight line through the values.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from rosbot_patrol.ros.campaign.ports import free_port

ROOT = Path(__file__).resolve().parents[1]
NODES = ("darknet_ros", "rgb_compress", "rgb_decompress")
FLAT_MB_PER_HOUR = 2.0
WARM_UP = 10.0  # minutes; fewer in a short run


def make_pictures() -> list[np.ndarray]:
    """Pictures with people: the README's, shifted so that consecutive ones differ."""
    import cv2

    base = cv2.imread(str(ROOT / "docs/images/actors.png"))[:336]
    rng = np.random.default_rng(0)
    pictures = []
    for _ in range(60):
        grow = rng.uniform(1.5, 4.0)
        large = cv2.resize(base, None, fx=grow, fy=grow)
        y, x = (int(rng.integers(0, have - need + 1)) for have, need in zip(large.shape[:2], (480, 640), strict=True))
        pictures.append(np.ascontiguousarray(large[y : y + 480, x : x + 640, ::-1]))
    return pictures


class House:
    """A master, the nodes, and their memory."""

    def __init__(self, log: Path) -> None:
        port = free_port()
        os.environ.update(ROS_MASTER_URI=f"http://localhost:{port}", ROS_HOSTNAME="localhost")
        self._log = log.open("w")
        self._core = self._start("roscore", "-p", str(port))
        import rosgraph

        while not rosgraph.is_master_online():
            time.sleep(0.1)
        python, programs = sys.executable, ROOT / "nodes"
        out = [python, str(programs / "republish"), "raw", "in:=/camera", "compressed", "out:=/middle"]
        back = [python, str(programs / "republish"), "compressed", "in:=/middle", "raw", "out:=/rgb_raw"]
        see = [python, str(programs / "darknet_ros"), "_image_view/enable_opencv:=false"]
        self.nodes = {
            "rgb_compress": self._start(*out, "__name:=rgb_compress"),
            "rgb_decompress": self._start(*back, "__name:=rgb_decompress"),
            "darknet_ros": self._start(
                *see,
                "__name:=darknet_ros",
                "_subscribers/camera_reading/topic:=/rgb_raw",
                "_yolo_model/detection_classes/names:=[person, fire hydrant]",
            ),
        }

    def _start(self, *command: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=self._log, stderr=subprocess.STDOUT)

    def resident_mb(self) -> dict[str, float]:
        """Resident memory of each node; RuntimeError if one has ended."""
        found = {}
        for name, node in self.nodes.items():
            if node.poll() is not None:
                raise RuntimeError(f"{name} ended with {node.returncode}, see {self._log.name}")
            status = Path(f"/proc/{node.pid}/status").read_text(encoding="ascii")
            found[name] = next(int(row.split()[1]) / 1024 for row in status.splitlines() if row.startswith("VmRSS"))
        return found

    def stop(self) -> None:
        """End everything."""
        for process in (*self.nodes.values(), self._core):
            process.terminate()
        for process in (*self.nodes.values(), self._core):
            process.wait(20.0)


class Camera:
    """Send pictures at a rate, and count the outputs."""

    def __init__(self, rate: float) -> None:
        import actionlib
        import rospy
        from darknet_ros_msgs.msg import BoundingBoxes, CheckForObjectsAction, ObjectCount
        from sensor_msgs.msg import Image
        from std_msgs.msg import Header

        from rosbot_patrol.images.encodings import Picture
        from rosbot_patrol.ros.messages.images import picture_to_msg

        rospy.init_node("soak", disable_signals=True)
        self._rate = rate
        self.messages = [picture_to_msg(Picture(p, "rgb8"), Header(frame_id="camera")) for p in make_pictures()]
        self.sent = self.counted = self.boxes = self.drawn = 0
        self._sent_at: dict[int, float] = {}
        self.waits: list[float] = []
        self._publisher = rospy.Publisher("/camera", Image, queue_size=1)
        rospy.Subscriber("/darknet_ros/found_object", ObjectCount, self._on_count)
        rospy.Subscriber("/darknet_ros/bounding_boxes", BoundingBoxes, self._on_boxes)
        self.action = actionlib.SimpleActionClient("/darknet_ros/check_for_objects", CheckForObjectsAction)
        self.action.wait_for_server()
        threading.Thread(target=self._send, daemon=True).start()

    def _send(self) -> None:
        import rospy

        due = time.monotonic()
        while not rospy.is_shutdown():
            message = self.messages[self.sent % len(self.messages)]
            message.header.stamp = rospy.Time.now()
            self._sent_at[message.header.stamp.to_nsec()] = time.monotonic()
            self._publisher.publish(message)
            self.sent += 1
            if len(self._sent_at) > 100:
                self._sent_at.pop(next(iter(self._sent_at)))
            due = max(due + 1.0 / self._rate, time.monotonic() - 0.5)
            time.sleep(max(due - time.monotonic(), 0.0))

    def _on_count(self, message: object) -> None:
        self.counted += 1
        at = self._sent_at.get(message.header.stamp.to_nsec())  # type: ignore[attr-defined]
        if at is not None:
            self.waits.append(time.monotonic() - at)

    def _on_boxes(self, message: object) -> None:
        self.boxes += len(message.bounding_boxes)  # type: ignore[attr-defined]

    def on_drawn(self, _: object) -> None:
        """Count a drawn picture."""
        self.drawn += 1


def disturb(camera: Camera, minute: int) -> None:
    """Occasional events: a subscriber of the drawn picture, goals of the action, switching off and on."""
    import rospy
    from darknet_ros_msgs.msg import CheckForObjectsGoal
    from sensor_msgs.msg import Image
    from std_srvs.srv import SetBool

    if minute % 10 == 3:
        looking = rospy.Subscriber("/darknet_ros/detection_image", Image, camera.on_drawn)
        time.sleep(20.0)
        looking.unregister()
    elif minute % 10 == 6:
        for i in range(20):
            camera.action.send_goal_and_wait(CheckForObjectsGoal(id=i, image=camera.messages[i]), rospy.Duration(5.0))
    elif minute % 10 == 8:
        enable = rospy.ServiceProxy("/darknet_ros/enable", SetBool)
        enable(False)
        time.sleep(3.0)
        enable(True)


def rise_per_hour(minutes: list[float], values: list[float], warm_up: float) -> tuple[float, float]:
    """Median of the slopes between all pairs of values after the warm-up, and slope of the line through them [MB/h]."""
    hours, late = (
        np.array([(m / 60.0, v) for m, v in zip(minutes, values, strict=True) if m >= warm_up]).reshape(-1, 2).T
    )
    if len(late) < 3:
        return float("nan"), float("nan")
    first, second = np.triu_indices(len(late), 1)
    slopes = (late[second] - late[first]) / (hours[second] - hours[first])
    return float(np.median(slopes)), float(np.polyfit(hours, late, 1)[0])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=30.0, help="pictures a second")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--log", type=Path, metavar="FILE", help="what the nodes print; default: a temporary file")
    wanted = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that the nodes end too
    log = wanted.log or Path(tempfile.mkstemp(prefix="soak_", suffix=".log")[1])
    house = House(log)
    minutes: list[float] = []
    rows: dict[str, list[float]] = {name: [] for name in NODES}
    try:
        camera = Camera(wanted.rate)
        print(f"{os.cpu_count()} cores, {wanted.rate:g} pictures a second sent; nodes print to {log}\n")
        print(
            "| minute | " + " | ".join(f"{n} MB" for n in NODES) + " | sent/s | looked at/s | ms to the boxes | boxes |"
        )
        print("|" + "---|" * (len(NODES) + 5), flush=True)
        time.sleep(10.0)
        start, last = time.monotonic(), (camera.sent, camera.counted, camera.boxes, time.monotonic())
        for minute in range(int(wanted.minutes) + 1):
            if minute:
                disturb(camera, minute)
                time.sleep(max(start + 60.0 * minute - time.monotonic(), 0.0))
            now, memory = time.monotonic(), house.resident_mb()
            minutes.append((now - start) / 60.0)
            for name in NODES:
                rows[name].append(memory[name])
            span = max(now - last[3], 1.0)
            waits, camera.waits = camera.waits, []
            print(
                f"| {minute} | "
                + " | ".join(f"{memory[n]:.1f}" for n in NODES)
                + f" | {(camera.sent - last[0]) / span:.1f} | {(camera.counted - last[1]) / span:.1f}"
                + f" | {1e3 * float(np.median(waits)) if waits else float('nan'):.0f} | {camera.boxes - last[2]} |",
                flush=True,
            )
            last = (camera.sent, camera.counted, camera.boxes, now)
    finally:
        house.stop()
    warm_up = min(WARM_UP, wanted.minutes / 4)
    rises = {name: rise_per_hour(minutes, rows[name], warm_up) for name in NODES}
    told = ", ".join(f"{n} {median:+.2f} MB/h (line {line:+.2f})" for n, (median, line) in rises.items())
    print(f"\nrise after minute {warm_up:g}: {told}")
    print(f"{camera.sent} sent, {camera.counted} looked at, {camera.boxes} boxes, {camera.drawn} drawn pictures")
    if wanted.json:
        figures = {f"soak_rise_{name}_mb_per_hour": median for name, (median, _) in rises.items()}
        wanted.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return 0 if all(median < FLAT_MB_PER_HOUR for median, _ in rises.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
