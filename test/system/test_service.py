"""The guard as a service of systemd: from power to guard, killed, hanging, cut off; on a machine that boots for it."""

import json
import os
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from booted_machine import REFUSED, Machine

pytestmark = pytest.mark.long
ROOT = Path(__file__).resolve().parents[2]
STATE = "/var/lib/rosbot-patrol/rosbot_patrol"


@pytest.fixture
def machine(tmp_path):
    if os.geteuid() != 0 or shutil.which("systemctl") is None:
        pytest.skip("needs root and systemd")
    made = Machine(tmp_path)
    try:
        made.on()
    except AssertionError as err:
        made.off()
        if REFUSED in str(err):
            pytest.skip(str(err))
        raise
    yield made
    made.remove()


def wait_for(condition, what, seconds=60.0):
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, f"{what} did not come within {seconds} s"
        time.sleep(0.2)


def started(machine):
    return machine.run("systemctl", "show", "-p", "ActiveEnterTimestampMonotonic", "--value", "rosbot-patrol").strip()


def wait_for_guard(machine, before="0", seconds=120.0):
    """Seconds until the service is on guard, after another start than `before`."""
    began = time.monotonic()
    while (
        started(machine) in (before, "0")
        or machine.run("systemctl", "is-active", "rosbot-patrol", is_well=False).strip() != "active"
    ):
        assert time.monotonic() - began < seconds, machine.run("systemctl", "status", "rosbot-patrol", is_well=False)
        time.sleep(0.2)
    return time.monotonic() - began


def kill(machine, what, number="KILL"):
    before = started(machine)
    machine.run("pkill", f"-{number}", "-u", "rosbot-patrol", "-f", what)
    return wait_for_guard(machine, before)


def ros(machine, *words, **options):
    return machine.run(
        "bash", "-c", f'cd {ROOT} && . scripts/env && export ROS_HOME=/tmp && "$@"', "-", *words, **options
    )


def is_in(machine, state):
    return f'state: "{state}"' in ros(machine, "rostopic", "echo", "-n1", "/patrol/state")


def call(machine):
    """A motion sensor's call while the robot is at rest; it drives."""
    wait_for(lambda: is_in(machine, "idle"), "the rest")
    time.sleep(3.0)  # before, the robot's own way explains the call
    ros(machine, "rostopic", "pub", "-1", "/motion_trigger", "rosbot_patrol/EspTrigger", "{id: 1, move: true}")
    wait_for(lambda: is_in(machine, "driving"), "the drive")


def wait_for_verdicts(machine, *wanted, seconds=150.0):
    """Wait for the verdicts of all missions so far."""
    found, until = [], time.monotonic() + seconds
    while found != list(wanted):
        assert time.monotonic() < until, f"{found}, expected {wanted}"
        time.sleep(1.0)
        said = ros(
            machine, "rosrun", "rosbot_patrol", "incidents", "--state-dir", STATE, "list", "--json", is_well=False
        )
        found = [json.loads(line)["verdict"] for line in said.splitlines() if line.startswith("{")]


def start_roscore(machine):
    ros(machine, "bash", "-c", "setsid roscore >/dev/null 2>&1 </dev/null &")
    wait_for(lambda: "/rosout" in ros(machine, "rosnode", "list", is_well=False), "the ROS master")


def mails(machine):
    text = machine.run("bash", "-c", f"cat {STATE}/mail/new/* 2>/dev/null || true")
    return " ".join(text.replace("=\n", "").split())


def test_from_power_to_a_patrol_and_whatever_happens(machine):
    said = machine.run(f"{ROOT}/scripts/install-service", "alone", "house:=flat", "console:=false")
    assert "The guard starts now" in said
    took = {"install": wait_for_guard(machine, seconds=300.0)}
    wait_for(lambda: is_in(machine, "idle"), "on guard")
    assert "on guard" in machine.run("systemctl", "status", "rosbot-patrol")
    exposure = machine.run("systemd-analyze", "security", "rosbot-patrol").splitlines()[-1]
    call(machine)
    took["master killed"] = kill(machine, "rosmaster --core")
    wait_for_verdicts(machine, "clear")
    call(machine)
    took["roslaunch killed"] = kill(machine, "bin/roslaunch")
    wait_for_verdicts(machine, "clear", "clear")
    took["patrol stopped"] = kill(machine, "rosbot_patrol/patrol_robot", "STOP")

    # parameters of a stranger are not taken
    ros(machine, "rosparam", "set", "/patrolling_node/state_dir", "/tmp/evil")
    machine.run("pkill", "-KILL", "-f", "rosbot_patrol/patrol_robot")
    time.sleep(12.0)  # roslaunch's pause before it starts the node again
    wait_for(lambda: is_in(machine, "idle"), "the patrol")
    machine.run("test", "!", "-e", "/tmp/evil")

    # a ROS master of its own, which is killed and replaced
    machine.run("systemctl", "stop", "rosbot-patrol")
    start_roscore(machine)
    machine.run("systemctl", "start", "rosbot-patrol", seconds=120.0)
    wait_for_guard(machine)
    before = started(machine)
    machine.run("pkill", "-KILL", "-f", "rosmaster --core")
    start_roscore(machine)
    took["roscore replaced"] = wait_for_guard(machine, before)
    machine.run("systemctl", "stop", "rosbot-patrol")
    machine.run("pkill", "-f", "roscore")
    machine.run("systemctl", "start", "rosbot-patrol", seconds=120.0)
    wait_for_guard(machine)

    # a program that floods the log
    flood = 'yes "a line of a program that does not stop" | head -c 200000000'
    machine.run("systemd-run", "--wait", "-p", "LogNamespace=rosbot-patrol", "bash", "-c", flood, seconds=120.0)

    # a call, and the power goes
    call(machine)
    machine.off()
    alive = machine.folder / "up" / STATE.lstrip("/") / "alive"
    past = time.time() - 600.0
    os.utime(alive, (past, past))
    Path("/proc/sys/vm/drop_caches").write_text("3")  # a machine that was off has nothing in memory
    began = time.monotonic()
    machine.on()
    wait_for_guard(machine)
    took["power"] = time.monotonic() - began
    wait_for(lambda: "The guard was down from" in mails(machine), "a mail")
    wait_for_verdicts(machine, "clear", "clear", "clear")
    size = machine.run("bash", "-c", "du -scm /var/log/rosbot-patrol /var/log/journal | tail -1").split()[0]
    print(exposure, f"logs {size} MB", {name: round(seconds, 1) for name, seconds in took.items()})
    assert int(size) < 50

    said = machine.run(f"{ROOT}/scripts/install-service", "--remove")
    assert "The service is gone" in said
    assert machine.run("pgrep", "-u", "rosbot-patrol", "-c", is_well=False).strip() == "0"


def test_what_it_refuses(machine):
    for words, sentence in (
        (("alone", "house"), "is no argument of the form NAME:=VALUE"),
        ((), "name one of alone, robot, pc"),
    ):
        assert sentence in machine.run("bash", "-c", f'{ROOT}/scripts/install-service "$@" 2>&1 || true', "-", *words)
    as_other = ["runuser", "-u", "nobody", "--", f"{ROOT}/scripts/install-service", "alone"]
    assert "needs root" in machine.run("bash", "-c", '"$@" 2>&1 || true', "-", *as_other)


def test_without_systemd_it_says_so():
    if os.geteuid() != 0 or Path("/run/systemd/system").is_dir():
        pytest.skip("needs root on a machine without systemd")
    done = subprocess.run([f"{ROOT}/scripts/install-service", "alone"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "does not run here" in done.stderr
