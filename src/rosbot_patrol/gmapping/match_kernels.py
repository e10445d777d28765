"""Inner loops of scan matching: search from the odometry's guess, Gauss-Newton refinement, and covariance.

The objective is the sum over the beams of exp(-d2 / sigma), times a gain, plus the odometry's prior. Here d is the
distance of a beam's end to the mean of the nearest wall cell within a few cells. This is the score of Grisetti,
Stachniss, Burgard 2007 as gmapping implements it: the cell before the end, seen from the sensor, must be no wall. The
refinement measures the distance across the wall if the wall forms a line, so that a corridor constrains a scan only
across it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.gmapping.cholesky_kernels import factorise, solve, solve_upper
from rosbot_patrol.gmapping.prior_kernels import add_prior, fill_prior, prior_cost
from rosbot_patrol.gmapping.tile_kernels import BITS, FULL, MASK, MEAN_X, MEAN_Y, walls_from
from rosbot_patrol.kernels import kernel

Array = NDArray[np.float64]
Table = NDArray[np.int32]
Cells = NDArray[np.uint16]

FREE_RATIO = 1.4143  # distance before a beam's end at which the cell must be free [cells]
NULL = 0.5  # squared distance [m2] of a beam that found no wall
MOST_MOVES = 200
LONELY = 0.5  # weight in both directions of a beam whose wall has no known direction, however good the lidar is
FIRST_BEAMS = 120  # approximate number of beams at the start of a refinement
NEAR, NEAR_TURN = 0.05, 5e-4  # steps of a refinement [cells, rad] below which all beams are used
DONE, DONE_TURN = 0.01, 1e-4  # steps at which it ends
WIDEST = 1.0  # largest variance of the beams' distances from the walls [cells2]
LOSS = 3.0  # a refinement that makes the pose less likely by more than this, as a logarithm, is rejected ...
WELL = 0.7  # ... unless this share of the beams fits after it
FINER = 0.125  # steps of the search that goes on instead, as shares of the first ones


@kernel()
def nearest_wall(
    table: Table, cells: Cells, gx: float, gy: float, back_x: float, back_y: float, reach: int
) -> tuple[float, float, float]:
    """Find the mean of the nearest wall cell within `reach` cells of a beam's end.

    Args:
        table: of the map.
        cells: of all maps.
        gx: the end [cells].
        gy: likewise.
        back_x: offset from the end to the place that must be free [cells].
        back_y: likewise.
        reach: search radius [cells].

    Returns:
        Squared distance [cells2], -1 if there is none; offset from the mean to the end in x and y.
    """
    ix, iy = math.floor(gx), math.floor(gy)
    free_x, free_y = math.floor(gx + back_x) - ix, math.floor(gy + back_y) - iy
    best, best_x, best_y = 1e300, 0.0, 0.0
    first, count = ix - reach, 2 * reach + 1
    for y in range(iy - reach, iy + reach + 1):
        walls = walls_from(table, cells, first, y, count)
        if walls == 0:
            continue
        walls &= ~walls_from(table, cells, first + free_x, y + free_y, count)
        x = first
        while walls:
            if walls & 1:
                tile, cell = table[y >> BITS, x >> BITS], ((y & MASK) << BITS) + (x & MASK)
                dx = gx - x - cells[tile, cell, MEAN_X] / FULL
                dy = gy - y - cells[tile, cell, MEAN_Y] / FULL
                d2 = dx * dx + dy * dy
                if d2 < best:
                    best, best_x, best_y = d2, dx, dy
            walls >>= 1
            x += 1
    if best == 1e300:
        return -1.0, 0.0, 0.0
    return best, best_x, best_y


@kernel()
def score_of(
    table: Table, cells: Cells, x: float, y: float, yaw: float, beams: Array, every: int, reach: int, sigma: float
) -> float:
    """Sum of exp(-d2 / sigma) over every `every`-th beam."""
    c, s = math.cos(yaw), math.sin(yaw)
    total = 0.0
    for k in range(0, beams.shape[0], every):
        bx, by, ux, uy = beams[k, 0], beams[k, 1], -FREE_RATIO * beams[k, 2], -FREE_RATIO * beams[k, 3]
        d2, _, _ = nearest_wall(
            table, cells, x + c * bx - s * by, y + s * bx + c * by, c * ux - s * uy, s * ux + c * uy, reach
        )
        if d2 >= 0.0:
            total += math.exp(-d2 / sigma)
    return total


@kernel()
def fit_of(
    table: Table,
    cells: Cells,
    pose: Array,
    beams: Array,
    skip: int,
    reach: int,
    sigma: float,
    lsigma: float,
    null: float,
) -> tuple[float, float]:
    """Score and log-likelihood of a pose, in one pass over the beams.

    Returns:
        Sum of exp(-d2 / sigma) over the beams; sum of -d2 / lsigma over every `skip`-th, `null` / lsigma for each that
        finds no wall.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    score, likelihood = 0.0, 0.0
    for k in range(beams.shape[0]):
        bx, by, ux, uy = beams[k, 0], beams[k, 1], -FREE_RATIO * beams[k, 2], -FREE_RATIO * beams[k, 3]
        d2, _, _ = nearest_wall(
            table, cells, pose[0] + c * bx - s * by, pose[1] + s * bx + c * by, c * ux - s * uy, s * ux + c * uy, reach
        )
        if d2 >= 0.0:
            score += math.exp(-d2 / sigma)
        if k % skip == 0:
            likelihood -= (d2 if d2 >= 0.0 else null) / lsigma
    return score, likelihood


