"""What a bug report holds: versions, parameters, nodes and topics, problems, the nodes' logs, the house's files."""

from __future__ import annotations

import json
import logging
import platform
import sys
import xmlrpc.client
from collections.abc import Callable, Mapping
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any

import rosgraph
import rospkg
import rospy
import yaml

from rosbot_patrol.console.access.accounts import Accounts
from rosbot_patrol.console.house.files import HouseFiles
from rosbot_patrol.console.live.bug_report import read_secrets, report_zip
from rosbot_patrol.console.live.day_log import DayLog
from rosbot_patrol.console.live.hub import Hub
from rosbot_patrol.package_files import package_file

log = logging.getLogger(__name__)

_PACKAGES = ("nicegui", "numpy", "numba", "opencv", "paho-mqtt", "apprise")
_LOG_END = 200_000  # [bytes] of each node's log


class Reporter:
    """Gathers a report. Blocks for a second or two.

    Args:
        hub: what the pages know.
        house: files of the house.
        accounts: of the people; their names are left out.
        day_log: of the last day.
    """

    def __init__(self, hub: Hub, house: HouseFiles, accounts: Accounts, day_log: DayLog) -> None:
        self._hub, self._house, self._accounts, self._day_log = hub, house, accounts, day_log

    def __call__(self) -> bytes:
        """The zip file."""
        parts: Mapping[str, Callable[[], str]] = {
            "versions.txt": _versions,
            "parameters.yaml": _parameters,
            "graph.txt": _graph,
            "state.json": lambda: json.dumps(asdict(self._hub.state), indent=1, default=str),
            "day.jsonl": lambda: "\n".join(json.dumps(asdict(entry)) for entry in self._day_log.newest_first),
        }
        texts = {name: _tried(part) for name, part in parts.items()}
        texts |= {f"house/{path.name}": _tried(path.read_text) for path in self._house.existing}
        texts |= _logs()
        names = [account.name for account in self._accounts.people]
        return report_zip(texts, [*read_secrets(self._house.secrets), *names])


def _tried(part: Callable[[], str]) -> str:
    """A part, or why it is missing."""
    try:
        return part()
    except (OSError, ValueError, rosgraph.MasterException, xmlrpc.client.Error, yaml.YAMLError) as err:
        log.warning("a part of the report is missing: %s", err)
        return f"missing: {err}"


def _versions() -> str:
    version = rospkg.RosPack().get_manifest("rosbot_patrol").version
    lines = [f"rosbot_patrol {version}", f"Python {sys.version}", platform.platform()]
    release = Path("/etc/os-release")
    lines += release.read_text().splitlines()[:1] if release.exists() else []
    for name in _PACKAGES:
        try:
            lines.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            lines.append(f"{name}: not installed")
    git = package_file("package.xml").parent / ".git" / "HEAD"
    lines += [f"git {git.read_text().strip()}"] if git.is_file() else []
    return "\n".join(lines) + "\n"


def _parameters() -> str:
    # not by rospy: its cache knows only those that it was asked for
    return str(yaml.safe_dump(rosgraph.Master(rospy.get_name()).getParam("/"), allow_unicode=True))


def _graph() -> str:
    publishers, subscribers, services = rosgraph.Master(rospy.get_name()).getSystemState()
    parts: list[tuple[str, Any]] = [("published", publishers), ("subscribed", subscribers), ("services", services)]
    return "\n".join(f"{what} {name}: {', '.join(nodes)}" for what, listed in parts for name, nodes in sorted(listed))


def _logs() -> dict[str, str]:
    folder = Path(rospkg.get_log_dir()) / "latest"
    found = {}
    for path in sorted(folder.glob("*.log")) if folder.is_dir() else []:
        with path.open("rb") as file:
            file.seek(max(path.stat().st_size - _LOG_END, 0))
            found[f"logs/{path.name}"] = file.read().decode("utf-8", "replace")
    return found
