#!/usr/bin/env python3
"""The firmware's host build with serial_node.py and a real master: delay from the motion interrupt to the topic.

    python3 benchmarks/firmware.py [--json FILE] [--motions 200]

The time runs from the call of the sketch's interrupt handler to the callback of a rospy subscriber. It includes the 5
ms that an output must stay high, the loop's cycle, TCP over loopback, the bridge, and rospy, but no Wi-Fi. The sketch
is built without sanitizers. Its CPU is the share of one core while it only sends heartbeats; on the host its loop runs
every 2 ms.
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
import time
from pathlib import Path

import numpy as np

from rosbot_patrol.ros.campaign.ports import free_port

ROOT = Path(__file__).resolve().parents[1]
TICKS = os.sysconf("SC_CLK_TCK")

LISTENER = """
import time
import roslib.message, rospy
rospy.init_node("listener", anonymous=True)
kind = roslib.message.get_message_class("rosbot_patrol/EspTrigger")
heard = lambda m: print(time.monotonic_ns(), m.id, int(m.move), flush=True)
rospy.Subscriber("/motion_trigger", kind, heard, tcp_nodelay=True)
rospy.spin()
"""


def serial_node() -> str:
    for folder in os.environ["CMAKE_PREFIX_PATH"].split(":"):
        path = Path(folder, "lib", "rosbot_patrol", "serial_node.py")
        if path.exists():
            return str(path)
    sys.exit("firmware.py: serial_node.py is not built: run scripts/bootstrap, then `. scripts/env`")


def wait_for_line(popen: subprocess.Popen[str], text: str) -> str:
    assert popen.stdout is not None
    for line in popen.stdout:
        if text in line:
            return line
    sys.exit(f"firmware.py: {popen.args} ended")


def cpu_percent(pid: int, seconds: float) -> float:
    def used() -> int:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return int(fields[11]) + int(fields[12])

    began = used()
    time.sleep(seconds)
    return 100.0 * (used() - began) / TICKS / seconds


def measure(motions: int, stack: list[subprocess.Popen[str]]) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as build:
        command = ["make", "-s", "-j2", "-C", str(ROOT / "firmware" / "host"), "SANITIZE=", f"BUILD={build}", "sensor"]
        subprocess.run(command, check=True)
        port, master = free_port(), free_port()
        env = dict(
            os.environ, ROS_MASTER_URI=f"http://localhost:{master}", ROS_HOSTNAME="localhost", PYTHONUNBUFFERED="1"
        )

        def start(*command: str) -> subprocess.Popen[str]:
            stack.append(
                subprocess.Popen(
                    command,
                    env=env,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    text=True,
                )
            )
            return stack[-1]

        wait_for_line(start("roscore", "-p", str(master)), "started core service")
        bridge = start(sys.executable, serial_node(), "_port:=tcp", f"_tcp_port:={port}")
        wait_for_line(bridge, f"on TCP port {port}")
        listener = start(sys.executable, "-c", LISTENER)
        sensor = start(f"{build}/esp_motion_sensor", "--port", str(port), "--id", "5")
        wait_for_line(listener, " 5 0")
        delays = []
        assert sensor.stdin is not None
        for _ in range(motions):
            sensor.stdin.write("motion 1\n")
            sensor.stdin.flush()
            edge = int(wait_for_line(sensor, "edge").split()[1])
            delays.append((int(wait_for_line(listener, " 5 1").split()[0]) - edge) / 1e6)
            sensor.stdin.write("motion 0\n")
            sensor.stdin.flush()
            wait_for_line(sensor, "no motion any more")
        cpu = cpu_percent(sensor.pid, 5.0)
    return {
        "interrupt_to_topic_p50_ms": float(np.percentile(delays, 50)),
        "interrupt_to_topic_p99_ms": float(np.percentile(delays, 99)),
        "interrupt_to_topic_max_ms": max(delays),
        "host_cpu_percent": cpu,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    parser.add_argument("--motions", type=int, default=200)
    arguments = parser.parse_args()
    stack: list[subprocess.Popen[str]] = []
    try:
        figures = measure(arguments.motions, stack)
    finally:
        for popen in reversed(stack):
            popen.send_signal(signal.SIGINT)
            try:
                popen.wait(8.0)
            except subprocess.TimeoutExpired:
                popen.kill()
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, {arguments.motions} motions")
    for name, value in figures.items():
        print(f"{name:<28}{value:8.1f}")
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    main()
