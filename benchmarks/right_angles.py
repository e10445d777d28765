"""Headings of a way against the walls of a building whose walls stand at right angles.

A reference that an earlier SLAM run made has errors of its own. Where a building is rectangular its walls tell which of
two ways has the truer headings: in each scan the straight pieces of wall give their common direction (modulo 90
degrees), which with the true headings is the same throughout.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.scan import LaserScan

Array = NDArray[np.float64]

CHORD = 12  # a piece of wall: so many beams from end to end
LONG, FAR = (0.25, 2.0), 12.0  # its length, and how far beams are looked at [m]
STRAIGHT = 0.015  # its middle is so near to the line between its ends [m]
PIECES, AGREED = 25, 0.7  # a scan tells with so many, where such a share by length has one direction
SAME = math.radians(4.0)  # which is so exact
OTHER = 5.0  # walls that are farther from the right angles are others [deg]


def wall_direction(scan: LaserScan) -> float:
    """Of the walls in the laser's frame, modulo 90 degrees [rad]; NaN where they do not tell."""
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
    """Mean error of each way's headings against the walls [deg], over the scans that tell in all of them.

    Args:
        scans: whose laser looks ahead.
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
