"""What the service's programs do: orphans, logs, settings, words to systemd; with real processes and sockets."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from rosbot_patrol.errors import ParamError
from rosbot_patrol.host import old_logs, orphans, serve
from rosbot_patrol.host.service_units import Service
from rosbot_patrol.host.watchdog import Systemd

MASTER = "http://localhost:59999"


def orphan(name: str, text: str = "import time; print('up', flush=True); time.sleep(60)", master: str = MASTER):
    """A process as roslaunch starts a node."""
    process = subprocess.Popen(
        [sys.executable, "-c", text, f"__name:={name}"],
        env={**os.environ, "ROS_MASTER_URI": master},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    process.stdout.readline()
    return process


def test_orphans_are_ended_and_others_are_not() -> None:
    stubborn = "import signal,time; signal.signal(15, signal.SIG_IGN); print('up', flush=True); time.sleep(60)"
    meek, deaf, other = orphan("amcl"), orphan("patrolling_node", stubborn), orphan("x", master=MASTER + "8")
    found = orphans.find(MASTER)
    assert found == {meek.pid: "amcl", deaf.pid: "patrolling_node"}
    orphans.end(found)
    assert meek.wait(1.0) == deaf.wait(1.0) == -signal.SIGKILL
    assert other.poll() is None
    other.kill()
    other.wait()


def test_the_oldest_logs_go(tmp_path: Path) -> None:
    assert old_logs.prune(tmp_path / "none", 1) == []
    for number in range(4):
        run = tmp_path / f"run{number}"
        run.mkdir()
        (run / "node.log").write_bytes(b"x" * 1000)
        os.utime(run, (1000.0 + number, 1000.0 + number))
    (tmp_path / "latest").symlink_to(tmp_path / "run3")
    assert old_logs.prune(tmp_path, 2500) == ["run0", "run1"]
    assert sorted(each.name for each in tmp_path.iterdir()) == ["latest", "run2", "run3"]


def test_words_to_systemd(tmp_path: Path) -> None:
    Systemd({}).feed()  # nobody listens
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(5.0)
        systemd = Systemd({"NOTIFY_SOCKET": str(tmp_path / "notify")})
        systemd.say("on guard")
        systemd.say("on guard")
        systemd.feed()
        systemd.feed()
        said = [manager.recv(100).decode() for _ in range(3)]
    assert said == ["STATUS=on guard", "READY=1\nWATCHDOG=1", "WATCHDOG=1"]
    systemd.feed()  # it has gone


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("role: dog\n", "expected alone, robot, pc, got 'dog'"),
        ("role: robot\narguments: [gui]\n", "NAME:=VALUE"),
        ("role: robot\narguments: 3\n", "NAME:=VALUE"),
        ("- a\n", "'role' and 'arguments'"),
    ],
)
def test_settings_that_make_no_sense(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "service.conf"
    path.write_text(text)
    with pytest.raises(ParamError, match=r"service\.conf") as caught:
        serve.read_settings(path)
    assert expected in str(caught.value)


def test_settings_are_read_back(tmp_path: Path) -> None:
    path = tmp_path / "service.conf"
    path.write_text(Service(root=tmp_path, role="robot").settings(("simulation:=false", "email_to:=me@home")))
    assert serve.read_settings(path) == ("robot", ["simulation:=false", "email_to:=me@home"])
    path.write_text(Service(root=tmp_path, role="pc").settings(()))
    assert serve.read_settings(path) == ("pc", [])


def test_parameters_as_a_tree() -> None:
    assert serve.nested({"/a/b": 1, "/a/c/d": [2], "/e": "x"}) == {"a": {"b": 1, "c": {"d": [2]}}, "e": "x"}


def test_the_unit_is_valid(tmp_path: Path) -> None:
    """systemd-analyze finds nothing to complain of, but for the checkout, which is not here."""
    unit = tmp_path / "rosbot-patrol.service"
    unit.write_text(
        Service(root=Path("/usr"), role="robot", groups=()).unit().replace("/usr/scripts/serve", "/bin/true")
    )
    done = subprocess.run(["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, check=False)
    lines = [line for line in done.stderr.splitlines() if "rosbot-patrol" in line]
    assert not [line for line in lines if "docs/service.md" not in line], done.stderr
    done = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", "--threshold=40", str(unit)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    print(done.stdout.splitlines()[-1])
