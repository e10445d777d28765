"""The bounded distance transform against a plain search."""

from __future__ import annotations

import numpy as np
import pytest

from rosbot_patrol.maps.distance_kernels import bounded_distances


def by_search(marked: np.ndarray, bound: int) -> np.ndarray:
    spots = np.argwhere(marked)
    iy, ix = np.indices(marked.shape)
    if not len(spots):
        return np.full(marked.shape, float(bound))
    off = (iy[..., None] - spots[:, 0]) ** 2 + (ix[..., None] - spots[:, 1]) ** 2
    return np.minimum(np.sqrt(off.min(axis=2)), bound)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("bound", [1, 3, 8, 100])
def test_it_is_exact(seed: int, bound: int) -> None:
    rng = np.random.default_rng(seed)
    marked = rng.random(rng.integers(1, 40, 2)) < rng.choice([0.0, 0.005, 0.05, 0.5])
    np.testing.assert_allclose(bounded_distances(marked, bound), by_search(marked, bound), rtol=1e-6)
