#!/usr/bin/env python3
"""The simulator: real-time factor, time per picture, a world of 2,000 boxes, and the shares of its parts.

    PYTHONPATH=src .ws/venv/bin/python benchmarks/simulation.py [--json FILE] [--quick] [--ros]

It runs the engine alone, without ROS, in the house with a walking person and the robot driving curves. Each figure is
measured in a process of its own, pinned to the stated number of cores (with llvmpipe's threads, by LP_NUM_THREADS),
after a warm-up, as the median of the repeats.

- rtf_lidar: simulated over wall time with the lidar (720 beams) and IMU at 10 Hz, odometry at 20 Hz.
- rtf_rgbd: with colour and depth of 640x480 at 10 Hz as well.
- rtf_lidar_40hz: the first with the lidar at 40 Hz; rtf_unheard: the first without subscribers of lidar and IMU.
- render_rgbd_ms: one picture of the engine, noise and limits included, from places all over the house.
- load_2000_boxes_s: a file of 2,000 models of a box each, read and put into an engine, and the robot spawned.
- steps_ratio_2000_boxes: rtf_lidar there relative to the house's.

--ros: the node as well, on a master of its own, rate 0, with one listener process on the topics; needs `. scripts/env`.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import argparse
import json
import math
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
HOUSE = ROOT / "worlds" / "house.world"
URDF = ROOT / "urdf" / "rosbot.urdf"
BOXES = 2000
PORT = 11599  # port of the benchmark's own master

AIMS = {  # figure: aim, whether more is better
    "rtf_lidar": (20.0, True),
    "rtf_lidar_40hz": (None, True),
    "rtf_unheard": (None, True),
    "rtf_rgbd": (6.0, True),
    "render_rgbd_ms": (5.0, False),
    "load_2000_boxes_s": (1.0, False),
    "steps_ratio_2000_boxes": (0.25, True),
    "physics_hz": (200.0, True),
    "ros_rtf_lidar": (None, True),
    "ros_rtf_rgbd": (None, True),
}
CORES = {"rgbd": 2, "ros": 2}
PARTS = ("physics", "drive", "lidar", "draw", "read back", "noise", "rest")


@dataclass
class Watch:
    """Wall seconds by label, without the time of labels inside."""

    seconds: dict[str, float] = field(default_factory=dict)
    _inner: list[float] = field(default_factory=lambda: [0.0])

    def timed(self, label: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Wrap a function so that its time counts under a label."""

        def run(*args: Any, **options: Any) -> Any:
            self._inner.append(0.0)
            before = time.perf_counter()
            try:
                return function(*args, **options)
            finally:
                spent = time.perf_counter() - before
                self.seconds[label] = self.seconds.get(label, 0.0) + spent - self._inner.pop()
                self._inner[-1] += spent

        return run

    def watch(self, label: str, owner: Any, *names: str) -> None:
        """Count the time of an object's or a class's methods under a label."""
        for name in names:
            setattr(owner, name, self.timed(label, getattr(owner, name)))


def make_engine(world: Path, *, with_actor: bool = True) -> Any:
    """Make an engine with the robot in it."""
    from rosbot_patrol.geometry import Pose2D
    from rosbot_patrol.simulation.engine import Engine, EngineParams
    from rosbot_patrol.simulation.render.egl import make_renderer
    from rosbot_patrol.simulation.robot.description import load_robot
    from rosbot_patrol.simulation.sdf.world import load_world

    engine = Engine(load_world(world), EngineParams(seed=1), make_renderer=make_renderer)
    engine.spawn_robot(load_robot(URDF))
    if with_actor:
        name = engine.population.spawn_actor("", "person", "", Pose2D(2.0, 0.5, 0.0))
        engine.population.move_actor(name, [Pose2D(3.0, -0.5, 0.0), Pose2D(2.0, 0.5, 0.0)], 0.8, loop=True)
    return engine


