#!/usr/bin/env python3
"""Drivers of a real robot: what a lidar costs, and how soon its turn is a scan.

    python3 benchmarks/drivers.py [--json FILE] [--seconds 20] [--no-house]

- express_cpu_percent, ultra_cpu_percent: share of one core for bytes to scans, of a lidar with 8,000 and with 16,000
  samples a second: frames, samples, turns, layout, without ROS.
- scan_latency_ms, rplidar_cpu_percent, rplidar_mb: the node rplidarNode with an emulated A2 (8,000 samples a second) on
  a pseudo-terminal. Latency: from the bytes that end a turn, handed to the terminal, to the message in a subscriber;
  median. scan_latency_decodable_ms: from the next frame on, which comes 4 ms later and has the angle that the turn's
  last frame ends at; without it, no driver can know the turn.
- mjpeg_pass_cpu_percent, mjpeg_decode_cpu_percent, camera_mb: the node usb_cam_node with a network camera that sends
  JPEGs of 640 x 480 and 50 kB, 30 a second: while only `compressed` has a subscriber, and while both have one.
- hardware_realtime_factor, hardware_ready_s, robot_profile_mb, robot_profile_cores: `simulation:=hardware` on a mission
  to room 5, all but the simulator: the nodes that a robot runs. Memory: the sum of what is resident; shared pages count
  in each node. robot_profile_pss_mb: each shared page counts once.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import simplejpeg
from house import cost_of

from rosbot_patrol.drivers.rplidar.laser_scan import fixed_angles
from rosbot_patrol.drivers.rplidar.lidar import Lidar, samples_of_a_turn
from rosbot_patrol.simulation.devices.network_camera import NetworkCamera
from rosbot_patrol.simulation.devices.rplidar import MODELS, RplidarDevice
from rosbot_patrol.simulation.devices.serial_line import SerialLine, serve

SIMULATION = ("/simulator", "/rosout", "/house_watch", "/rostopic")  # nodes that no robot runs
CHUNK = 256  # [bytes] that a serial device hands over at a time


def room(angle: np.ndarray) -> np.ndarray:
    """Distances [mm] in a room of 4 x 3 m, by angle [degrees]."""
    radians = np.radians(angle)
    with np.errstate(divide="ignore"):
        return np.minimum(2000 / np.abs(np.cos(radians)), 1500 / np.abs(np.sin(radians)))


class Recording:
    """A lidar's stream, recorded beforehand and handed out in small pieces."""

    def __init__(self, model: str, seconds: float) -> None:
        self._device = RplidarDevice(MODELS[model], room)
        self._now, self._seconds = 0.0, seconds
        self._waiting = b""
        self.stream: list[bytes] = []

    def send(self, data: bytes) -> None:
        """Take a request; the first scan is recorded at once."""
        self._waiting += self._device.feed(data, self._now)
        if self._device.is_scanning and not self.stream:
            whole = b""
            while self._now < self._seconds:
                self._now += 0.1
                whole += self._device.stream(self._now)
            self.stream = [whole[at : at + CHUNK] for at in range(0, len(whole), CHUNK)][::-1]

    def read(self, timeout: float) -> bytes:
        """Answers, then the recording piece by piece."""
        data, self._waiting = self._waiting, b""
        if not data and self.stream:
            data = self.stream.pop()
        return data

    def set_dtr(self, on: bool) -> None:
        """Nothing."""

    def close(self) -> None:
        """Nothing."""


def decoding(model: str, seconds: float) -> float:
    """CPU time for the bytes of so many seconds, as a share of them [%]."""
    wire = Recording(model, seconds)
    lidar = Lidar(wire, sleep=lambda _: None)
    lidar.connect()
    mode = lidar.modes()[0][1]
    lidar.start_scan(mode)
    cells, turns = samples_of_a_turn(mode, 10.0), 0
    began = time.process_time()
    while wire.stream:
        for turn in lidar.read_turns(0.0):
            fixed_angles(turn, cells)
            turns += 1
    used = time.process_time() - began
    if turns < 9 * seconds:
        raise SystemExit(f"only {turns} turns in {seconds} s")
    return 100.0 * used / seconds


class Stamped(RplidarDevice):
    """An emulated lidar that remembers when it handed over the frame in which each turn ends, and the next one."""

    def __init__(self, model: str) -> None:
        super().__init__(MODELS[model], room)
        self.ended: list[float] = []
        self.decodable: list[float] = []

    def stream(self, now: float) -> bytes:
        """Frames that are due."""
        before = self._angle
        data = super().stream(now)
        if data and len(self.decodable) < len(self.ended):
            self.decodable.append(time.monotonic())
        if data and self._angle < before:
            self.ended.append(time.monotonic())
        return data


def program(name: str, *arguments: str) -> subprocess.Popen[bytes]:
    """Start a program of a drop-in, PACKAGE/NAME."""
    roots = os.environ["CMAKE_PREFIX_PATH"].split(":")
    path = next(path for root in roots if (path := Path(root, "lib", name)).exists())
    command = [sys.executable, str(path), *arguments]
    return subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL)


def share_of(process: subprocess.Popen[bytes], seconds: float) -> tuple[float, float]:
    """CPU [%] and memory [MB] of a node from now on."""
    before, began = cost_of(process.pid), time.monotonic()
    time.sleep(seconds)
    after, used = cost_of(process.pid), time.monotonic() - began
    assert before is not None
    assert after is not None
    return 100.0 * (after.cpu - before.cpu) / used, after.memory / 1e6


