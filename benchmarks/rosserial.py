#!/usr/bin/env python3
"""The rosserial bridge under the load of a building's sensors, over loopback, with a real master.

    python3 benchmarks/rosserial.py [--json FILE] [--quick] [--sensors 500] [--seconds 60]

The sensors (rosserial_fleet.py) and the listeners (rosserial_ear.py) are processes of their own and do not count. CPU
is the bridge's share of one core, with one rospy subscriber and diagnostics. Memory is read after that: RSS is all
resident memory, PSS divides what other Python processes share. Latency is from the `send` of a heartbeat's last byte to
its arrival at a subscriber: a rospy one, or a bare TCPROS socket, which excludes rospy's receiver. The flood is sent as
fast as the bridge reads, without its limit of 200 frames a second and client, to the bare socket; no message may be
missing. If the package path has the original rosserial_python, its flood is measured too.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

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
from typing import Any

import numpy as np

from rosbot_patrol.ros.campaign.ports import free_port
from rosbot_patrol.rosserial.protocol.keys import add_key, new_key

HERE = Path(__file__).resolve().parent
TICKS = os.sysconf("SC_CLK_TCK")
AIMS = {
    "cpu_percent_500": 20,
    "mb_500": 80,
    "latency_p50_ms": 1,
    "latency_p99_ms": 10,
    "reconnect_500_s": 15,
    "cpu_percent_500_signed": 12,
}
UNLIMITED = {"max_rate": 0, "max_rate_per_address": 0}


class Child:
    """A child process that takes commands as lines of JSON and answers each."""

    def __init__(self, *command: str) -> None:
        self.popen = subprocess.Popen(
            [sys.executable, *command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def hear(self) -> dict[str, Any]:
        """Read its next answer."""
        assert self.popen.stdout is not None
        while not (line := self.popen.stdout.readline()).startswith("{"):
            if not line:
                raise RuntimeError(f"{self.popen.args} ended")
        return json.loads(line)

    def tell(self, **command: object) -> None:
        """Send a command without waiting."""
        assert self.popen.stdin is not None
        self.popen.stdin.write(json.dumps(command) + "\n")
        self.popen.stdin.flush()

    def ask(self, **command: object) -> dict[str, Any]:
        """Send a command, and wait for the answer."""
        self.tell(**command)
        return self.hear()

    def stop(self) -> None:
        """End the process."""
        self.popen.kill()
        self.popen.wait()


def ear(kind: str) -> Child:
    child = Child(str(HERE / "rosserial_ear.py"), kind)
    child.hear()
    return child


def program() -> str:
    """Our serial_node.py in the built workspace."""
    for folder in os.environ["CMAKE_PREFIX_PATH"].split(":"):
        path = Path(folder, "lib", "rosbot_patrol", "serial_node.py")
        if path.exists():
            return str(path)
    raise FileNotFoundError("serial_node.py is not built: run scripts/bootstrap")


def upstream() -> str:
    """Upstream's serial_node.py, "" if the package path has none (ours replaces it)."""
    found = subprocess.run(["rospack", "find", "rosserial_python"], capture_output=True, text=True, check=False)
    folder = Path(found.stdout.strip() or "/nonexistent")
    is_upstream = (folder / "src/rosserial_python/SerialClient.py").exists()
    return str(folder / "nodes" / "serial_node.py") if is_upstream else ""


