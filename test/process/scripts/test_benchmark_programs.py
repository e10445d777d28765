"""A benchmark run by Debian's Python goes on in the workspace's."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[3] / "benchmarks"


@pytest.mark.parametrize("shell", ["", f'. "{FOLDER.parent}/scripts/env" && '], ids=["any shell", "of scripts/env"])
def test_debian_s_python_does(shell: str) -> None:
    if not (FOLDER.parent / ".ws" / "venv" / "bin" / "python").exists():
        pytest.skip("the workspace is not built")
    command = f'{shell}/usr/bin/python3 "{FOLDER}/alerts.py" --help'
    clean = {"PATH": "/usr/bin:/bin", "HOME": os.environ.get("HOME", "/")}
    done = subprocess.run(["bash", "-c", command], env=clean, capture_output=True, text=True, timeout=60.0)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("usage: alerts.py")
    assert done.stderr == ""