def node(seconds: float) -> dict[str, float]:
    """Latency, CPU and memory of rplidarNode."""
    import rospy
    from sensor_msgs.msg import LaserScan

    from rosbot_patrol.ros.campaign.house import end_group

    with tempfile.TemporaryDirectory() as folder:
        line = SerialLine(Path(folder) / "rplidar")
        device = Stamped("A2")
        running = [True]
        threading.Thread(target=serve, args=(device, line, lambda: running[0]), daemon=True).start()
        heard: list[float] = []
        rospy.Subscriber("/scan", LaserScan, lambda _: heard.append(time.monotonic()), queue_size=10, tcp_nodelay=True)
        process = program("rplidar_ros/rplidarNode", f"_serial_port:={line.path}")
        try:
            until = time.monotonic() + 30.0
            while len(heard) < 10 and time.monotonic() < until:
                time.sleep(0.1)
            cpu, memory = share_of(process, seconds)
        finally:
            running[0] = False
            end_group(process)

        def late(since: list[float]) -> float:
            """Median time from the last of these moments to a scan [ms]."""
            return 1e3 * statistics.median(each - max(end for end in since if end <= each) for each in heard[5:])

        return {
            "scan_latency_ms": late(device.ended),
            "scan_latency_decodable_ms": late(device.decodable),
            "rplidar_cpu_percent": cpu,
            "rplidar_mb": memory,
        }


def jpeg() -> bytes:
    """A picture of 640 x 480 that takes about 50 kB: soft colours and some noise."""
    chance = np.random.default_rng(1)
    coarse = chance.integers(40, 200, (12, 16, 3)).repeat(40, axis=0).repeat(40, axis=1)
    pixels = coarse + chance.normal(0.0, 9.0, coarse.shape)
    return bytes(simplejpeg.encode_jpeg(pixels.clip(0, 255).astype(np.uint8), 80, "RGB", "420"))


def camera(seconds: float) -> dict[str, float]:
    """CPU and memory of usb_cam_node."""
    import rospy
    from sensor_msgs.msg import CompressedImage, Image

    from rosbot_patrol.ros.campaign.house import end_group

    server, picture, ended = NetworkCamera(), jpeg(), threading.Event()

    def show() -> None:
        while not ended.wait(1.0 / 30.0):
            server.show(picture)

    threading.Thread(target=show, daemon=True).start()
    heard: list[int] = []
    rospy.Subscriber("/cam/image_raw/compressed", CompressedImage, lambda m: heard.append(len(m.data)))
    process = program("usb_cam/usb_cam_node", "__name:=cam", f"_url:=http://127.0.0.1:{server.port}/stream")
    try:
        until = time.monotonic() + 30.0
        while len(heard) < 10 and time.monotonic() < until:
            time.sleep(0.1)
        first = len(heard)
        passed, _ = share_of(process, seconds)
        rate = (len(heard) - first) / seconds
        rospy.Subscriber("/cam/image_raw", Image, lambda _: None, buff_size=1 << 22)
        time.sleep(1.0)
        decoded, memory = share_of(process, seconds)
    finally:
        ended.set()
        end_group(process)
        server.close()
    return {
        "mjpeg_rate": rate,
        "mjpeg_kb": len(picture) / 1e3,
        "mjpeg_pass_cpu_percent": passed,
        "mjpeg_decode_cpu_percent": decoded,
        "camera_mb": memory,
    }


def proportional(pid: int) -> float:
    """Memory of a process, each shared page divided among those that share it [MB]."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1e3


def profile(folder: Path) -> dict[str, float]:
    """The whole house through emulated devices."""
    from rosbot_patrol.ros.campaign.house import House
    from rosbot_patrol.ros.campaign.ports import BRIDGES, free_port

    ports = {"bridge_port": free_port(BRIDGES), "camera_port": free_port()}
    with House(folder, simulation="hardware", hardware_folder=str(folder / "devices"), **ports) as house:
        ready = house.wait_ready(120.0)
        ours = {name: pid for name, pid in house.pids().items() if not name.startswith(SIMULATION)}
        before = {name: cost_of(pid) for name, pid in ours.items()}
        mission = house.mission(5, timeout=600.0)
        after = {name: cost_of(pid) for name, pid in ours.items()}
        shares = sum(map(proportional, ours.values()))
    known = {name: (before[name], after[name]) for name in ours if before[name] and after[name]}
    used = {name: last.cpu - first.cpu for name, (first, last) in known.items()}
    print(f"the mission to room 5 took {mission.wall_seconds:.0f} s: {mission.verdict}")
    for name in sorted(used, key=lambda each: -used[each]):
        memory = known[name][1].memory / 1e6
        print(f"  {name:32} {100.0 * used[name] / mission.wall_seconds:5.1f} % {memory:6.0f} MB")
    return {
        "hardware_realtime_factor": mission.sim_seconds / mission.wall_seconds,
        "hardware_ready_s": ready,
        "robot_profile_mb": sum(last.memory for _, last in known.values()) / 1e6,
        "robot_profile_pss_mb": shares,
        "robot_profile_cores": sum(used.values()) / mission.wall_seconds,
        "robot_profile_nodes": len(known),
    }


def main() -> None:
    """Print the table, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--no-house", action="store_true", help="leave out the mission in the house")
    options = parser.parse_args()
    figures = {
        "express_cpu_percent": decoding("A2", options.seconds),
        "ultra_cpu_percent": decoding("A3", options.seconds),
    }
    from rosbot_patrol.ros.campaign.house import Master

    with tempfile.TemporaryDirectory() as folder:
        master = Master(Path(folder) / "roscore.log")
        try:
            figures |= {**node(options.seconds), **camera(options.seconds)}
            if not options.no_house:
                figures |= profile(Path(folder) / "house")
        finally:
            master.stop()
    print(f"{os.cpu_count()} cores")
    for name, value in figures.items():
        print(f"{name:24} {value:8.2f}")
    if options.json:
        options.json.write_text(json.dumps({"drivers": figures}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
