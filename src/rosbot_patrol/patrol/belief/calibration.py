"""What a network's scores are worth: P(score | person) and P(score | nobody), fitted from pictures with boxes.

A picture says one of several things about a place: no box, or a box with a score in one of the bins. Their
probabilities depend on the size of the box, on whether the image border cuts it, and on the light. Pictures from one
side err alike: `rho_person` and `rho_nobody` are the correlations of what two of them say (see `hypothesis.Side`). A
network without a calibration uses `CAUTIOUS`.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import DetectorError
from rosbot_patrol.files import write_json

Array = NDArray[np.float64]

EDGES = (0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)
"""Edges of the score bins; a score below the first counts as no box."""
SIZES = (0.12, 0.25, 0.5)
"""Edges of the size classes: height of the box over the longer side of the picture."""
MIDDLES = tuple((a + b) / 2.0 for a, b in pairwise(EDGES))
SHAPE = (len(SIZES) + 1, 2, 2, len(EDGES))  # size, is cut, is dark, outcome (0: no box)
_FORMAT = 1


@dataclass(frozen=True)
class Condition:
    """Under which a place is seen.

    Attributes:
        size: height of the object over the longer side of the picture.
        is_cut: the left or right image border cuts it.
        is_dark: the picture is dark.
    """

    size: float
    is_cut: bool = False
    is_dark: bool = False

    @property
    def cell(self) -> tuple[int, int, int]:
        """Index into the tables."""
        return int(np.searchsorted(SIZES, self.size, side="right")), int(self.is_cut), int(self.is_dark)


@dataclass(frozen=True)
class Calibration:
    """Probabilities of what a network says about a place.

    Attributes:
        network: name.
        sha256: of cfg and weights, "" for the cautious one.
        rho_person, rho_nobody: correlation of two pictures from one side, between 0 and 1.
        person, nobody: probability of each outcome, shape SHAPE; the last axis sums to 1.
        fooled: probability that a pet fools it, from each side anew.
    """

    network: str
    sha256: str
    rho_person: float
    rho_nobody: float
    person: Array
    nobody: Array
    fooled: float = 0.5

    def chances(self, at: Condition, threshold: float, *, is_person: bool) -> Array:
        """Probability of each outcome of a detector with a threshold; lower boxes count as none, shape (N,)."""
        shares = (self.person if is_person else self.nobody)[at.cell].copy()
        below = np.clip((threshold - np.array(EDGES[:-1])) / np.diff(EDGES), 0.0, 1.0)
        shares[0] += (shares[1:] * below).sum()
        shares[1:] *= 1.0 - below
        return np.asarray(shares)


def outcome(score: float) -> int:
    """Index of what a picture said: 0 for no box, else the bin of the score."""
    return int(np.clip(np.searchsorted(EDGES, score, side="right"), 0, len(EDGES) - 1))


def save_calibration(path: Path, calibration: Calibration) -> None:
    """Write a calibration as JSON."""
    tree = {
        "format": _FORMAT,
        "network": calibration.network,
        "sha256": calibration.sha256,
        "rho_person": round(calibration.rho_person, 4),
        "rho_nobody": round(calibration.rho_nobody, 4),
        "fooled_by_pets": round(calibration.fooled, 4),
        "edges": list(EDGES),
        "sizes": list(SIZES),
        "person": _rounded(calibration.person),
        "nobody": _rounded(calibration.nobody),
    }
    write_json(path, tree)


def _rounded(table: Array) -> Any:
    return np.maximum(np.round(table, 9), 1e-9).tolist()


def read_calibration(path: Path) -> Calibration:
    """Read a calibration, of whichever network.

    Raises:
        DetectorError: the file cannot be read or is no calibration; a sentence.
    """
    try:
        return _from_plain(json.loads(path.read_text(encoding="utf-8")))
    except OSError as err:
        raise DetectorError(f"the calibration {path} cannot be read: {err.strerror}") from err
    except (ValueError, KeyError, TypeError) as err:
        raise DetectorError(f"{path} is no calibration of a network ({err})") from err


def _from_plain(tree: Any) -> Calibration:
    if not isinstance(tree, dict) or tree.get("format") != _FORMAT:
        raise ValueError("it has another format")
    if tree["edges"] != list(EDGES) or tree["sizes"] != list(SIZES):
        raise ValueError("it has other bins")
    rhos, tables = [float(tree[name]) for name in ("rho_person", "rho_nobody")], []
    for name in ("person", "nobody"):
        table = np.array(tree[name], np.float64)
        if table.shape != SHAPE or not (table > 0.0).all() or not np.allclose(table.sum(axis=-1), 1.0, atol=1e-3):
            raise ValueError(f"'{name}' holds no probabilities")
        tables.append(table)
    if not all(0.0 < rho < 1.0 for rho in rhos):
        raise ValueError("a correlation is not between 0 and 1")
    fooled = float(tree.get("fooled_by_pets", CAUTIOUS.fooled))
    if not 0.0 < fooled < 1.0:
        raise ValueError("'fooled_by_pets' is no probability")
    return Calibration(str(tree["network"]), str(tree["sha256"]), rhos[0], rhos[1], tables[0], tables[1], fooled)


def _cautious() -> Calibration:
    """A weak network: it misses many, errs often, and its pictures from one side agree in their errors."""

    def table(silence: Sequence[float], shares: Sequence[float]) -> Array:
        boxes = np.array(shares) / sum(shares)
        rows = np.array([[s, *((1.0 - s) * boxes)] for s in silence])
        return np.broadcast_to(rows[:, None, None, :], SHAPE).copy()

    person = table((0.7, 0.4, 0.25, 0.35), (1, 1, 2, 2, 3, 4, 4))
    nobody = table((0.99, 0.98, 0.97, 0.95), (40, 25, 15, 10, 6, 3, 1))
    return Calibration("any", "", 0.8, 0.8, person, nobody)


CAUTIOUS = _cautious()
"""For a network that nobody calibrated: one side alone confirms nobody."""