@kernel()
def climb(
    table: Table,
    cells: Cells,
    pose: Array,
    guess: Array,
    beams: Array,
    prior: Array,
    rare: float,
    lstep: float,
    astep: float,
    halvings: int,
    every: int,
    reach: int,
    sigma: float,
    gain: float,
) -> None:
    """Move a pose (in place) by steps to the best neighbour, and halve the steps if none is better.

    Args:
        table: of the map.
        cells: of all maps.
        pose: initial x, y [cells], yaw, shape (3,).
        guess: the odometry's, shape (3,).
        beams: see `match_particles`.
        prior: see `prior_kernels`.
        rare: likewise.
        lstep: first step [cells].
        astep: first turn [rad].
        halvings: how often the steps are halved.
        every: use every n-th beam.
        reach: of `nearest_wall`.
        sigma: of `score_of`.
        gain: weight of a beam's score against the prior.
    """
    best = gain * every * score_of(table, cells, pose[0], pose[1], pose[2], beams, every, reach, sigma)
    best -= prior_cost(pose, guess, prior, rare)
    tried, level = np.empty(3), 0
    for _ in range(MOST_MOVES):
        bx, by, byaw, found = pose[0], pose[1], pose[2], False
        for move in range(6):
            tried[:] = pose
            tried[move // 2] += (astep if move >= 4 else lstep) * (1.0 if move % 2 == 0 else -1.0)
            value = gain * every * score_of(table, cells, tried[0], tried[1], tried[2], beams, every, reach, sigma)
            value -= prior_cost(tried, guess, prior, rare)
            if value > best:
                best, bx, by, byaw, found = value, tried[0], tried[1], tried[2], True
        pose[0], pose[1], pose[2] = bx, by, byaw
        if found:
            continue
        level += 1
        if level > halvings:
            return
        lstep *= 0.5
        astep *= 0.5


@kernel()
def add_beams(
    table: Table,
    cells: Cells,
    pose: Array,
    beams: Array,
    every: int,
    reach: int,
    weight: float,
    lonely: float,
    information: Array,
    slope: Array,
) -> float:
    """Add every n-th beam to the normal equations of a pose: information (3, 3) and slope (3,).

    Each beam also counts for the ones skipped.

    Returns:
        Variance [cells2] of the distances to the walls, as of a Gaussian: outliers hardly count. At most `WIDEST`,
        which is also the value if no beam found a wall.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    a00, a01, a02, a11, a12, a22, g0, g1, g2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    count, squares = 0.0, 0.0  # of the beams with a known wall direction
    weight *= every
    for k in range(0, beams.shape[0], every):
        bx, by, ux, uy = beams[k, 0], beams[k, 1], -FREE_RATIO * beams[k, 2], -FREE_RATIO * beams[k, 3]
        rx, ry = c * bx - s * by, s * bx + c * by
        d2, dx, dy = nearest_wall(table, cells, pose[0] + rx, pose[1] + ry, c * ux - s * uy, s * ux + c * uy, reach)
        if d2 < 0.0:
            continue
        nx, ny = c * beams[k, 4] - s * beams[k, 5], s * beams[k, 4] + c * beams[k, 5]
        if nx != 0.0 or ny != 0.0:
            n00, n01, n11 = nx * nx, nx * ny, ny * ny
            across = nx * dx + ny * dy
            d2 = across * across
            believed = math.exp(-0.5 * d2)
            count += believed
            squares += believed * d2
        else:
            n00, n01, n11 = lonely, 0.0, lonely
            believed = math.exp(-0.5 * d2)
        w = weight * believed
        tx, ty = n00 * -ry + n01 * rx, n01 * -ry + n11 * rx  # N times the derivative by the turn
        ex, ey = n00 * dx + n01 * dy, n01 * dx + n11 * dy
        a00 += w * n00
        a01 += w * n01
        a11 += w * n11
        a02 += w * tx
        a12 += w * ty
        a22 += w * (-ry * tx + rx * ty)
        g0 += w * ex
        g1 += w * ey
        g2 += w * (-ry * ex + rx * ey)
    information[0, 0] += a00
    information[0, 1] += a01
    information[1, 0] += a01
    information[1, 1] += a11
    information[0, 2] += a02
    information[2, 0] += a02
    information[1, 2] += a12
    information[2, 1] += a12
    information[2, 2] += a22
    slope[0] += g0
    slope[1] += g1
    slope[2] += g2
    if count == 0.0:
        return WIDEST
    mean = squares / count  # v / (1 + v) of a Gaussian's variance v, by the weights
    return min(mean / max(1.0 - mean, 1e-9), WIDEST)


@kernel()
def refine(
    table: Table,
    cells: Cells,
    pose: Array,
    guess: Array,
    beams: Array,
    prior: Array,
    rare: float,
    rounds: int,
    every: int,
    reach: int,
    weight: float,
    lonely: float,
    lower: Array,
) -> float:
    """Gauss-Newton on the distances to the walls, with the prior about `guess`.

    Args:
        table: of the map.
        cells: of all maps.
        pose: initial pose, changed in place, shape (3,).
        guess: the odometry's, shape (3,).
        beams: see `match_particles`.
        prior: see `prior_kernels`.
        rare: likewise.
        rounds: maximum number of steps.
        every: start with every n-th beam, and use all near the end.
        reach: of `nearest_wall`.
        weight: information of one beam [1/cells2].
        lonely: share of it in both directions for a beam whose wall has no known direction.
        lower: filled with the Cholesky factor of the information at the last step, shape (3, 3).

    Returns:
        Variance of the distances at the last step, see `add_beams`.
    """
    information, slope, variance = np.empty((3, 3)), np.empty(3), WIDEST
    for _ in range(rounds):
        add_prior(pose, guess, prior, rare, information, slope)
        variance = add_beams(table, cells, pose, beams, every, reach, weight, lonely, information, slope)
        factorise(information, lower)
        solve(lower, slope)
        way = math.hypot(slope[0], slope[1])
        shrink = min(1.0, 1.0 / max(way, 1e-9), 0.05 / max(abs(slope[2]), 1e-9))
        for i in range(3):
            pose[i] -= shrink * slope[i]
        if every > 1 and way < NEAR and abs(slope[2]) < NEAR_TURN:
            every = 1
        elif way < DONE and abs(slope[2]) < DONE_TURN:
            break
    return variance


@kernel(
    "void(int32[:, :, ::1], uint16[:, :, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[::1],"
    " float64[::1], float64[::1], float64[:, ::1], float64[::1], float64[:, ::1], float64[:, ::1])"
)
def match_particles(
    tables: Table,
    cells: Cells,
    guesses: Array,
    starts: Array,
    beams: Array,
    headings: Array,
    deviation: Array,
    scale: Array,
    noise: Array,
    tuning: Array,
    poses: Array,
    fits: Array,
) -> None:
    """Match a scan into each particle's map and draw each pose from the Gaussian about the match.

    Args:
        tables: of the particles' maps, shape (N, TY, TX).
        cells: of all maps.
        guesses: the odometry's poses x, y [cells], yaw, shape (N, 3).
        starts: where the search begins, likewise, shape (N, 3).
        beams: ends x, y [cells], directions and unit normals of the walls (0 without a line) in the
            robot's frame, shape (K, 6).
        headings: before the move, shape (N,).
        deviation: of the odometry's move ahead, to the left [cells] and in turning, by the parameters, shape (3,).
        scale: how much of it is real, see `OdometryNoise`, shape (3,).
        noise: standard normal numbers, shape (N, 3).
        tuning: lstep [cells], astep, halvings, rounds, beams to skip in the search, reach, sigma, lsigma [cells2],
            null [cells2], beams to skip in the likelihood, information of a beam [1/cells2], share of it for a
            beam without a line, least score, gain of a beam's score against the prior, shape (14,).
        poses: filled with the drawn poses, shape (N, 3).
        fits: filled with the score (0 for a failed match), logarithm of the likelihood at the match, the match's x, y
            [cells], yaw, the variance of the beams' distances from the walls there [cells2], and the logarithm of the
            match's probability, up to a constant, shape (N, 7).
    """
    lstep, astep, halvings, rounds, every, reach_, sigma, lsigma, null, lskip, weight, lonely, least, gain = tuning
    reach, fine = int(reach_), max(beams.shape[0] // FIRST_BEAMS, 1)
    lower, prior, pose, climbed, drawn = np.empty((3, 3)), np.empty((2, 3, 3)), np.empty(3), np.empty(3), np.empty(3)
    for i in range(guesses.shape[0]):
        table, guess = tables[i], guesses[i]
        rare = fill_prior(headings[i], deviation, scale, prior)
        pose[:] = starts[i]
        climb(
            table, cells, pose, guess, beams, prior, rare, lstep, astep, int(halvings), int(every), reach, sigma, gain
        )
        climbed[:] = pose
        fits[i, 5] = refine(
            table, cells, pose, guess, beams, prior, rare, int(rounds), fine, reach, weight, lonely, lower
        )
        before = fine * score_of(table, cells, climbed[0], climbed[1], climbed[2], beams, fine, reach, sigma)
        after = fine * score_of(table, cells, pose[0], pose[1], pose[2], beams, fine, reach, sigma)
        won = gain * (after - before) - prior_cost(pose, guess, prior, rare) + prior_cost(climbed, guess, prior, rare)
        if won < -LOSS and after < WELL * beams.shape[0]:
            pose[:], fits[i, 5] = climbed, WIDEST
            climb(
                table,
                cells,
                pose,
                guess,
                beams,
                prior,
                rare,
                lstep * FINER,
                astep * FINER,
                int(halvings),
                fine,
                reach,
                sigma,
                gain,
            )
        fits[i, 0], fits[i, 1] = fit_of(table, cells, pose, beams, int(lskip), reach, sigma, lsigma, null)
        if fits[i, 0] <= least:
            pose[:], fits[i, 5] = guess, WIDEST
            factorise(prior[0], lower)
            _, fits[i, 1] = fit_of(table, cells, pose, beams, int(lskip), reach, sigma, lsigma, null)
            fits[i, 0] = 0.0
        fits[i, 2:5] = pose
        fits[i, 6] = gain * fits[i, 0] - prior_cost(pose, guess, prior, rare)
        drawn[:] = noise[i]
        solve_upper(lower, drawn)
        poses[i] = pose + drawn
