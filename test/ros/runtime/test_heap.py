"""Large blocks go back to the system when they are freed."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

# Copies of 12 MB, made and dropped in several threads.
CODE = """
import threading
import numpy as np
from pathlib import Path
from rosbot_patrol.ros.runtime.process import give_back_memory

def megabytes():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4 // 1024

assert give_back_memory()
cells = np.ones(12_250_000, np.uint8)
before = megabytes()

def work():
    for _ in range(10):
        first = cells.copy()
        second = first + 1

threads = [threading.Thread(target=work) for _ in range(6)]
[t.start() for t in threads]
[t.join() for t in threads]
print(megabytes() - before)
"""


def test_what_threads_have_freed_is_given_back() -> None:
    told = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    assert int(told.stdout) < 20
