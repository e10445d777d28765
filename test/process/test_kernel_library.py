"""Programs with and without compiled kernels."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rosbot_patrol.files import kernel_library

USE = """
import sys
import numpy as np
from rosbot_patrol.amcl.motion_kernels import move_sliding
poses = np.zeros((1, 3))
move_sliding(poses, np.array([0.0, 4.0, 0.0]), np.zeros(3), np.zeros((1, 3)))
print(round(poses[0, 0]), "numba" in sys.modules)
"""


def run(**environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", USE],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
    )


@pytest.mark.skipif(not kernel_library().exists(), reason="the set-up has not compiled these kernels")
def test_a_program_with_the_library_never_loads_numba() -> None:
    done = run()
    assert done.stdout.split() == ["4", "False"]
    assert done.stderr == ""


def test_a_program_without_the_library_says_so_and_compiles_what_it_needs(tmp_path: Path) -> None:
    done = run(ROSBOT_PATROL_CACHE=str(tmp_path))
    assert done.stdout.split() == ["4", "True"]
    assert "There are no compiled kernels at" in done.stderr
    assert "`scripts/bootstrap` compiles them" in done.stderr
    assert done.stderr.count("There are no compiled kernels") == 1


def test_plain_python_needs_neither(tmp_path: Path) -> None:
    done = run(ROSBOT_PATROL_CACHE=str(tmp_path), NUMBA_DISABLE_JIT="1")
    assert done.stdout.split() == ["4", "False"]
    assert done.stderr == ""
