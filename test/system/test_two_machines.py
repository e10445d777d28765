"""The tutorial's two machines, robot and PC: each a network namespace of its own, with a cable that is pulled.

The cut cable takes more than four minutes, most of it the seconds after which TCP tries again: `scripts/test --long`.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rosbot_patrol.ros.campaign.house", reason="the workspace is not on the path: `. scripts/env`")
pytestmark = pytest.mark.system

INSIDE = Path(__file__).with_name("two_machines_inside.py")
TRY = "ip tuntap add dev try0 mode tap && unshare -n true"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("addresses", "variables", "test"),
    [
        pytest.param(
            ("10.78.0.1", "10.78.0.2"),
            {},
            "test_the_chain_and_the_cut_cable",
            id="ipv4",
            marks=pytest.mark.long,
        ),
        pytest.param(("fd78::1", "fd78::2"), {"ROS_IPV6": "on"}, "test_the_chain", id="ipv6"),
    ],
)
def test_robot_and_pc_are_two_machines(
    addresses: tuple[str, str], variables: dict[str, str], test: str, tmp_path: Path
) -> None:
    tried = subprocess.run(["unshare", "-n", "-m", "sh", "-c", TRY], capture_output=True, text=True, check=False)
    if tried.returncode:
        pytest.skip(f"network namespaces with TAP devices are not permitted here: {tried.stderr.strip()}")
    names = zip((*addresses, "127.0.0.1", "::1"), ("robot", "pc", "localhost", "localhost"), strict=True)
    (tmp_path / "hosts").write_text("".join(f"{address} {name}\n" for address, name in names))
    alive = 'ip link set lo up && mount --bind "$0" /etc/hosts && exec "$@"'
    program = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-s",
        "-p",
        "no:cacheprovider",
        f"--basetemp={tmp_path / 'inside'}",
    ]
    command = ["unshare", "-n", "-m", "sh", "-c", alive, str(tmp_path / "hosts"), *program, f"{INSIDE}::{test}"]
    done = subprocess.run(
        command, env={**os.environ, **variables}, capture_output=True, text=True, timeout=400.0, check=False
    )
    sys.stdout.write("".join(line + "\n" for line in done.stdout.splitlines() if line.startswith("two machines:")))
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-3000:]