class Bridge:
    """The node under test."""

    def __init__(self, path: str, port: int, log: Path, **params: object) -> None:
        arguments = [f"_{name}:={value}" for name, value in params.items()]
        self._out = log.open("wb")
        self.popen = subprocess.Popen(
            [sys.executable, path, "_port:=tcp", f"_tcp_port:={port}", "__name:=bridge", *arguments],
            stdout=self._out,
            stderr=subprocess.STDOUT,
        )
        until = time.monotonic() + 20.0
        while subprocess.run(["ss", "-Hltn", f"sport = :{port}"], capture_output=True, check=True).stdout == b"":
            if time.monotonic() > until or self.popen.poll() is not None:
                raise RuntimeError(f"the bridge does not listen, see {log}:\n{log.read_text()}")
            time.sleep(0.1)

    def cpu_seconds(self) -> float:
        """User and system time so far [s]."""
        fields = Path(f"/proc/{self.popen.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / TICKS

    def megabytes(self, key: str) -> float:
        """Memory by `key`, Rss or Pss."""
        for line in Path(f"/proc/{self.popen.pid}/smaps_rollup").read_text().splitlines():
            if line.startswith(key + ":"):
                return int(line.split()[1]) / 1024.0
        raise OSError(f"smaps_rollup has no {key}")

    def stop(self) -> None:
        """Interrupt it."""
        self.popen.send_signal(signal.SIGINT)
        self.popen.wait(20.0)
        self._out.close()


def latencies_ms(sent: np.ndarray, heard: np.ndarray) -> np.ndarray:
    """Latencies [ms]; heartbeats of one id arrive in the order of sending, because the bridge has one thread."""
    found = []
    for sensor_id in np.unique(sent[:, 1]):
        left, right = sent[sent[:, 1] == sensor_id, 0], heard[heard[:, 1] == sensor_id, 0]
        if len(left) != len(right):
            raise RuntimeError(f"id {sensor_id}: {len(left)} heartbeats sent, {len(right)} heard")
        found.append(np.sort(right) - np.sort(left))
    return np.concatenate(found) / 1e6


def steady(folder: Path, fleet: Child, bridge: Bridge, kind: str, seconds: float) -> dict[str, float]:
    """Run heartbeats for some time: cost and latency with one listener."""
    listener = ear(kind)
    fleet.ask(steady=3.0, save="/dev/null")  # every sensor has been heard once
    time.sleep(0.3)
    listener.ask(clear=True)
    cpu, began = bridge.cpu_seconds(), time.monotonic()
    said = fleet.ask(steady=seconds, save=str(folder / "sent.npy"))
    cpu, wall = bridge.cpu_seconds() - cpu, time.monotonic() - began
    listener.ask(count=said["sent"], within=2.0, save=str(folder / "heard.npy"))
    listener.stop()
    late = latencies_ms(np.load(folder / "sent.npy"), np.load(folder / "heard.npy"))
    p50, p99, most = np.percentile(late, (50, 99, 100))
    print(
        f"  {kind}: {said['sent']} heartbeats, none lost, {said['linked']} links, {100 * cpu / wall:.1f} % of a core,"
        f" p50 {p50:.2f} p99 {p99:.2f} max {most:.1f} ms",
        flush=True,
    )
    return {"cpu": 100.0 * cpu / wall, "p50": p50, "p99": p99, "max": most}


def flood(fleet: Child, port: int, clients: int, messages: int) -> float:
    """Messages per second that get through; all must."""
    fleet.ask(connect=clients, port=port)
    time.sleep(1.5)
    listener = ear("raw")
    said = fleet.ask(flood=messages // clients)
    count = listener.ask(count=said["sent"], within=30.0, save="/dev/null")["count"]
    with tempfile.NamedTemporaryFile(suffix=".npy") as file:
        listener.ask(save=file.name)
        heard = np.load(file.name)
    listener.stop()
    fleet.ask(bye=True)
    rate = count / ((heard[-1, 0] - said["began"]) / 1e9)
    print(f"  {clients} clients: {count} of {said['sent']} messages, {rate:.0f} a second", flush=True)
    return rate if count == said["sent"] else float("nan")


def reconnect(folder: Path, fleet: Child, sensors: int) -> float:
    """Seconds until every sensor's message is on the topic, after all have lost their connection."""
    listener = ear("raw")
    time.sleep(0.5)
    listener.ask(clear=True)
    said = fleet.ask(reconnect=30.0)
    listener.ask(count=sensors, within=5.0, save=str(folder / "heard.npy"))
    listener.stop()
    heard = np.load(folder / "heard.npy")
    back = len(np.unique(heard[:, 1]))
    seconds = (heard[-1, 0] - said["began"]) / 1e9 if back == sensors else float("nan")
    print(f"  reconnect: {said['known']} negotiated, {back} heard again, {seconds:.2f} s", flush=True)
    return seconds


def killed(folder: Path, fleet: Child, bridge: Bridge, sensors: int, port: int) -> tuple[float, Bridge]:
    """Seconds from `kill -9` of the bridge, which is restarted at once, until every sensor has been heard again."""
    listener = ear("rospy")
    fleet.tell(comeback=30.0)
    time.sleep(0.5)
    began = time.monotonic_ns()
    bridge.popen.kill()
    bridge.popen.wait()
    bridge = Bridge(program(), port, folder / "again.log", max_clients=sensors + 100)
    said = fleet.hear()
    listener.ask(count=sensors, within=5.0, save=str(folder / "heard.npy"))
    listener.stop()
    heard = np.load(folder / "heard.npy")
    back = len(np.unique(heard[:, 1]))
    seconds = (heard[-1, 0] - began) / 1e9 if back == sensors else float("nan")
    print(f"  kill -9: {said['known']} negotiated, {back} heard again, {seconds:.2f} s", flush=True)
    return seconds, bridge


def measure(folder: Path, options: argparse.Namespace) -> dict[str, float]:
    figures: dict[str, float] = {}
    fleet = Child(str(HERE / "rosserial_fleet.py"))
    n = options.sensors
    try:
        if "steady" in options.parts or "reconnect" in options.parts:
            port = free_port()
            bridge = Bridge(program(), port, folder / "bridge.log", max_clients=n + 100)
            print(f"{n} sensors at 2 Hz, {fleet.ask(connect=n, port=port)['known']} negotiated", flush=True)
            if "steady" in options.parts:
                with_rospy = steady(folder, fleet, bridge, "rospy", options.seconds)
                bare = steady(folder, fleet, bridge, "raw", options.seconds)
                figures |= {"cpu_percent_500": with_rospy["cpu"], "latency_p50_ms": with_rospy["p50"]}
                figures |= {"latency_p99_ms": with_rospy["p99"], "latency_bare_p50_ms": bare["p50"]}
                figures |= {"latency_bare_p99_ms": bare["p99"]}
            if "reconnect" in options.parts:
                figures["reconnect_500_s"] = max(reconnect(folder, fleet, n) for _ in range(3))
            figures |= {"mb_500": bridge.megabytes("Rss"), "mb_pss_500": bridge.megabytes("Pss")}
            print(f"  RSS {figures['mb_500']:.1f} MB, PSS {figures['mb_pss_500']:.1f} MB")
            if "reconnect" in options.parts:
                figures["killed_500_s"], bridge = killed(folder, fleet, bridge, n, port)
            fleet.ask(bye=True)
            bridge.stop()
        if "signed" in options.parts:
            keys = folder / "keys.yaml"
            for sensor_id in range(min(n, 250)):
                add_key(keys, sensor_id, new_key())
            port = free_port()
            bridge = Bridge(program(), port, folder / "signed.log", max_clients=n + 100, key_file=str(keys))
            known = fleet.ask(connect=n, port=port, keys=str(keys))["known"]
            print(f"{n} sensors with keys, every frame signed, {known} negotiated", flush=True)
            figures["cpu_percent_500_signed"] = steady(folder, fleet, bridge, "rospy", options.seconds)["cpu"]
            fleet.ask(bye=True)
            bridge.stop()
        if "flood" in options.parts:
            for name, path in (("", program()), ("_upstream", upstream())):
                if not path:
                    print("flood of upstream's rosserial_python: not on the package path (ours stands in for it)")
                    continue
                port = free_port()
                bridge = Bridge(path, port, folder / "flood.log", **({} if name else UNLIMITED))
                print("flood" + (" of upstream's rosserial_python" if name else ""), flush=True)
                for clients in (1,) if name else (1, 100):
                    messages = 20_000 if options.quick else 200_000
                    figures[f"messages_per_s_{clients}{name}"] = flood(fleet, port, clients, messages)
                bridge.stop()
    finally:
        fleet.stop()
    return figures


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    parser.add_argument("--quick", action="store_true", help="10 seconds each, a shorter flood")
    parser.add_argument("--sensors", type=int, default=500)
    parser.add_argument("--seconds", type=float, default=60.0, help="of heartbeats, for each listener")
    parser.add_argument("--parts", nargs="+", default=["steady", "reconnect", "signed", "flood"], metavar="PART")
    options = parser.parse_args()
    if options.quick:
        options.seconds = 10.0
    try:
        from rosbot_patrol.ros.campaign.house import Master
    except ImportError as err:
        print(f"{err}: `. scripts/env` first", file=sys.stderr)
        return 1
    print(f"{os.cpu_count()} cores, load average {os.getloadavg()[0]:.1f}", flush=True)
    with tempfile.TemporaryDirectory(prefix="rosserial-") as name:
        master = Master(Path(name) / "roscore.log")
        try:
            figures = measure(Path(name), options)
        finally:
            master.stop()
    in_workspace.require_figures(figures)
    print("\n| figure | value | aim |\n|---|---|---|")
    for figure, value in figures.items():
        print(f"| {figure} | {value:.3g} | {'<= ' + str(AIMS[figure]) if figure in AIMS else ''} |")
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
