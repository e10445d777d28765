"""serve: what the service runs. Ends what an earlier run has left, bounds the logs, and stays with the launch file.

Parameters that the owner sets (channels, state folder, arming and the like) are written into a file before the master
starts. The nodes read them there, so that nobody changes them on the parameter server.

It also watches the ROS master; on the PC this is the robot's master. If the master ends, all nodes must start again,
because they do not sign on at a new one.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import subprocess
import sys
import time
import xmlrpc.client
from pathlib import Path
from typing import Any

import yaml

from rosbot_patrol.errors import HostError, ParamError, PatrolError
from rosbot_patrol.files import kernel_library, write_json
from rosbot_patrol.host import old_logs, orphans
from rosbot_patrol.host.service_units import LOGS, ROLES, SETTINGS
from rosbot_patrol.host.watchdog import Systemd
from rosbot_patrol.yaml_files import read_mapping

log = logging.getLogger(__name__)

KEPT_LOGS = 8_000_000  # of earlier runs [bytes]
LOOK = 1.0  # [s]
GONE, AWAY = 3.0, 8.0  # time without an answer after which the master counts as gone: here, or over a network [s]
_KEEP = "keep_calls_at_end:=true"  # the last one counts, so that the owner can still say otherwise
PARAMS = "ROSBOT_PATROL_PARAMS"  # names the file of parameters that nodes read instead of the server


def read_settings(path: Path = SETTINGS) -> tuple[str, list[str]]:
    """Role and arguments of the settings file; raises ParamError."""
    tree = read_mapping(path, keys="'role' and 'arguments'")
    role, arguments = tree.get("role"), tree.get("arguments") or []
    if role not in ROLES:
        raise ParamError(f"{path}: role", f"expected {', '.join(ROLES)}, got {role!r}")
    if not isinstance(arguments, list) or not all(isinstance(each, str) and ":=" in each for each in arguments):
        raise ParamError(f"{path}: arguments", "expected one NAME:=VALUE a line, each behind a dash")
    return role, arguments


def nested(flat: dict[str, Any]) -> dict[str, Any]:
    """Parameters by full name as a tree."""
    tree: dict[str, Any] = {}
    for name, value in flat.items():
        *folders, last = name.strip("/").split("/")
        place = tree
        for folder in folders:
            place = place.setdefault(folder, {})
        place[last] = value
    return tree


def main() -> None:
    """Run until the launch file ends, or systemd ends this; exit status 1 if it ended by itself."""
    logging.basicConfig(level=logging.INFO, format="%(levelname)s: %(message)s", stream=sys.stdout)
    try:
        sys.exit(_serve())
    except PatrolError as err:
        sys.exit(f"serve: {err}")


def _serve() -> int:
    role, arguments = read_settings()
    master = os.environ["ROS_MASTER_URI"]
    left = orphans.find(master)
    if left:
        log.warning("nodes of an earlier run still live, and are ended: %s", ", ".join(sorted(set(left.values()))))
        orphans.end(left)
    removed = old_logs.prune(Path(os.environ.get("ROS_LOG_DIR", LOGS)), KEPT_LOGS)
    if removed:
        log.info("logs of %d earlier runs were removed", len(removed))
    _compile()
    launch = ["rosbot_patrol", ROLES[role], *([] if role == "pc" else [_KEEP]), *arguments]
    _keep_params(launch)
    options = ["--screen", "--skip-log-check", *(["--wait"] if role == "pc" else [])]
    child = subprocess.Popen(["roslaunch", *options, *launch], stdin=subprocess.DEVNULL)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: child.send_signal(signal.SIGINT))
    try:
        _stay_with(child, master, feeds=role == "pc", patience=AWAY if role == "pc" else GONE)
    finally:  # at once: systemd would wait for nodes that cannot sign off at a dead master
        orphans.end(orphans.find(master))
    return child.wait()


def _compile() -> None:
    """Compile what the nodes would else compile at their start, once for this user and state of the sources."""
    if kernel_library().exists():
        return
    log.info("kernels and network are compiled for this user, once: a minute or two")
    Systemd().say("compiles, once")
    for module in ("kernels", "detection.ssdlite"):  # a missing network is said, and the next best is used
        subprocess.run([sys.executable, "-m", f"rosbot_patrol.{module}"], check=False)


def _keep_params(launch: list[str]) -> None:
    """Write the parameters that the launch file would set, for the nodes to read."""
    folder = os.environ.get("RUNTIME_DIRECTORY", "")
    if not folder:
        return  # no service: by hand the parameter server counts
    done = subprocess.run(["roslaunch", "--dump-params", *launch], capture_output=True, text=True, check=False)
    if done.returncode:
        raise HostError(f"roslaunch {' '.join(launch)}", (done.stderr.strip().splitlines() or ["failed"])[-1])
    path = Path(folder, "params.json")
    write_json(path, nested(yaml.safe_load(done.stdout) or {}))
    os.environ[PARAMS] = str(path)


def _stay_with(child: subprocess.Popen[bytes], master: str, *, feeds: bool, patience: float) -> None:
    """Return when roslaunch ends; end it when the master has gone, or is another one.

    Args:
        child: roslaunch.
        master: address of the ROS master.
        feeds: feed systemd's watchdog from here, as no node does.
        patience: time without an answer of the master [s].
    """
    systemd, first, heard = Systemd(), "", time.monotonic()
    while child.poll() is None:
        run = _run_id(master)
        now = time.monotonic()
        heard = now if run else heard
        if run:
            first = first or run
        if first and (run not in ("", first) or now - heard > patience):
            log.warning("the ROS master has gone, or was started anew: all nodes start again")
            child.kill()
            return
        if feeds:
            systemd.feed()
            systemd.say("with the robot" if first else "waits for the robot's master")
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(LOOK)


def _run_id(master: str) -> str:
    """The master's mark of this run, "" if it does not answer."""
    try:
        answer: Any = xmlrpc.client.ServerProxy(master).getParam("/serve", "/run_id")
        return str(answer[2]) if answer[0] == 1 else ""
    except (OSError, xmlrpc.client.Error):
        return ""


if __name__ == "__main__":
    main()
