"""Machines as network namespaces on one switch, each with its own files of the system's set-up."""

import os
import subprocess
from pathlib import Path

from ros_processes import Process, wait_for

ROOT = Path(__file__).resolve().parents[2]
OWN = ("/etc/rosbot_patrol", "/etc/wireguard", "/run/rosbot_patrol", "/run/wireguard")  # folders of each host's own
_HOLD = "".join(f"mkdir -p {d} && mount -t tmpfs own {d} && " for d in OWN) + "ip link set lo up && exec sleep 600"
SWITCH = "br77"


def ip(*arguments):
    subprocess.run(["ip", *arguments], check=True)


def make_switch():
    ip("link", "add", SWITCH, "type", "bridge")
    ip("link", "set", SWITCH, "up")


class Host:
    """A machine at 10.77.0.NUMBER and fd77::NUMBER."""

    def __init__(self, name, number):
        self.name, self.address, self.address6 = name, f"10.77.0.{number}", f"fd77::{number}"
        self._holder = subprocess.Popen(["unshare", "-n", "-m", "--propagation", "private", "sh", "-c", _HOLD])
        pid = str(self._holder.pid)
        self._enter = ["nsenter", "-t", pid, "-n", "-m", f"--wd={ROOT}", "--"]
        wait_for(lambda: Path(f"/proc/{pid}/comm").read_text() == "sleep\n", what=f"the host {name}")
        ip("link", "add", f"to-{name}", "type", "veth", "peer", "name", "eth0", "netns", pid)
        ip("link", "set", f"to-{name}", "master", SWITCH, "up")
        self.run("ip", "addr", "add", f"{self.address}/24", "dev", "eth0")
        self.run("ip", "addr", "add", f"{self.address6}/64", "dev", "eth0", "nodad")
        self.run("ip", "link", "set", "eth0", "up")
        self.processes = []

    def command(self, *words):
        return [*self._enter, *words]

    def run(self, *words, env=None, is_well=True):
        """What a program says; it has to end well, unless told otherwise."""
        done = subprocess.run(
            self.command(*words), capture_output=True, text=True, timeout=60.0, check=False, env=env or clean_env()
        )
        assert not is_well or done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
        return done.stdout + done.stderr

    def in_workspace(self, *words, **given):
        """A command as a shell gives it after `. scripts/env`; `given`: variables that were set before."""
        before = [f"{name}={value}" for name, value in given.items()]
        return ["env", *before, "bash", "-c", '. scripts/env && exec "$@"', "-", *words]

    def ask(self, *words, is_well=True, **given):
        """What a program of the workspace says."""
        return self.run(*self.in_workspace(*words, **given), is_well=is_well)

    def start(self, *words, **given):
        process = Process(self.command(*self.in_workspace(*words, **given)), clean_env(), stdin=subprocess.DEVNULL)
        self.processes.append(process)
        return process

    def stop(self):
        for process in reversed(self.processes):
            process.stop()
        self._holder.kill()
        self._holder.wait()


def clean_env():
    """The environment of a fresh shell: nobody has said where the master is."""
    left_out = ("ROS_MASTER_URI", "ROS_HOSTNAME", "ROS_IP", "PYTHONPATH")
    return {**{k: v for k, v in os.environ.items() if k not in left_out}, "PYTHONUNBUFFERED": "1"}
