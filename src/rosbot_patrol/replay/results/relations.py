"""Quality of a trajectory, measured by the relations between its poses.

Kuemmerle, Steder, Dornhege, Ruhnke, Grisetti, Stachniss, Kleiner: On measuring the accuracy of SLAM algorithms (2009).
The motions between pairs of poses are compared, not the poses themselves: so a small early rotation does not affect all
later errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.counts import count_of
from rosbot_patrol.geometry import wrap_angles

Array = NDArray[np.float64]
Pairs = NDArray[np.int64]


@dataclass(frozen=True)
class RelationErrors:
    """Mean and standard deviation of the relations' errors, in length [m] and rotation [rad], and their number."""

    shift: float
    shift_std: float
    turn: float
    turn_std: float
    count: int


def consecutive_pairs(count: int) -> Pairs:
    """Pairs of each pose and the next, shape (count - 1, 2)."""
    first = np.arange(max(count - 1, 0))
    return np.column_stack((first, first + 1))


def revisit_pairs(reference: Array, *, radius: float = 3.0, gap: int = 100) -> Pairs:
    """Pairs of poses within `radius` [m] of each other and more than `gap` scans apart, shape (M, 2)."""
    found = [np.empty((0, 2), dtype=np.int64)]
    for i in range(len(reference) - gap - 1):
        later = reference[i + gap + 1 :, :2]
        near = np.flatnonzero(((later - reference[i, :2]) ** 2).sum(axis=1) <= radius * radius)
        found.append(np.column_stack((np.full(len(near), i), i + gap + 1 + near)))
    return np.concatenate(found)


def moves_between(poses: Array, pairs: Pairs) -> Array:
    """The second pose of each pair, relative to the first, shape (M, 3)."""
    first, second = poses[pairs[:, 0]], poses[pairs[:, 1]]
    c, s = np.cos(first[:, 2]), np.sin(first[:, 2])
    dx, dy = (second - first)[:, :2].T
    return np.column_stack((c * dx + s * dy, c * dy - s * dx, second[:, 2] - first[:, 2]))


def relation_errors(estimate: Array, reference: Array, pairs: Pairs) -> RelationErrors:
    """Compare the motions of an estimate with those of a reference, both of shape (N, 3).

    Raises:
        ValueError: the numbers of poses differ, or there are no pairs.
    """
    if estimate.shape != reference.shape:
        raise ValueError(f"{count_of(len(estimate), 'pose')} against {len(reference)} of the reference")
    if not len(pairs):
        raise ValueError("there are no pairs to compare")
    ours, theirs = moves_between(estimate, pairs), moves_between(reference, pairs)
    shifts = np.hypot(*(ours - theirs)[:, :2].T)  # a rotation of the frame changes no length
    turns = np.abs(wrap_angles(ours[:, 2] - theirs[:, 2]))
    return RelationErrors(
        shift=float(shifts.mean()),
        shift_std=float(shifts.std()),
        turn=float(turns.mean()),
        turn_std=float(turns.std()),
        count=len(pairs),
    )