def simulate(
    engine: Any, seconds: float, *, scan_hz: float = 10.0, pictures: bool = False, heard: bool = True
) -> float:
    """Drive curves for a simulated time and read the sensors; returns simulated over wall time.

    Args:
        engine: engine with the robot in it.
        seconds: simulated time.
        scan_hz: rate of the lidar.
        pictures: whether the camera has a subscriber, at 10 Hz.
        heard: whether the lidar and the inertial unit have subscribers.
    """
    from rosbot_patrol.geometry import Twist2D
    from rosbot_patrol.simulation.engine import STEP

    per_scan = round(1.0 / (scan_hz * STEP))
    before = time.perf_counter()
    for i in range(round(seconds / STEP)):
        if i % 20 == 0:
            engine.command(Twist2D(0.2, 0.0, 0.7 * math.sin(i / 300.0)))
        engine.step()
        if heard and i % per_scan == 0:
            engine.scan()
        if heard and i % 20 == 4:
            engine.imu()
        if i % 10 == 0:
            _ = engine.robot.odometry.pose
        if pictures and i % 20 == 10:
            engine.picture()
    return seconds / (time.perf_counter() - before)


def factor(world: Path, quick: bool, **options: Any) -> float:
    """Median of simulated over wall time."""
    engine = make_engine(world, with_actor=world == HOUSE)
    simulate(engine, 2.0, **options)
    found = [simulate(engine, 10.0 if quick else 30.0, **options) for _ in range(3 if quick else 5)]
    engine.close()
    return statistics.median(found)


def picture_times(quick: bool) -> list[float]:
    """Milliseconds of each picture, from places all over the house."""
    from rosbot_patrol.geometry import Pose2D

    engine = make_engine(HOUSE)
    places = [(0, 0), (2.8, -0.2), (-3.5, 0.3), (-4.8, 3.4), (-3.8, 6.5), (2.7, 7.4), (5.6, 12.0), (14.7, 11.5)]
    times = []
    for lap in range(3 if quick else 8):
        for x, y in places:
            for yaw in (0.0, 2.1, 4.2):
                engine.carry(Pose2D(x, y, yaw))
                engine.step()
                before = time.perf_counter()
                engine.picture()
                if lap:
                    times.append(1e3 * (time.perf_counter() - before))
    engine.close()
    return times


def shares(pictures: bool) -> dict[str, float]:
    """Wall milliseconds of each part per simulated second."""
    from rosbot_patrol.simulation.engine import Engine
    from rosbot_patrol.simulation.physics.world import Physics
    from rosbot_patrol.simulation.render.egl import EglRenderer
    from rosbot_patrol.simulation.robot.drive import Drive
    from rosbot_patrol.simulation.sensors.camera import Camera

    watch = Watch()
    watch.watch("physics", Physics, "step")
    watch.watch("drive", Drive, "step")
    watch.watch("lidar", Engine, "scan")
    watch.watch("noise", Camera, "_noisy_colour", "_sensed_depth")
    draw = EglRenderer._draw  # OpenGL draws when the pixels are read: wait for it here, to separate both times

    def drawn(self: EglRenderer, *args: Any) -> Any:
        buffer = draw(self, *args)
        self._context.finish()
        return buffer

    EglRenderer._draw = watch.timed("draw", drawn)  # type: ignore[method-assign]
    watch.watch("read back", EglRenderer, "render")
    engine = make_engine(HOUSE)
    simulate(engine, 2.0, pictures=pictures)
    watch.seconds.clear()
    seconds = 20.0
    before = time.perf_counter()
    simulate(engine, seconds, pictures=pictures)
    whole = time.perf_counter() - before
    engine.close()
    found = {part: 1e3 * watch.seconds.get(part, 0.0) / seconds for part in PARTS}
    found["rest"] = 1e3 * whole / seconds - sum(found.values())
    return found


