"""A dask scheduler and its workers, as processes of their own."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from rosbot_patrol.ros.campaign.cluster import Cluster, ClusterError


class Machines:
    """A scheduler and its workers."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        self.processes: list[subprocess.Popen[bytes]] = []

    def schedule(self) -> None:
        port = self.address.rpartition(":")[2]
        module = "distributed.cli.dask_scheduler"
        self.start(["-W", "ignore", "-m", module, "--host", "127.0.0.1", "--port", port, "--no-dashboard"])

    def start(
        self, arguments: list[str], changes: dict[str, str] | None = None, cwd: Path | None = None
    ) -> subprocess.Popen[bytes]:
        """Start a Python program."""
        with (self.folder / "log").open("ab") as log:
            env = {**os.environ, **(changes or {})}
            command = [sys.executable, *arguments]
            self.processes.append(
                subprocess.Popen(
                    command, env=env, stdout=log, stderr=log, cwd=cwd or self.folder, start_new_session=True
                )
            )
        return self.processes[-1]

    def close(self) -> None:
        for process in self.processes:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.wait(10.0)


def connected(make: Callable[[], Cluster]) -> Cluster:
    """The cluster, as soon as its scheduler answers."""
    deadline = time.monotonic() + 30.0
    while True:
        try:
            return make()
        except ClusterError:
            assert time.monotonic() < deadline
