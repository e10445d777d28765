"""Poses from relations, right ones and wrong ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.gmapping.back_end.pose_graph import Relations, relative_moves, solve

SIDE = 25
NOISE = np.array([0.02, 0.02, 0.01])


def square() -> np.ndarray:
    """Two rounds on a square, with a pose on each metre, shape (N, 3)."""
    rows = []
    x, y = 0.0, 0.0
    for side in range(8):
        yaw = side * math.pi / 2.0
        for _ in range(SIDE):
            rows.append((x, y, yaw))
            x, y = x + math.cos(yaw), y + math.sin(yaw)
    return np.array(rows)


def related(poses: np.ndarray, first: np.ndarray, second: np.ndarray, rng: np.random.Generator) -> Relations:
    moves = relative_moves(poses, first, second) + NOISE * rng.standard_normal((len(first), 3))
    return Relations(first, second, moves, np.tile(np.diag(1.0 / NOISE**2), (len(first), 1, 1)))


def measured(seed: int) -> tuple[np.ndarray, np.ndarray, Relations, Relations]:
    """The truth, the poses by steps alone, the steps, and relations of the second round to the first."""
    rng, truth = np.random.default_rng(seed), square()
    index = np.arange(len(truth) - 1)
    chain = related(truth, index, index + 1, rng)
    poses = truth[:1]
    for x, y, yaw in chain.moves:
        c, s = math.cos(poses[-1, 2]), math.sin(poses[-1, 2])
        poses = np.vstack((poses, poses[-1] + (c * x - s * y, s * x + c * y, yaw)))
    first = np.arange(0, 4 * SIDE, 5)
    return truth, poses, chain, related(truth, first, first + 4 * SIDE, rng)


def off(poses: np.ndarray, truth: np.ndarray) -> float:
    """Mean error of the relations of the second round to the first [m]."""
    first = np.arange(4 * SIDE)
    moves = [relative_moves(rows, first, first + 4 * SIDE) for rows in (poses, truth)]
    return float(np.hypot(*(moves[0] - moves[1])[:, :2].T).mean())


@pytest.mark.parametrize("seed", range(3))
def test_loops_bring_the_second_round_onto_the_first(seed: int) -> None:
    truth, poses, chain, loops = measured(seed)
    found = solve(poses, chain, loops)
    assert off(poses, truth) > 1.0
    assert off(found.poses, truth) < 0.06
    assert found.poses[0] == pytest.approx(truth[0])
    assert found.weights.min() > 0.1


@pytest.mark.parametrize("seed", range(3))
def test_wrong_loops_are_not_believed(seed: int) -> None:
    truth, poses, chain, loops = measured(seed)
    wrong = np.arange(0, len(loops.first), 5)
    moves = loops.moves.copy()
    moves[wrong] += (3.0, -2.0, 0.3)
    found = solve(poses, chain, loops._replace(moves=moves))
    assert found.weights[wrong].max() < 0.01
    assert off(found.poses, truth) < 0.06


def test_without_loops_nothing_moves() -> None:
    _, poses, chain, _ = measured(0)
    found = solve(poses, chain, Relations.none())
    assert np.abs(found.poses - poses).max() < 1e-6
    assert len(found.weights) == 0