def write_boxes(path: Path) -> None:
    """Write a world of 2,000 models, each a box, with room for the robot at the origin."""
    rng = random.Random(5)
    models = []
    for i in range(BOXES):
        x, y = 1.2 * (i % 50 - 24.5), 1.2 * (i // 50 - 19.5)
        size = f"{rng.uniform(0.1, 0.6):.3f} {rng.uniform(0.1, 0.6):.3f} {rng.uniform(0.1, 1.5):.3f}"
        geometry = f"<geometry><box><size>{size}</size></box></geometry>"
        models.append(
            f"<model name='box_{i}'><static>true</static><pose>{x:.3f} {y:.3f} 0.4 0 0 {rng.uniform(-3, 3):.3f}</pose>"
            f"<link name='link'><collision name='c'>{geometry}</collision><visual name='v'>{geometry}</visual></link>"
            "</model>"
        )
    path.write_text(f"<sdf version='1.6'><world name='boxes'>{''.join(models)}</world></sdf>", encoding="utf-8")


def load_seconds(path: Path) -> float:
    """Read the file, build the engine, spawn the robot."""
    before = time.perf_counter()
    engine = make_engine(path, with_actor=False)
    spent = time.perf_counter() - before
    engine.close()
    return spent


def boxes(quick: bool) -> dict[str, float]:
    """Figures of the world of boxes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "boxes.world"
        write_boxes(path)
        make_engine(HOUSE).close()  # imports and kernels
        times = [load_seconds(path) for _ in range(3 if quick else 7)]
        there, here = factor(path, quick), factor(HOUSE, quick)
    return {"load_2000_boxes_s": statistics.median(times), "steps_ratio_2000_boxes": there / here, "rtf_there": there}


# The node ------------------------------------------------------------------------------------------------------------


def listen(topics: Iterable[str]) -> None:
    """Receive messages until killed: the listener's process."""
    import rospy

    rospy.init_node("listener")
    for topic in topics:
        rospy.Subscriber(topic, rospy.AnyMsg, lambda _: None, queue_size=1, buff_size=4 << 20, tcp_nodelay=True)
    rospy.spin()


def node_factor(topics: list[str], quick: bool) -> float:
    """Simulated over wall time of the node with one listener, from its /clock."""
    import rospy
    from rosgraph_msgs.msg import Clock

    seconds = 5.0 if quick else 15.0
    times: list[tuple[float, float]] = []
    rospy.Subscriber("/clock", Clock, lambda m: times.append((time.monotonic(), m.clock.to_sec())), tcp_nodelay=True)
    listener = subprocess.Popen([sys.executable, __file__, "--listen", *topics])
    try:
        time.sleep(3.0)
        first = len(times)
        time.sleep(seconds)
        (wall, sim), (wall_end, sim_end) = times[first], times[-1]
    finally:
        listener.terminate()
        listener.wait()
    return (sim_end - sim) / (wall_end - wall)


def ros(quick: bool) -> dict[str, float]:
    """Start a master and the node, measure with small and with large topics."""
    os.environ["ROS_MASTER_URI"] = f"http://localhost:{PORT}"
    import rospy
    from geometry_msgs.msg import Twist, Vector3

    children = [subprocess.Popen(["roscore", "-p", str(PORT)], stdout=subprocess.DEVNULL)]
    try:
        time.sleep(4.0)
        subprocess.run(["rosparam", "load", str(ROOT / "config" / "simulation.yaml"), "/simulator"], check=True)
        rospy.set_param("/robot_description", URDF.read_text(encoding="utf-8"))
        node = ["rosrun", "rosbot_patrol", "simulator", "__name:=simulator", f"_world:={HOUSE}", "_rate:=0"]
        children.append(subprocess.Popen(node, stdout=subprocess.DEVNULL))
        rospy.init_node("benchmark", disable_rosout=True)
        rospy.wait_for_message("/clock", rospy.AnyMsg, timeout=60.0)
        command = rospy.Publisher("/cmd_vel", Twist, queue_size=1, latch=True)
        command.publish(Twist(angular=Vector3(z=0.3)))
        small = ["/scan", "/odom", "/tf", "/rosbot/imu"]
        found = {"ros_rtf_lidar": node_factor(small, quick)}
        found["ros_rtf_rgbd"] = node_factor([*small, "/camera/rgb/image_raw", "/camera/depth/image_raw"], quick)
    finally:
        for child in reversed(children):
            child.terminate()
            child.wait(20.0)
    return found


# Table ---------------------------------------------------------------------------------------------------------------


def measure(what: str, quick: bool) -> dict[str, float]:
    """Make one measurement, in the process that was pinned for it."""
    if what == "lidar":
        return {
            "rtf_lidar": factor(HOUSE, quick),
            "rtf_lidar_40hz": factor(HOUSE, quick, scan_hz=40.0),
            "rtf_unheard": factor(HOUSE, quick, heard=False),
        }
    if what == "rgbd":
        return {"rtf_rgbd": factor(HOUSE, quick, pictures=True)}
    if what == "picture":
        times = picture_times(quick)
        return {"render_rgbd_ms": statistics.median(times), "least": min(times)}
    if what == "boxes":
        return boxes(quick)
    if what == "ros":
        return ros(quick)
    return shares(pictures=what == "shares_rgbd")


def pinned(what: str, quick: bool) -> dict[str, float]:
    """Measure in a process of its own on the figure's number of cores."""
    cores = CORES.get(what, 1)
    allowed = sorted(os.sched_getaffinity(0))[:cores]
    environment = {**os.environ, "LP_NUM_THREADS": str(cores), "OMP_NUM_THREADS": str(cores)}
    command = [sys.executable, __file__, "--measure", what, *(["--quick"] if quick else [])]
    done = subprocess.run(
        command, env=environment, stdout=subprocess.PIPE, text=True, check=True,
        preexec_fn=lambda: os.sched_setaffinity(0, allowed),
    )  # fmt: skip
    return {k: float(v) for k, v in json.loads(done.stdout.splitlines()[-1]).items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--quick", action="store_true", help="shorter runs")
    parser.add_argument("--ros", action="store_true", help="the node with a listener as well")
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    parser.add_argument("--listen", nargs="+", help=argparse.SUPPRESS)
    wanted = parser.parse_args()
    sys.path.insert(0, str(ROOT / "src"))
    if wanted.listen:
        listen(wanted.listen)
    elif wanted.measure:
        print(json.dumps(measure(wanted.measure, wanted.quick)))
    else:
        report(wanted)


def report(wanted: argparse.Namespace) -> None:
    """Measure everything, print the tables, write the figures."""
    figures: dict[str, float] = {}
    for what in ("lidar", "rgbd", "picture", "boxes", *(["ros"] if wanted.ros else [])):
        figures |= pinned(what, wanted.quick)
    from rosbot_patrol.simulation.engine import STEP

    figures["physics_hz"] = 1.0 / STEP
    print(f"{os.cpu_count()} cores; better than 1 in the last column is better than the aim")
    print("| figure | cores | value | aim | times the aim |\n|---|---|---|---|---|")
    for name, (aim, more) in AIMS.items():
        if name in figures:
            value = figures[name]
            ratio = "" if aim is None else f"{value / aim if more else aim / value:.2f}"
            told = "" if aim is None else f"{'>=' if more else '<='} {aim:g}"
            cores = 2 if ("rgbd" in name and name.startswith(("rtf", "ros"))) or name.startswith("ros") else 1
            print(f"| {name} | {cores} | {value:.3g} | {told} | {ratio} |")
    print("\nwall ms of a simulated second, 1 core (the watches cost a little themselves)")
    print("| with | " + " | ".join(PARTS) + " | all |\n|" + "---|" * (len(PARTS) + 2))
    for label, what, node in (
        ("lidar", "shares", "ros_rtf_lidar"),
        ("lidar and RGB-D", "shares_rgbd", "ros_rtf_rgbd"),
    ):
        found = pinned(what, wanted.quick)
        every = " | ".join(f"{found[part]:.2f}" for part in PARTS)
        print(f"| {label} | {every} | {sum(found.values()):.2f} |")
        if node in figures:
            whole = 1e3 / figures[node]
            print(f"| the node: the same and ROS {whole - sum(found.values()):.2f} |{' |' * len(PARTS)} {whole:.2f} |")
    if wanted.json:
        kept = {name: round(figures[name], 3) for name in AIMS if name in figures}
        wanted.json.write_text(json.dumps(kept, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
