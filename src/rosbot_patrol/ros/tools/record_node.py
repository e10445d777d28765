"""record: a bag of a patrol (the guard's inputs and outputs), to be replayed as a regression test.

    rosrun rosbot_patrol record NAME.bag                    # until Ctrl-C
    rosrun rosbot_patrol record NAME.bag --duration 120     # [s] of ROS's time
    rosrun rosbot_patrol record NAME.bag --no-camera --also /my/topic

`rosbag record` writes it, compressed by lz4; pictures are JPEG if `/rgb_republish/compressed` exists, which
rosbot_patrol.launch publishes. Topics without a publisher are listed, and recorded as soon as there is one.
"""

from __future__ import annotations

import argparse
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import rosgraph
from rosgraph.names import get_ros_namespace, ns_join, resolve_name

from rosbot_patrol.ros.runtime.by_hand import master_problem
from rosbot_patrol.ros.runtime.private_files import UMASK

HEARD = (
    "/clock", "/tf", "/tf_static", "/scan", "/odom", "/map", "/initialpose", "/motion_trigger", "/battery",
    "/range/fl", "/range/fr", "/range/rl", "/range/rr", "/darknet_ros/bounding_boxes", "/darknet_ros/found_object",
    "/patrol/arming", "/sensors/events", "/e_stop", "/esp_client1/bytes", "/esp_client2/bytes", "/esp_client3/bytes",
)  # fmt: skip
CAMERA = ("/camera/rgb/camera_info", "/rgb_republish/compressed", "/camera/depth/camera_info")
DID = (
    "/amcl_pose", "/amcl/health", "/move_base/goal", "/move_base/status", "/move_base/result", "/move_base/cancel",
    "/cmd_vel", "/cmd_vel/move_base", "/cmd_vel/patrol", "/patrol/state", "/patrol/alerts", "/diagnostics",
)  # fmt: skip
SHARED = ("/clock", "/diagnostics")  # shared by all guards of one master
LEAST_FREE = 500  # free space [MB] on the disk needed to start


def topics(also: Sequence[str] = (), *, camera: bool = True, namespace: str = "/") -> list[str]:
    """Topics to record of the guard in a namespace; ROS resolves names given by hand there."""
    own = [*HEARD, *(CAMERA if camera else ()), *DID]
    inside = [name if name in SHARED else namespace.rstrip("/") + name for name in own]
    return [*inside, *(resolve_name(name, ns_join(namespace, "record")) for name in also)]


def command(file: Path, wanted: Sequence[str], *, duration: float = 0.0) -> list[str]:
    """Command line of rosbag."""
    lasting = [f"--duration={duration:g}"] if duration > 0.0 else []
    return ["rosrun", "rosbag", "record", "--lz4", "--buffsize=256", *lasting, "-O", str(file), *wanted]


def _options(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="record", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path, metavar="NAME.bag")
    parser.add_argument("--duration", type=float, default=0.0, metavar="S", help="end after so long; 0: at Ctrl-C")
    parser.add_argument("--no-camera", action="store_true", help="leave the pictures out")
    parser.add_argument("--also", nargs="+", default=[], metavar="TOPIC", help="further topics")
    return parser.parse_args(arguments)


def _problem(file: Path) -> str:
    """Reason why the bag cannot be written, "" if it can."""
    if file.suffix != ".bag":
        return f"{file}: a bag's name ends in .bag"
    if file.exists():
        return f"{file} is there already: name another, or remove it"
    if not file.parent.is_dir():
        return f"{file.parent} is no folder"
    free = shutil.disk_usage(file.parent).free // 1_000_000
    if free < LEAST_FREE:
        return f"only {free} MB are free in {file.parent}, {LEAST_FREE} are wanted"
    return master_problem()


def record(given: argparse.Namespace) -> int:
    """Record; returns rosbag's exit status."""
    file = given.file.resolve()
    problem = _problem(file)
    if problem:
        print(f"record: {problem}", file=sys.stderr)
        return 2
    wanted = topics(given.also, camera=not given.no_camera, namespace=get_ros_namespace())
    published = {name for name, _ in rosgraph.Master("/record").getPublishedTopics("/")}
    missing = [name for name in wanted if name not in published]
    if missing:
        print(f"nobody publishes yet: {', '.join(missing)}", flush=True)
    process = subprocess.Popen(command(file, wanted, duration=given.duration), umask=UMASK)  # a bag shows a home
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: process.send_signal(signal.SIGINT))
    status = process.wait()
    if not file.exists():
        print(f"record: {file} was not written, it ended before anything came", file=sys.stderr)
        return status or 1
    print(f"{file}: {file.stat().st_size / 1e6:.1f} MB")
    return status


def main() -> None:
    """Run the program."""
    sys.exit(record(_options([word for word in sys.argv[1:] if not word.startswith("__")])))


if __name__ == "__main__":
    main()
