"""The program `explore` as the set-up guide runs it, beside slam_gmapping."""

from __future__ import annotations

import logging
import re
import signal
import subprocess
import threading
from functools import partial
from pathlib import Path

from rosbot_patrol.console.live.guide import ExplorationNow
from rosbot_patrol.console.live.orders import Answer
from rosbot_patrol.ros.runtime.node import Worker

log = logging.getLogger(__name__)

_LINE = re.compile(r"^(?:\x1b\[\d*m)?\[(?P<level>\w+)\] \[[^\]]*\]: (?P<text>.*?)(?:\x1b\[\d*m)?$")
_PATIENCE = 10.0  # [s] for its end


class RosExploration:
    """Starts, follows and ends it.

    Args:
        map_file: that it writes, a yaml file; its folder is made.
    """

    def __init__(self, map_file: Path) -> None:
        self._map_file = map_file
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._now = ExplorationNow(state="done" if map_file.exists() else "new")

    @property
    def now(self) -> ExplorationNow:
        """How it stands."""
        return self._now

    def start(self) -> Answer:
        """Begin, or begin anew."""
        with self._lock:
            if self._process is not None and self._process.poll() is None:
                return Answer(accepted=False, text="the robot explores already")
            self._map_file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            stem = self._map_file.with_suffix("")
            command = ["rosrun", "rosbot_patrol", "explore", f"_save_map:={stem}"]
            self._process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
            )
            self._now = ExplorationNow(state="running")
            Worker(partial(self._follow, self._process), name="exploration").start()
        return Answer(accepted=True, text="the robot explores the house")

    def stop(self) -> Answer:
        """Give up; nothing is saved."""
        with self._lock:
            if self._process is None or self._process.poll() is not None:
                return Answer(accepted=False, text="the robot does not explore")
            self._process.send_signal(signal.SIGINT)
            try:
                self._process.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                self._process.kill()
            self._now = ExplorationNow(state="done" if self._map_file.exists() else "new")
        return Answer(accepted=True, text="the robot has stopped exploring")

    def _follow(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        last = ""
        for line in process.stdout:
            found = _LINE.match(line.strip())
            if found is None:
                continue
            last = found["text"]
            log.info("exploration: %s", last)
            if process is self._process and self._now.state == "running":
                self._now = ExplorationNow(state="running", text=last)
        status = process.wait()
        if process is self._process and self._now.state == "running":
            is_done = status == 0 and self._map_file.exists()
            self._now = ExplorationNow(state="done" if is_done else "failed", text=last)
