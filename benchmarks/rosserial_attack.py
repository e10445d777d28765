#!/usr/bin/env python3
"""Effects of an attacker on the bridge's port on honest sensors, over loopback, with a real master.

    python3 benchmarks/rosserial_attack.py [--json FILE] [--quick] [--sensors 100]

The attacks are those of the tests (test/process/rosserial/attacks.py), one after the other and then all at once from
eight addresses, each against a bridge with lists and against one with keys. The attacker is a separate process at low
priority, because a real attacker would not use this machine's processor.

Latency is measured on the sensors' heartbeats, from `send` to a bare TCPROS subscriber, with the bridge's work for the
attacker included. Memory is the bridge's RSS. `forged` counts messages in another sensor's name that came through.
`allowed` counts messages of the one sensor that the attacker's address may be under lists.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from rosserial import HERE, Bridge, Child, ear, free_port, program

from rosbot_patrol.rosserial.protocol.keys import add_key, new_key

ATTACKS = HERE.parent / "test" / "process" / "rosserial" / "attacks.py"
SOURCE = "127.0.0.66"
ALLOWED_ID = 201  # with lists the attacker's address may be this sensor, so that messages come through
EVERYTHING = "all at once, 8 addresses"
COLUMNS = ("attack", "tries", "heartbeats lost", "links lost", "p50 ms", "p99 ms", "max ms", "CPU %", "MB")
COLUMNS += ("forged", "allowed", "log lines")


class House:
    """A bridge, its sensors and one listener."""

    def __init__(self, folder: Path, protection: str, sensors: int) -> None:
        self.sensors = sensors
        self.port = free_port()
        params: dict[str, object] = {"allow_sensors": f"['127.1.0.0/16 0-200', '127.0.0.64/27 {ALLOWED_ID}']"}
        more = {}
        if protection == "keys":
            keys = folder / "keys.yaml"
            for number in range(sensors):
                add_key(keys, number, new_key())
            params = {"key_file": keys}
            more = {"keys": str(keys)}
        self.log = folder / f"{protection}.log"
        self.bridge = Bridge(program(), self.port, self.log, **params)
        self.fleet = Child(str(HERE / "rosserial_fleet.py"))
        known = self.fleet.ask(connect=sensors, port=self.port, **more)["known"]
        print(f"\n{protection}: {known} of {sensors} sensors negotiated", flush=True)
        self.ear = ear("raw")
        self.folder = folder

    def measure(self, seconds: float, attack: str = "") -> dict[str, Any]:
        """Run heartbeats for some time, with an attack beside them."""
        self.fleet.ask(steady=1.0, save="/dev/null")
        time.sleep(0.3)
        self.ear.ask(clear=True)
        attacker = self._attack(attack, seconds + 2.0) if attack else None
        time.sleep(1.0 if attack else 0.0)
        cpu, began, lines = self.bridge.cpu_seconds(), time.monotonic(), len(self.log.read_bytes().splitlines())
        said = self.fleet.ask(steady=seconds, save=str(self.folder / "sent.npy"))
        cpu, wall = self.bridge.cpu_seconds() - cpu, time.monotonic() - began
        time.sleep(0.5)
        self.ear.ask(save=str(self.folder / "heard.npy"))
        tries = 0
        if attacker is not None:
            tries = sum(int(line.rpartition(":")[2]) for line in attacker.communicate(timeout=60.0)[0].splitlines())
        sent, heard = np.load(self.folder / "sent.npy"), np.load(self.folder / "heard.npy")
        late, counts = compare(sent, heard)
        p50, p99, most = np.percentile(late, (50, 99, 100)) if len(late) else (np.nan,) * 3
        return {
            "attack": attack or "none",
            "tries": tries,
            "sent": len(sent),
            **counts,
            "breaks": said["breaks"],
            "p50": p50,
            "p99": p99,
            "max": most,
            "cpu": 100.0 * cpu / wall,
            "mb": self.bridge.megabytes("Rss"),
            "lines": len(self.log.read_bytes().splitlines()) - lines,
        }

    def _attack(self, name: str, seconds: float) -> subprocess.Popen[str]:
        which = ["--sources", "8"] if name == EVERYTHING else ["--only", name]
        command = [sys.executable, str(ATTACKS), str(self.port), "--source", SOURCE, "--seconds", str(seconds), *which]
        return subprocess.Popen(["nice", "-n", "15", *command], stdout=subprocess.PIPE, text=True)

    def stop(self) -> None:
        """End all processes."""
        self.ear.stop()
        self.fleet.stop()
        self.bridge.stop()


def compare(sent: np.ndarray, heard: np.ndarray) -> tuple[np.ndarray, dict[str, int]]:
    """Latencies [ms] of the ids with equal numbers sent and received, and the numbers of missing and surplus messages.

    Messages with the id that the lists allow the attacker are counted apart.
    """
    late, lost, forged = [np.empty(0)], 0, 0
    ids = heard[:, 1] & 0xFF
    for sensor_id in np.unique(sent[:, 1]):
        left, right = sent[sent[:, 1] == sensor_id, 0], heard[ids == sensor_id, 0]
        lost += max(len(left) - len(right), 0)
        forged += max(len(right) - len(left), 0)
        if len(left) == len(right):
            late.append((np.sort(right) - np.sort(left)) / 1e6)
    forged += int(np.sum(~np.isin(ids, [*np.unique(sent[:, 1]), ALLOWED_ID])))
    return np.concatenate(late), {"lost": lost, "forged": forged, "allowed": int(np.sum(ids == ALLOWED_ID))}


def row(figures: dict[str, Any]) -> str:
    """Format one line of the table."""
    f = figures
    latencies = f"{f['p50']:.2f} | {f['p99']:.2f} | {f['max']:.1f}"
    bridge = f"{f['cpu']:.1f} | {f['mb']:.1f} | {f['forged']} | {f['allowed']} | {f['lines']}"
    return f"| {f['attack']} | {f['tries']} | {f['lost']} of {f['sent']} | {f['breaks']} | {latencies} | {bridge} |"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    parser.add_argument("--quick", action="store_true", help="3 seconds each")
    parser.add_argument("--sensors", type=int, default=100, help="up to 200")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each attack")
    parser.add_argument("--protection", nargs="+", default=["lists", "keys"], choices=["lists", "keys"])
    parser.add_argument("--only", nargs="+", metavar="ATTACK", help="some of the attacks")
    options = parser.parse_args()
    seconds = 3.0 if options.quick else options.seconds
    sys.path.insert(0, str(ATTACKS.parent))
    import attacks

    try:
        from rosbot_patrol.ros.campaign.house import Master
    except ImportError as err:
        print(f"{err}: `. scripts/env` first", file=sys.stderr)
        return 1
    print(f"{os.cpu_count()} cores, load average {os.getloadavg()[0]:.1f}", flush=True)
    figures = {}
    with tempfile.TemporaryDirectory(prefix="rosserial-") as name:
        master = Master(Path(name) / "roscore.log")
        try:
            for protection in options.protection:
                house = House(Path(name), protection, options.sensors)
                print(f"| {' | '.join(COLUMNS)} |\n{'|---' * len(COLUMNS)}|", flush=True)
                figures[protection] = []
                for attack in ["", *(options.only or [*attacks.ATTACKS, EVERYTHING])]:
                    figures[protection].append(house.measure(seconds, attack))
                    print(row(figures[protection][-1]), flush=True)
                house.stop()
        finally:
            master.stop()
    in_workspace.require_figures(figures)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
