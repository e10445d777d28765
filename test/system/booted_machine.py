"""This machine's tree booted by systemd, in namespaces of its own, over a layer that takes what is written.

Needs root, overlayfs, and a cgroup2 hierarchy that can be mounted.
"""

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

_OUTSIDE = """
set -e
echo $$ > {groups}/cgroup.procs
exec unshare -m -p -u -i -n -C --fork --kill-child --propagation private sh {folder}/inside.sh
"""
_INSIDE = """
set -e
R={folder}/root
mount -t proc proc $R/proc
mount --bind $R/proc/sys $R/proc/sys
mount -o remount,ro,bind $R/proc/sys
mount -t sysfs sysfs $R/sys -o ro
mount -t cgroup2 cgroup2 $R/sys/fs/cgroup
mount -t tmpfs run $R/run
mount -t tmpfs tmp $R/tmp
mount --rbind /dev $R/dev
ip link set lo up
hostname robot
cd $R
pivot_root . mnt
umount -l /mnt
exec env -i container=other PATH=/usr/sbin:/usr/bin:/sbin:/bin /sbin/init systemd.unit=multi-user.target
"""
# what needs a console, changes the kernel's settings, or belongs to other work on this machine
_LEFT_OUT = (
    *("console-getty", "getty@tty1", "systemd-sysctl", "systemd-binfmt", "systemd-modules-load"),
    *("postgresql", "postfix", "mosquitto"),
)
REFUSED = "systemd cannot be booted in namespaces here"


class Machine:
    """A machine that can be switched on and off; what it wrote stays."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.groups = Path("/sys/fs/cgroup/patrol-test")
        self._hierarchy = None
        self._outside = None
        for name in ("up", "work", "root"):
            (self.folder / name).mkdir()

    def on(self):
        """Mount its tree and boot; returns once systemd answers."""
        if (
            self._hierarchy is None and not Path("/sys/fs/cgroup/cgroup.controllers").exists()
        ):  # the older hierarchies: mount the new one aside
            self._hierarchy = self.folder / "cgroup"
            self._hierarchy.mkdir(exist_ok=True)
            _run("mount", "-t", "cgroup2", "cgroup2", str(self._hierarchy))
            self.groups = self._hierarchy / "patrol-test"
        self.groups.mkdir(exist_ok=True)
        layers = f"lowerdir=/,upperdir={self.folder}/up,workdir={self.folder}/work"
        _run("mount", "-t", "overlay", "overlay", "-o", layers, str(self.folder / "root"))
        units = self.folder / "root" / "etc" / "systemd" / "system"
        for name in _LEFT_OUT:
            link = units / f"{name}.service"
            link.unlink(missing_ok=True)
            link.symlink_to("/dev/null")
        words = {"folder": self.folder, "groups": self.groups}
        (self.folder / "inside.sh").write_text(_INSIDE.format(**words))
        (self.folder / "outside.sh").write_text(_OUTSIDE.format(**words))
        log = (self.folder / "log").open("w")
        command = ["sh", str(self.folder / "outside.sh")]
        self._outside = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        self._wait(lambda: self.run("systemctl", "is-system-running", is_well=False).strip() in ("running", "degraded"))

    def off(self):
        """Cut its power."""
        if self._outside is not None:
            init = self._init()
            if init is not None:
                os.kill(init, signal.SIGKILL)
            self._outside.kill()
            self._outside.wait()
            self._outside = None
        time.sleep(0.5)
        subprocess.run(["umount", "-R", str(self.folder / "root")], check=False, capture_output=True)

    def remove(self):
        """Switch it off and forget it."""
        self.off()
        for group in sorted(self.groups.rglob("*/"), reverse=True):  # the deepest first
            group.rmdir()
        self.groups.rmdir()
        if self._hierarchy is not None:
            _run("umount", str(self._hierarchy))
        shutil.rmtree(self.folder / "up")

    def run(self, *words, is_well=True, seconds=60.0):
        """What a command says on it."""
        init = self._init()
        if init is None:
            return ""
        enter = ["nsenter", "-t", str(init), "-m", "-p", "-u", "-i", "-n", "-C", "--"]
        clean = [
            "env",
            "-i",
            "PATH=/usr/sbin:/usr/bin:/sbin:/bin",
            "HOME=/root",
            "bash",
            "-c",
            'cd / && exec "$@"',
            "-",
        ]
        done = subprocess.run([*enter, *clean, *words], capture_output=True, text=True, timeout=seconds, check=False)
        assert not is_well or done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
        return done.stdout + (done.stderr if is_well else "")

    def _init(self):
        """Process id of its systemd, as this machine sees it."""
        if self._outside is None:
            return None
        children = Path(f"/proc/{self._outside.pid}/task/{self._outside.pid}/children").read_text().split()
        return int(children[0]) if children else None

    def _wait(self, condition, seconds=30.0):
        until = time.monotonic() + seconds
        while not condition():
            said = (self.folder / "log").read_text()
            assert self._outside.poll() is None, f"{REFUSED}: {said}"
            assert time.monotonic() < until, f"it did not boot: {said}"
            time.sleep(0.1)


def _run(*command):
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{REFUSED}: {done.stderr}"
