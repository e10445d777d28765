"""Who may command: a stranger's orders before and after scripts/secure, between hosts that are network namespaces."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from test_two_hosts import namespace

INSIDE = Path(__file__).with_name("closed_graph_inside.py")


def test_a_stranger_is_shut_out():
    for program in ("nft", "wg", "wireguard-go"):
        if shutil.which(program, path="/usr/sbin:/usr/bin") is None:
            pytest.skip(f"{program} is not installed")
    command = [*namespace(), sys.executable, "-m", "pytest", "-q", "-s", "-p", "no:cacheprovider", str(INSIDE)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=180.0, check=False)
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr
