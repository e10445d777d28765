"""Headings of a trajectory compared with a building's right-angled walls.

A reference from an earlier SLAM run has errors of its own. In a rectangular building the walls show which of two
trajectories has the truer headings. In each scan the straight pieces of wall give their common direction (modulo 90
degrees); with the true headings it is the same throughout.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.scan import LaserScan

Array = NDArray[np.float64]

CHORD = 12  # beams from end to end of a piece of wall
LONG, FAR = (0.25, 2.0), 12.0  # length of a piece, and range of the beams used [m]
STRAIGHT = 0.015  # largest distance of its middle from the line between its ends [m]
PIECES, AGREED = 25, 0.7  # smallest number of pieces in a usable scan, and smallest share by length with one direction
SAME = math.radians(4.0)  # pieces within this angle have one direction
OTHER = 5.0  # walls farther from the right angles are not used [deg]


def wall_direction(scan: LaserScan) -> float:
    """Direction of the walls in the laser's frame, modulo 90 degrees [rad]; NaN if they do not agree."""
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    seen = np.isfinite(scan.ranges) & (scan.ranges < FAR)
    ranges = np.where(seen, scan.ranges, 0.0)
    ends = np.column_stack((ranges * np.cos(angles), ranges * np.sin(angles)))
    chord = ends[CHORD:] - ends[:-CHORD]
    length = np.hypot(*chord.T)
    aside = np.column_stack((-chord[:, 1], chord[:, 0])) / np.maximum(length, 1e-9)[:, None]
    middle = np.abs(((ends[CHORD // 2 : -CHORD // 2] - ends[:-CHORD]) * aside).sum(axis=1))
    pieces = seen[CHORD:] & seen[:-CHORD] & (length > LONG[0]) & (length < LONG[1]) & (middle < STRAIGHT)
    if pieces.sum() < PIECES:
        return math.nan
    directions, weights = np.arctan2(chord[pieces, 1], chord[pieces, 0]), length[pieces]
    common, agreed = np.angle((weights * np.exp(4j * directions)).sum()) / 4.0, weights
    for _ in range(3):
        gaps = np.angle(np.exp(4j * (directions - common))) / 4.0
        agreed = np.where(np.abs(gaps) < SAME, weights, 0.0)
        common = np.angle((agreed * np.exp(4j * directions)).sum()) / 4.0
    return float(common) if agreed.sum() > AGREED * weights.sum() else math.nan


def heading_errors(scans: Sequence[LaserScan], ways: Sequence[Array]) -> list[float]:
    """Mean error of each trajectory's headings against the walls [deg], over the scans that are usable in all of them.

    Args:
        scans: scans of a laser that looks forward.
        ways: x, y, yaw at each scan, each of shape (N, 3).
    """
    walls = np.array([wall_direction(scan) for scan in scans])
    off = []
    for way in ways:
        told = np.exp(4j * (walls + way[:, 2]))
        off.append(np.degrees(np.angle(told * np.exp(-1j * np.angle(np.nansum(told)))) / 4.0))
    with np.errstate(invalid="ignore"):
        tell = np.all([np.abs(errors) < OTHER for errors in off], axis=0)
    return [float(np.abs(errors[tell] - np.median(errors[tell])).mean()) for errors in off]
