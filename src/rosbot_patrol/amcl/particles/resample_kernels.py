"""Inner loops of resampling with an adaptive number of particles (Fox 2003, KLD sampling), and of clustering."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

Array = NDArray[np.float64]
Wholes = NDArray[np.int64]

EMPTY = np.int64(-1)
BIN_M = 0.5
BIN_RAD = math.pi / 18.0
TURNS = 36  # bins in a full turn


@kernel("int64(int64, float64, float64, int64, int64)")
def kld_size(bins: int, error: float, z: float, least: int, most: int) -> int:
    """Number of particles that bounds the error against the true distribution (Fox 2003, equation 7).

    Args:
        bins: bins that hold particles.
        error: largest Kullback-Leibler distance.
        z: upper quantile of the standard normal distribution.
        least: smallest answer.
        most: largest answer.
    """
    if bins <= 1:
        return least
    k = bins - 1.0
    b = 2.0 / (9.0 * k)
    root = 1.0 - b + math.sqrt(b) * z
    return min(max(math.ceil(k / (2.0 * error) * root * root * root), least), most)


@kernel("int64(float64, float64, float64)")
def bin_key(x: float, y: float, yaw: float) -> int:
    """Bin of a pose as one number: 0.5 m x 0.5 m x 10 degrees, closed over the full turn."""
    turn = math.floor(yaw / BIN_RAD) % TURNS
    return ((math.floor(x / BIN_M) + (1 << 24)) * (1 << 25) + math.floor(y / BIN_M) + (1 << 24)) * 64 + turn


@kernel("int64(int64[::1], int64)")
def find_slot(slots: Wholes, key: int) -> int:
    """Slot of a key in an open hash table of 2^n slots, or the empty slot for it."""
    mask = slots.shape[0] - 1
    mixed = key * 0x1E3779B97F4A7C15
    at = ((mixed >> 32) ^ mixed) & mask
    while slots[at] != EMPTY and slots[at] != key:
        at = (at + 1) & mask
    return at


@kernel(
    "int64(float64[:, ::1], float64[::1], float64, float64[:, ::1], float64, float64, int64, int64, float64[:, ::1])"
)
def draw(
    poses: Array,
    cumulative: Array,
    offset: float,
    strangers: Array,
    error: float,
    z: float,
    least: int,
    most: int,
    out: Array,
) -> int:
    """Draw particles by weight until their spread needs no more; returns their number.

    The draws follow the golden ratio's additive sequence, which covers the weights evenly for any number of draws.

    Args:
        poses: x, y, yaw, shape (N, 3).
        cumulative: running sum of the weights up to 1, shape (N,).
        offset: start of the sequence, 0 to 1.
        strangers: x, y, yaw of random poses that replace draws, NaN for none, shape (most or 0, 3).
        error: as for `kld_size`.
        z: as for `kld_size`.
        least: fewest particles.
        most: most particles.
        out: the drawn poses, shape (most, 3).
    """
    size = 16
    while size < 4 * most:
        size *= 2
    slots = np.full(size, EMPTY, dtype=np.int64)
    bins, wanted = 0, least
    at = offset
    for m in range(most):
        at += 0.6180339887498949
        if at >= 1.0:
            at -= 1.0
        if m < strangers.shape[0] and not math.isnan(strangers[m, 0]):
            out[m, 0], out[m, 1], out[m, 2] = strangers[m, 0], strangers[m, 1], strangers[m, 2]
        else:
            i = min(int(np.searchsorted(cumulative, at, side="right")), poses.shape[0] - 1)
            out[m, 0], out[m, 1], out[m, 2] = poses[i, 0], poses[i, 1], poses[i, 2]
        key = bin_key(out[m, 0], out[m, 1], out[m, 2])
        slot = find_slot(slots, key)
        if slots[slot] == EMPTY:
            slots[slot] = key
            bins += 1
            wanted = kld_size(bins, error, z, least, most)
        if m + 1 >= wanted:
            return m + 1
    return most


@kernel("float64[:, ::1](float64[:, ::1], float64[::1], int64[::1], int64)")
def moments(poses: Array, weights: Array, labels: Wholes, label: int) -> Array:
    """Weighted moments of the particles of one cluster, or of all if `label` is negative.

    Returns:
        Row 0: mean x, y, yaw (circular); rows 1 to 3: covariance, with yaw's own being circular; row 4: the
        weight, 0, 0. Shape (5, 3). Plain sums in order, so that the same particles give the same bits.
    """
    out = np.zeros((5, 3))
    total, c, s = 0.0, 0.0, 0.0
    for i in range(poses.shape[0]):
        if label < 0 or labels[i] == label:
            total += weights[i]
            out[0, 0] += weights[i] * poses[i, 0]
            out[0, 1] += weights[i] * poses[i, 1]
            c += weights[i] * math.cos(poses[i, 2])
            s += weights[i] * math.sin(poses[i, 2])
    out[4, 0] = total
    out[0, 0], out[0, 1], out[0, 2] = out[0, 0] / total, out[0, 1] / total, math.atan2(s, c)
    for i in range(poses.shape[0]):
        if label < 0 or labels[i] == label:
            share = weights[i] / total
            dx, dy = poses[i, 0] - out[0, 0], poses[i, 1] - out[0, 1]
            turn = poses[i, 2] - out[0, 2]
            turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
            out[1, 0] += share * dx * dx
            out[1, 1] += share * dx * dy
            out[1, 2] += share * dx * turn
            out[2, 1] += share * dy * dy
            out[2, 2] += share * dy * turn
    out[2, 0], out[3, 0], out[3, 1] = out[1, 1], out[1, 2], out[2, 2]
    out[3, 2] = max(-2.0 * math.log(max(math.sqrt(c * c + s * s) / total, 1e-12)), 0.0)
    return out


@kernel("int64(int64[::1], int64)")
def root_of(parents: Wholes, i: int) -> int:
    """Representative of a set, with path halving (disjoint sets)."""
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = parents[i]
    return i


@kernel("void(int64[::1], int64[::1], int64[::1], int64[::1], float64[::1], float64)")
def join_bins(keys: Wholes, slots: Wholes, index: Wholes, parents: Wholes, mass: Array, least: float) -> None:
    """Join each bin of at least `least` weight with its neighbours.

    Args:
        keys: of the bins, shape (B,).
        slots: hash table of the keys.
        index: the bin in each slot.
        parents: disjoint sets of bins, changed in place, shape (B,).
        mass: weight in each bin, shape (B,).
        least: a bin with less joins with nothing by itself.
    """
    for b in range(keys.shape[0]):
        if mass[b] < least:
            continue
        turn = keys[b] % 64
        place = keys[b] // 64
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                for dt in range(-1, 2):
                    near = (place + dx * (1 << 25) + dy) * 64 + (turn + dt) % TURNS
                    slot = find_slot(slots, near)
                    if slots[slot] != near:
                        continue
                    other = index[slot]
                    if mass[other] >= least or parents[other] == other:
                        parents[root_of(parents, other)] = root_of(parents, b)


@kernel("int64(float64[:, ::1], float64[::1], float64, int64[::1])")
def label_clusters(poses: Array, weights: Array, share: float, labels: Wholes) -> int:
    """Number the clusters of particles in touching bins; returns how many numbers are in use.

    Only bins with at least `share` of the heaviest bin's weight link others (as the core points of DBSCAN, Ester et al.
    1996). Otherwise random poses from the recovery would link the whole house to one cluster.

    Args:
        poses: x, y, yaw, shape (N, 3).
        weights: of each, shape (N,).
        share: 0 to 1; 0: every bin links.
        labels: the cluster of each, shape (N,); numbers need not be consecutive.
    """
    n = poses.shape[0]
    size = 16
    while size < 4 * n:
        size *= 2
    slots = np.full(size, EMPTY, dtype=np.int64)
    index = np.zeros(size, dtype=np.int64)
    keys = np.empty(n, dtype=np.int64)
    mass = np.zeros(n)
    bins = 0
    for i in range(n):
        key = bin_key(poses[i, 0], poses[i, 1], poses[i, 2])
        slot = find_slot(slots, key)
        if slots[slot] == EMPTY:
            slots[slot] = key
            index[slot] = bins
            keys[bins] = key
            bins += 1
        labels[i] = index[slot]
        mass[labels[i]] += weights[i]
    parents = np.arange(bins)
    join_bins(keys[:bins], slots, index, parents, mass[:bins], share * mass[:bins].max())
    for i in range(n):
        labels[i] = root_of(parents, labels[i])
    return bins
