"""Poses in the plane from relations between them, some of which may be wrong.

The relations from one pose to the next are believed. Those of loops get weights by graduated non-convexity (Yang,
Antonante, Tzoumas, Carlone: Graduated non-convexity for robust spatial perception, 2020) with the Geman-McClure cost:
one that contradicts the others ends with a weight near 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from rosbot_patrol.geometry import wrap_angles

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

INLIER = 11.3  # squared Mahalanobis length that 99 of 100 right relations in the plane stay below
COOLING = 2.0  # by which the cost becomes less convex from step to step
LAST_STEPS = 5  # with the final cost, at most
DONE = 1e-4  # largest change of a step at which the poses are done [m, rad]


class Relations(NamedTuple):
    """Measured relations between poses.

    Attributes:
        first: index of the pose from which each is seen, shape (R,).
        second: index of the pose that is seen, shape (R,).
        moves: the second in the frame of the first [m, rad], shape (R, 3).
        information: of the moves, in the frame of the first, shape (R, 3, 3).
    """

    first: Indices
    second: Indices
    moves: Array
    information: Array

    @classmethod
    def none(cls) -> Relations:
        """No relations."""
        nothing = np.empty(0, dtype=np.int64)
        return cls(nothing, nothing, np.empty((0, 3)), np.empty((0, 3, 3)))

    def joined(self, other: Relations) -> Relations:
        """These and others."""
        return Relations(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))


@dataclass(frozen=True)
class Solution:
    """The best poses.

    Attributes:
        poses: shape (N, 3).
        weights: of the loops, 1: believed, 0: not at all, shape (L,).
    """

    poses: Array
    weights: Array


def relative_moves(poses: Array, first: Indices, second: Indices) -> Array:
    """Poses in the frames of others, shape (R, 3)."""
    c, s = np.cos(poses[first, 2]), np.sin(poses[first, 2])
    dx, dy = (poses[second] - poses[first])[:, :2].T
    turns = wrap_angles(poses[second, 2] - poses[first, 2])
    return np.column_stack((c * dx + s * dy, c * dy - s * dx, turns))


def errors_of(poses: Array, relations: Relations) -> Array:
    """How far the poses lie from relations, in the frame of the first, shape (R, 3)."""
    errors = relative_moves(poses, relations.first, relations.second) - relations.moves
    errors[:, 2] = wrap_angles(errors[:, 2])
    return errors


def squared_lengths(errors: Array, information: Array) -> Array:
    """Squared Mahalanobis lengths, shape (R,)."""
    return np.asarray(np.einsum("ri,rij,rj->r", errors, information, errors))


def solve(poses: Array, chain: Relations, loops: Relations) -> Solution:
    """Find the poses that fit the relations best; the first one stays.

    Args:
        poses: to begin with, shape (N, 3), at least two.
        chain: believed relations, which connect all poses.
        loops: relations that may be wrong.
    """
    poses = poses.copy()
    all_of_them = chain.joined(loops)
    count = len(chain.first)
    weights = np.ones(len(all_of_them.first))
    lengths = squared_lengths(errors_of(poses, loops), loops.information)
    mu = max(2.0 * float(lengths.max(initial=0.0)) / INLIER, 1.0)
    left = LAST_STEPS
    while left > 0:
        weights[count:] = (mu * INLIER / (lengths + mu * INLIER)) ** 2
        change = _step(poses, all_of_them, weights)
        lengths = squared_lengths(errors_of(poses, loops), loops.information)
        if mu > 1.0:
            mu = max(mu / COOLING, 1.0)
        elif change < DONE:
            break
        else:
            left -= 1
    return Solution(poses, (INLIER / (lengths + INLIER)) ** 2)


def _step(poses: Array, relations: Relations, weights: Array) -> float:
    """Make one step of Gauss-Newton in place; returns the largest change."""
    errors = errors_of(poses, relations)
    of_first, of_second = _derivatives(poses, relations)
    weighted = relations.information * weights[:, None, None]
    sides = ((relations.first, of_first), (relations.second, of_second))
    slope = np.zeros(poses.shape)
    values, rows, columns = [], [], []
    for index, derivative in sides:
        pushed = np.einsum("rki,rkl->ril", derivative, weighted)
        np.add.at(slope, index, np.einsum("ril,rl->ri", pushed, errors))
        for other, other_derivative in sides:
            blocks = pushed @ other_derivative
            values.append(blocks.ravel())
            rows.append(np.broadcast_to(3 * index[:, None, None] + np.arange(3)[:, None], blocks.shape).ravel())
            columns.append(np.broadcast_to(3 * other[:, None, None] + np.arange(3), blocks.shape).ravel())
    size = 3 * len(poses)
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    matrix = sparse.coo_matrix(entries, shape=(size, size)).tocsc()[3:, 3:]
    step = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(-slope.ravel()[3:])
    poses[1:] += step.reshape(-1, 3)
    return float(np.abs(step).max(initial=0.0))


def _derivatives(poses: Array, relations: Relations) -> tuple[Array, Array]:
    """Derivatives of the errors by the first and by the second pose, shape (R, 3, 3) each."""
    yaws = poses[relations.first, 2]
    c, s = np.cos(yaws), np.sin(yaws)
    dx, dy = (poses[relations.second] - poses[relations.first])[:, :2].T
    by_second = np.zeros((len(c), 3, 3))
    by_second[:, 0, 0] = by_second[:, 1, 1] = c
    by_second[:, 0, 1], by_second[:, 1, 0], by_second[:, 2, 2] = s, -s, 1.0
    by_first = -by_second
    by_first[:, 0, 2], by_first[:, 1, 2] = c * dy - s * dx, -c * dx - s * dy
    return by_first, by_second
