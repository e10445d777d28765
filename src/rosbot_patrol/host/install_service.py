"""install-service: makes the guard a service of systemd, which starts with the machine and is always there.

    scripts/install-service robot [ARGUMENT:=VALUE ...]   the guard on the robot (simulation:=false)
    scripts/install-service pc    [ARGUMENT:=VALUE ...]   detector and bridges on the PC
    scripts/install-service alone [ARGUMENT:=VALUE ...]   everything on this machine, as scripts/patrol does
    scripts/install-service --remove                      takes the service away; the guard's records stay

A second call changes what differs, and starts the service again.
"""

from __future__ import annotations

import argparse
import grp
import os
import pwd
import subprocess
import sys
from pathlib import Path

from rosbot_patrol.errors import HostError, PatrolError
from rosbot_patrol.host import commands
from rosbot_patrol.host.service_units import GROUPS, HOME, JOURNAL, LOGS, NAME, ROLES, SETTINGS, UNIT, USER, Service
from rosbot_patrol.host.service_units import journal as journal_text

ROOT = Path(__file__).resolve().parents[3]


def main() -> None:
    """Run the program; exit status 1 and a sentence if something is refused."""
    parser = argparse.ArgumentParser(
        prog="scripts/install-service", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("role", nargs="?", choices=sorted(ROLES))
    parser.add_argument("arguments", nargs="*", metavar="ARGUMENT:=VALUE", help="of the launch file")
    parser.add_argument("--remove", action="store_true", help="take the service away")
    given = parser.parse_args()
    if bool(given.role) == given.remove:
        parser.error("name one of alone, robot, pc; or --remove")
    try:
        if os.geteuid() != 0:
            raise HostError("scripts/install-service", "needs root (sudo)")
        if not commands.has_systemd():
            raise HostError(
                "systemd", "does not run here; start the guard by scripts/patrol, or by what starts programs here"
            )
        if given.remove:
            _remove()
        else:
            _install(given.role, tuple(given.arguments))
    except PatrolError as err:
        sys.exit(f"install-service: {err}")


def _install(role: str, arguments: tuple[str, ...]) -> None:
    wrong = [each for each in arguments if ":=" not in each]
    if wrong:
        raise HostError(wrong[0], "is no argument of the form NAME:=VALUE")
    if role == "robot" and not any(each.startswith("simulation:=") for each in arguments):
        arguments = ("simulation:=false", *arguments)
    if role != "pc":
        arguments = ("gui:=false", "teleop:=false", *arguments)
    groups = tuple(name for name in GROUPS if _has_group(name))
    _make_user()
    _check_readable()
    service = Service(root=ROOT, role=role, groups=groups)
    commands.write(SETTINGS, service.settings(arguments))
    commands.write(JOURNAL, journal_text())
    commands.write(UNIT, service.unit())
    commands.run("systemctl", "daemon-reload")
    commands.run("systemctl", "enable", f"{NAME}.service")
    commands.run("systemctl", "restart", "--no-block", f"{NAME}.service")
    print(f"The guard starts now and with each start of the machine, as user {USER}.")
    print(f"  what it starts: {SETTINGS}\n  its records:    {HOME}\n  is it well:     systemctl status {NAME}")
    print(f"  its log:        journalctl --namespace {NAME} -f")


def _make_user() -> None:
    try:
        pwd.getpwnam(USER)
    except KeyError:
        commands.run(
            "useradd", "--system", "--user-group", "--home-dir", str(HOME), "--shell", "/usr/sbin/nologin", USER
        )


def _has_group(name: str) -> bool:
    try:
        grp.getgrnam(name)
    except KeyError:
        return False
    return True


def _check_readable() -> None:
    """Refuse a checkout that the service's user cannot read, as in a home folder that is closed to others."""
    program = str(ROOT / "scripts" / "serve")
    done = subprocess.run(["runuser", "-u", USER, "--", "test", "-x", program], check=False, capture_output=True)
    if done.returncode:
        problem = f"user {USER} cannot read it: move the checkout, to /opt for example, and run scripts/bootstrap there"
        raise HostError(str(ROOT), problem)
    if not (ROOT / ".ws" / "devel" / "setup.bash").exists():
        raise HostError(str(ROOT), "is not built yet: run scripts/bootstrap")


def _remove() -> None:
    if UNIT.exists():
        commands.run("systemctl", "disable", "--now", f"{NAME}.service")
    for path in (UNIT, JOURNAL, SETTINGS):
        path.unlink(missing_ok=True)
    commands.run("systemctl", "daemon-reload")
    print(f"The service is gone. Records, logs and user stay: {HOME}, {LOGS}, {USER}.")


if __name__ == "__main__":
    main()
