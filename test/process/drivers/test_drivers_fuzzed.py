"""Damaged streams of every device: by `fuzz_drivers.py`, a few here, a million by hand."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

FUZZER = Path(__file__).with_name("fuzz_drivers.py")


def test_damaged_streams_are_survived() -> None:
    done = subprocess.run([sys.executable, str(FUZZER), "9000", "7"], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("9000 inputs")
