"""The network whose boxes arrive: its calibration and its threshold."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.errors import DetectorError
from rosbot_patrol.patrol.belief.calibration import CAUTIOUS, Calibration, read_calibration

DETECTOR_THRESHOLD = 0.4
"""Threshold of the networks' shipped settings."""
WITHOUT = "one side alone confirms nobody; make a calibration with scripts/calibrate_network"


@dataclass(frozen=True)
class Network:
    """What the belief has to know of the network.

    Attributes:
        calibration: what its scores are worth.
        threshold: of the detector; lower boxes never arrive.
    """

    calibration: Calibration = CAUTIOUS
    threshold: float = DETECTOR_THRESHOLD


def find_calibration(folders: Iterable[Path], name: str, sha256: str = "") -> Calibration:
    """Find a network's calibration in folders of `*.json` files; the first that fits.

    Args:
        folders: those that are missing hold none.
        name: of the network.
        sha256: of its cfg and weights; "": any of that name.

    Raises:
        DetectorError: there is none; a sentence, which names the files that cannot be read.
    """
    others = []
    files = [path for folder in folders for path in sorted(folder.glob("*.json"))]
    for path in files:
        try:
            found = read_calibration(path)
        except DetectorError as err:
            others.append(f"; {err}")
            continue
        if found.sha256 == sha256 if sha256 else found.network == name:
            return found
        if found.network == name:
            others.append(f"; {path} is of other weights")
    raise DetectorError(f"there is no calibration of the network '{name}'{''.join(others)}")
