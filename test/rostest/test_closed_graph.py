"""Who may command: a stranger's orders before and after scripts/secure, between hosts that are network namespaces."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from test_two_hosts import namespace

HERE = Path(__file__).parent


def run(inside, *programs, seconds=180.0):
    for program in programs:
        if shutil.which(program, path="/usr/sbin:/usr/bin") is None:
            pytest.skip(f"{program} is not installed")
    command = [*namespace(), sys.executable, "-m", "pytest", "-q", "-s", "-p", "no:cacheprovider", str(HERE / inside)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_stranger_is_shut_out():
    run("closed_graph_inside.py", "nft", "wg", "wireguard-go")


@pytest.mark.long
def test_what_a_stranger_does_to_an_open_graph_is_noticed():
    run("graph_tricks_inside.py", seconds=400.0)
