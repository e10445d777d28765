#!/usr/bin/env python3
"""What breaks around the nodes, in the middle of a patrol: notices to the owner, and time to recovery.

    python3 benchmarks/broken_house.py [--json FILE] [--only two full ...] [--pairs 6] [--seed 1]

- two: two nodes hang at once (SIGSTOP), and are killed after `--lasts` seconds; pairs drawn from the seed
- roscore: the ROS master is killed, and another started on its port
- read_only, full: the disk of the state folder
- clock: the wall clock goes forward by an hour, later back by an hour (for the nodes: shifted_clock.c)
- memory: a node needs more than the kernel lets it have (cgroup), and is killed by it

As in broken_nodes.py somebody stands in the room. Disks and cgroups need root. What cannot be tried here is named.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import argparse
import contextlib
import os
import random
import signal
import struct
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from broken_nodes import LEFT_OUT, NOT_ROS, Diagnostics, Fault, Row, mission_with, report, table

from rosbot_patrol.host import orphans
from rosbot_patrol.ros.campaign.house import House, HouseError, Master

FAULTS = ("two", "roscore", "read_only", "full", "clock", "memory")
GREEDY = ("patrolling_node", "move_base", "darknet_ros")
NOT_AGAIN = ("teleop_twist_keyboard",)  # roslaunch does not start it again
SHIFTED = Path(__file__).parent / "shifted_clock.c"
HOUR = 3600.0  # [s]


class Refused(Exception):
    """This cannot be tried here; a sentence."""


def run(*command: str | Path) -> None:
    """Run a command. Raises Refused."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Refused(f"{' '.join(map(str, command))}: {done.stderr.strip()}")


class Trial:
    """A house for one fault, on a master and a disk of its own.

    Args:
        folder: for logs, mails and state.
        lasts: duration of faults that end by themselves [s].
        options: arguments of the launch file.
    """

    def __init__(self, folder: Path, lasts: float, options: dict[str, object]) -> None:
        self.folder, self.lasts = folder, lasts
        self.disk, self.clock = folder / "disk", folder / "clock"
        folder.mkdir(parents=True)
        self.disk.mkdir()
        self.shift(0.0)
        self.house = House(folder, state_dir=str(self.disk / "state"), **options)
        self._undo: list[Callable[[], None]] = []

    def two(self, pair: tuple[str, str]) -> Fault:
        """Two nodes that hang."""
        pids = [self.house.pids()[f"/{node}"] for node in pair]

        def send(number: int) -> None:
            for pid in pids:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, number)

        return Fault(lambda: send(signal.SIGSTOP), lambda: send(signal.SIGKILL), self.lasts)

    def roscore(self) -> Fault:
        """Another ROS master on the same port."""
        uri = os.environ["ROS_MASTER_URI"]

        def kill() -> None:
            (pid,) = [pid for pid, name in orphans.find(uri).items() if name == orphans.MASTER]
            os.kill(pid, signal.SIGKILL)

        def start() -> None:
            core = subprocess.Popen(
                ["roscore", "-p", uri.rpartition(":")[2].strip("/")],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
            self._undo.append(lambda: os.killpg(core.pid, signal.SIGINT))

        return Fault(kill, start, self.lasts)

    def mount(self) -> None:
        """Make the state folder's disk one of its own. Raises Refused."""
        run("mount", "-t", "tmpfs", "-o", "size=40m", "none", self.disk)
        self._undo.append(lambda: run("umount", "-l", self.disk))

    def read_only(self) -> Fault:
        """The disk of the state folder takes nothing."""

        def hit() -> None:
            run("mount", "--bind", self.disk, self.disk)
            run("mount", "-o", "remount,bind,ro", self.disk)

        return Fault(hit, lambda: run("umount", "-l", self.disk), self.lasts)

    def full(self) -> Fault:
        """The disk of the state folder is full."""
        filler = self.disk / "filler"

        def hit() -> None:
            with contextlib.suppress(OSError), filler.open("wb", buffering=0) as out:
                while True:
                    out.write(bytes(1 << 16))

        return Fault(hit, filler.unlink, self.lasts)

    def step(self) -> Fault:
        """An hour forward, and back to where it was, which is an hour back."""
        return Fault(lambda: self.shift(HOUR), lambda: self.shift(0.0), self.lasts)

    def shift(self, seconds: float) -> None:
        """Set the nodes' wall clock off."""
        with self.clock.open("r+b" if self.clock.exists() else "wb") as out:  # the nodes have it mapped
            out.write(struct.pack("d", seconds))

    def memory(self, node: str) -> Fault:
        """The kernel kills a node that needs more than it may have. Raises Refused."""
        pid = self.house.pids()[f"/{node}"]
        group = next((p for p in (Path("/sys/fs/cgroup/memory"), Path("/sys/fs/cgroup")) if p.is_dir()), None)
        if group is None or os.geteuid() != 0:
            raise Refused("cgroups of memory need root")
        own = group / f"broken_house_{pid}"

        def hit() -> None:  # what it has stays with its old group; from now on it gets hardly a page more
            own.mkdir()
            limit = "memory.limit_in_bytes" if group.name == "memory" else "memory.max"
            (own / limit).write_text("64K")
            (own / "cgroup.procs").write_text(str(pid))

        self._undo.append(lambda: own.rmdir() if own.is_dir() else None)
        return Fault(hit, lambda: None, 5.0)

    def environment(self) -> dict[str, str]:
        """Variables with which the nodes see `clock`. Raises Refused."""
        library = self.folder / "shifted_clock.so"
        run("gcc", "-shared", "-fPIC", "-O2", "-o", library, SHIFTED, "-ldl", "-lm")
        return {"LD_PRELOAD": str(library), "SHIFTED_CLOCK": str(self.clock)}

    def end(self) -> None:
        """Stop the house, and give everything back."""
        self.house.stop()
        for undo in reversed(self._undo):
            with contextlib.suppress(Refused, OSError):
                undo()


def faults(names: list[str], pairs: int, seed: int) -> Iterator[tuple[str, object]]:
    """What is tried: name and what it is about; a pair is drawn once the nodes are known."""
    for name in names:
        if name == "two":
            yield from (("two", random.Random(f"{seed}/{number}")) for number in range(pairs))
        elif name == "memory":
            yield from (("memory", node) for node in GREEDY)
        else:
            yield name, None


def play(name: str, about: object, trial: Trial) -> Row:
    """Start the house, and play one fault. Raises Refused, HouseError."""
    if name in ("read_only", "full"):
        trial.mount()
    trial.house.start(trial.environment() if name == "clock" else None)
    trial.house.wait_ready(120.0)
    diagnostics = Diagnostics()
    time.sleep(8.0)
    if name == "two":
        nodes = sorted(n.lstrip("/") for n in trial.house.pids())
        nodes = [n for n in nodes if n not in (*LEFT_OUT, *NOT_AGAIN) and not n.startswith(NOT_ROS)]
        assert isinstance(about, random.Random)
        first, second = about.sample(nodes, 2)
        fault, row = trial.two((first, second)), Row(f"{first}, {second}", "hung")
    elif name == "memory":
        fault, row = trial.memory(str(about)), Row(str(about), "out of memory")
    else:
        made = {"roscore": trial.roscore, "read_only": trial.read_only, "full": trial.full, "clock": trial.step}
        words = {"roscore": "killed and another", "clock": "+1 h, -1 h"}
        fault, row = made[name](), Row(name, words.get(name, "disk"))
    return mission_with(trial.house, diagnostics, row, fault)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--only", nargs="+", default=list(FAULTS), choices=FAULTS)
    parser.add_argument("--pairs", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lasts", type=float, default=20.0, help="duration of a fault [s]")
    parser.add_argument("--rate", type=float, default=2.0)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="broken_house_"))
    print(f"logs in {folder}; {os.cpu_count()} cores")
    master = Master(folder / "roscore.log")
    rows: list[Row] = []
    names = sorted(options.only, key=lambda name: name == "roscore")  # the last: this program does not sign on again
    try:
        for number, (name, about) in enumerate(faults(names, options.pairs, options.seed)):
            trial = Trial(folder / f"{number}_{name}", options.lasts, {"rate": options.rate, "respawn_delay": 5})
            try:
                rows.append(play(name, about, trial))
            except (Refused, HouseError) as err:
                rows.append(Row(name, str(about or ""), sentence=str(err).splitlines()[0]))
            finally:
                trial.end()
            print(table(rows[-1:]).splitlines()[-1], flush=True)
    finally:
        master.stop()
    report(rows, options.json)


if __name__ == "__main__":
    main()
