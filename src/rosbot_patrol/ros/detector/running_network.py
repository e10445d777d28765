"""The network that the detector runs, by the parameter `running` of darknet_ros: announced, and read by the patrol."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import rospy

from rosbot_patrol.detection.choice import Choice
from rosbot_patrol.errors import DetectorError
from rosbot_patrol.package_files import package_file
from rosbot_patrol.patrol.belief.networks import DETECTOR_THRESHOLD, WITHOUT, Network, find_calibration
from rosbot_patrol.patrol.senses.health import OK, WARN, Health

log = logging.getLogger(__name__)

RUNNING = "darknet_ros/running"
"""Parameter of the detector, as the patrol in its namespace sees it."""
SHIPPED = "config/calibrations"


def announce(choice: Choice) -> None:
    """Set the parameter of this node, which is the detector."""
    running = {"network": choice.network, "sha256": choice.sha256, "threshold": choice.threshold}
    rospy.set_param("~running", running)


class RunningNetwork:
    """Gives the network that runs; asked at the begin of each mission.

    Args:
        name: of the network, "" to ask the detector.
        folder: of calibrations that come before the shipped ones, "" for none.
        health: tells which calibration counts.
    """

    def __init__(self, name: str, folder: str, health: Health) -> None:
        self._name, self._health = name, health
        own = [Path(folder).expanduser()] if folder else []
        self._folders = [*own, package_file(SHIPPED)]
        self._said = ""

    def __call__(self) -> Network:
        """The network, with the cautious calibration if it has none."""
        name, sha256, threshold = self._name, "", DETECTOR_THRESHOLD
        if not name:
            told = rospy.get_param(RUNNING, None)
            if not isinstance(told, dict):
                return self._cautious(f"the detector has not said which network it runs ({RUNNING})", threshold)
            name, sha256, threshold = _read(told)
        try:
            if not self._name and not sha256:
                raise DetectorError(f"the network '{name}' has no files whose calibration could be known")
            found = find_calibration(self._folders, name, sha256)
        except DetectorError as err:
            return self._cautious(str(err), threshold)
        self._say(OK, f"calibration of the network {found.network}")
        return Network(found, threshold)

    def _cautious(self, why: str, threshold: float) -> Network:
        self._say(WARN, f"{why}: the cautious calibration is used, {WITHOUT}")
        return Network(threshold=threshold)

    def _say(self, level: int, text: str) -> None:
        self._health.set("calibration", level, text)
        if text != self._said:
            self._said = text
            (log.info if level == OK else log.warning)("%s", text)


def _read(told: dict[str, Any]) -> tuple[str, str, float]:
    """Name, sum and threshold of a network; what makes no sense counts as unknown."""
    try:
        threshold = min(max(float(told.get("threshold", DETECTOR_THRESHOLD)), 0.0), 1.0)
    except (TypeError, ValueError):
        threshold = DETECTOR_THRESHOLD
    return str(told.get("network", "unknown")), str(told.get("sha256", "")), threshold
