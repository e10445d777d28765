"""What a node is given of the processor before others, with rights and without; in processes of their own."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from rosbot_patrol.ros.runtime import process as priority

NOBODY = 65534  # who may not be able to read this repository: the module goes along as text
CODE = """
import os, sys, threading
seen = dict(__name__="priority")
exec(sys.stdin.read(), seen)
said = seen["take"](seen["Priority"].{})
kinds = []
thread = threading.Thread(target=lambda: kinds.append(os.sched_getscheduler(0)))
thread.start(); thread.join()
print(said, kinds[0] == os.SCHED_RR, os.nice(0), open("/proc/self/autogroup").read().split()[-1], sep="|")
"""


def take(level: str, user: int | None = None) -> list[str]:
    found = subprocess.run(
        ["/usr/bin/python3", "-c", CODE.format(level)],
        input=Path(priority.__file__).read_text(encoding="utf-8"),
        cwd="/",
        env={"PATH": "/usr/bin:/bin"},
        user=user,
        start_new_session=True,
        capture_output=True,
        text=True,
        check=True,
        timeout=20,
    )
    return found.stdout.strip().split("|")


needs_autogroup = pytest.mark.skipif(not Path("/proc/self/autogroup").exists(), reason="a kernel without autogroup")
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root may raise priorities")


@needs_autogroup
def test_an_ordinary_node_stays_ordinary():
    assert take("ORDINARY")[:2] == ["", "False"]


@needs_autogroup
@as_root
def test_a_control_loop_goes_before_all_that_is_ordinary_with_all_its_threads():
    said, is_real_time, _, _ = take("CONTROL")
    if said.startswith("real-time scheduling is not permitted"):
        pytest.skip(said)
    assert (said, is_real_time) == ("", "True")


@needs_autogroup
@as_root
def test_a_raised_node_goes_first_with_its_session():
    said, is_real_time, nice, session = take("RAISED")
    assert (said, is_real_time, session) == ("", "False", "-5")
    assert int(nice) == os.nice(0) - 5


@needs_autogroup
@as_root
def test_without_rights_it_says_what_is_missing():
    said, is_real_time, _, session = take("CONTROL", NOBODY)
    assert "RLIMIT_RTPRIO" in said
    assert "RLIMIT_NICE" in said
    assert (is_real_time, session) == ("False", "0")
