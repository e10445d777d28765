"""scripts/set_up_network, and bootstrap's options, without the Internet."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from rosbot_patrol.detection.catalogue import CATALOGUE, REAL_CAMERA

ROOT = Path(__file__).parents[3]
NETWORK = ROOT / "drop_in" / "darknet_ros" / "yolo_network_config"
IS_THERE = any(
    (NETWORK / part / file.file).exists() for part in ("cfg", "weights") for file in CATALOGUE[REAL_CAMERA].files
)


def run(script: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [str(ROOT / "scripts" / script), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, env=os.environ)


@pytest.mark.skipif(IS_THERE, reason=f"{REAL_CAMERA} was downloaded here")
def test_without_the_internet_it_says_what_the_guard_uses_and_succeeds() -> None:
    done = run("set_up_network", "--url", "http://127.0.0.1:1/")
    assert done.returncode == 0
    assert f"http://127.0.0.1:1/{REAL_CAMERA}.cfg cannot be reached" in done.stderr
    assert f"{REAL_CAMERA} is not ready: " in done.stdout
    last = done.stdout.splitlines()[-1]
    assert last.startswith(("With a real camera, the guard uses ssdlite", "The guard has no network"))


def test_an_option_that_bootstrap_does_not_know() -> None:
    done = run("bootstrap", "--robto")
    assert (done.returncode, done.stdout) == (1, "")
    assert "'--robto' is no option, expected --test or --robot" in done.stderr
