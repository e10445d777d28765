"""Cholesky's factors of 3 x 3 matrices, and the solution of normal equations with them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

Array = NDArray[np.float64]


@kernel()
def factorise(a: Array, lower: Array) -> None:
    """Cholesky: a = lower @ lower.T, shapes (3, 3); `a` is positive definite."""
    lower[:] = 0.0
    for i in range(3):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = math.sqrt(max(total, 1e-12)) if i == j else total / lower[j, j]


@kernel()
def solve_upper(lower: Array, v: Array) -> None:
    """Solve lower.T @ x = v in place, v of shape (3,)."""
    for i in range(2, -1, -1):
        for k in range(i + 1, 3):
            v[i] -= lower[k, i] * v[k]
        v[i] /= lower[i, i]


@kernel()
def solve(lower: Array, v: Array) -> None:
    """Solve lower @ lower.T @ x = v in place, v of shape (3,)."""
    for i in range(3):
        for k in range(i):
            v[i] -= lower[i, k] * v[k]
        v[i] /= lower[i, i]
    solve_upper(lower, v)
