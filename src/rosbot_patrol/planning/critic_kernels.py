"""Inner loops of the local planner: simulating trajectories, checking footprints, reading distance fields."""

from __future__ import annotations

import math

import numpy as np

from rosbot_patrol.kernels import kernel


@kernel("float64[:, :, ::1](float64[::1], float64[:, ::1], float64[::1], float64, int64, float64, float64)")
def simulate(pose, samples, velocity, sim_time, steps, acc_x, acc_theta):
    """Drive each velocity (vx, wz) of `samples`, shape (K, 2), for `sim_time` from a pose.

    The robot speeds up from its velocity (vx, wz) to the sample with the accelerations given.

    Returns:
        Poses after each step, shape (K, steps, 3).
    """
    out = np.empty((samples.shape[0], steps, 3), np.float64)
    dt = sim_time / steps
    for k in range(samples.shape[0]):
        x, y, yaw = pose[0], pose[1], pose[2]
        vx, wz = velocity[0], velocity[1]
        for i in range(steps):
            dv, dw = samples[k, 0] - vx, samples[k, 1] - wz
            vx += min(max(dv, -acc_x * dt), acc_x * dt)
            wz += min(max(dw, -acc_theta * dt), acc_theta * dt)
            middle = yaw + wz * dt / 2.0
            x += vx * math.cos(middle) * dt
            y += vx * math.sin(middle) * dt
            yaw += wz * dt
            out[k, i, 0], out[k, i, 1], out[k, i, 2] = x, y, yaw
    return out


@kernel("int64(uint8[:, ::1], float64, float64, float64, float64[:, ::1], float64, float64, float64)")
def count_touching(cells, resolution, origin_x, origin_y, outline, x, y, yaw):
    """How many points of the outline lie in lethal cells with the robot at a pose."""
    height, width = cells.shape
    c, s = math.cos(yaw), math.sin(yaw)
    count = 0
    for k in range(outline.shape[0]):
        px = x + c * outline[k, 0] - s * outline[k, 1]
        py = y + s * outline[k, 0] + c * outline[k, 1]
        jx, jy = math.floor((px - origin_x) / resolution), math.floor((py - origin_y) / resolution)
        if 0 <= jx < width and 0 <= jy < height and cells[jy, jx] == 254:
            count += 1
    return count


@kernel("float64[::1](float64[:, :, ::1], uint8[:, ::1], float64, float64, float64, float64[:, ::1], int64)")
def leaving_costs(trajectories, cells, resolution, origin_x, origin_y, outline, touching):
    """For a robot that touches something: how much it still touches at each end, -1 where it ever touches more.

    `touching` is how many points of the outline touch now; a trajectory has to end with fewer. Shape (K,).
    """
    count, steps, _ = trajectories.shape
    out = np.zeros(count, np.float64)
    for k in range(count):
        n = touching
        for i in range(steps):
            x, y, yaw = trajectories[k, i, 0], trajectories[k, i, 1], trajectories[k, i, 2]
            n = count_touching(cells, resolution, origin_x, origin_y, outline, x, y, yaw)
            if n > touching:
                break
        out[k] = n if n < touching else -1.0
    return out


@kernel("int64(uint8[:, ::1], float64, float64, float64, float64[:, ::1], float64, float64, float64, int64, int64)")
def footprint_cost(cells, resolution, origin_x, origin_y, outline, x, y, yaw, free_below, taken_from):
    """Cost of the robot standing at a pose, -1 in collision, -2 where it is unknown, -3 off the map.

    `outline` holds points along the footprint's edges in the robot's frame, shape (M, 2); where the centre costs less
    than `free_below`, it need not be looked at; where it costs `taken_from` or more, the robot cannot be.
    """
    height, width = cells.shape
    ix, iy = math.floor((x - origin_x) / resolution), math.floor((y - origin_y) / resolution)
    if ix < 0 or iy < 0 or ix >= width or iy >= height:
        return -3
    highest = np.int64(cells[iy, ix])
    if highest == 255:
        return -2
    if highest >= taken_from:
        return -1
    if highest < free_below:
        return highest
    c, s = math.cos(yaw), math.sin(yaw)
    for k in range(outline.shape[0]):
        px = x + c * outline[k, 0] - s * outline[k, 1]
        py = y + s * outline[k, 0] + c * outline[k, 1]
        jx, jy = math.floor((px - origin_x) / resolution), math.floor((py - origin_y) / resolution)
        if jx < 0 or jy < 0 or jx >= width or jy >= height:
            return -3
        cost = cells[jy, jx]
        if cost == 254:
            return -1
        if cost == 255:
            return -2
    return highest


@kernel(
    "float64[::1](float64[:, :, ::1], uint8[:, ::1], float64, float64, float64, float64[:, ::1], int64, int64)",
)
def worst_footprint_costs(trajectories, cells, resolution, origin_x, origin_y, outline, free_below, taken_from):
    """Highest cost along each trajectory, negative as `footprint_cost` where one pose is not free; shape (K,)."""
    count, steps, _ = trajectories.shape
    out = np.zeros(count, np.float64)
    for k in range(count):
        worst = 0
        for i in range(steps):
            x, y, yaw = trajectories[k, i, 0], trajectories[k, i, 1], trajectories[k, i, 2]
            cost = footprint_cost(cells, resolution, origin_x, origin_y, outline, x, y, yaw, free_below, taken_from)
            if cost < 0:
                worst = cost
                break
            worst = max(worst, cost)
        out[k] = worst
    return out


@kernel("float64(float32[:, ::1], float64, float64, float64, float64, float64)")
def read_field(field, resolution, origin_x, origin_y, x, y):
    """A field at a point, interpolated between the finite cells around; inf where there is none."""
    height, width = field.shape
    u = (x - origin_x) / resolution - 0.5
    v = (y - origin_y) / resolution - 0.5
    x0, y0 = math.floor(u), math.floor(v)
    fx, fy = u - x0, v - y0
    total, weight = 0.0, 0.0
    for k in range(4):
        jx, jy = x0 + (k & 1), y0 + (k >> 1)
        if jx < 0 or jy < 0 or jx >= width or jy >= height:
            continue
        value = float(field[jy, jx])
        if math.isfinite(value):
            w = (fx if k & 1 else 1.0 - fx) * (fy if k >> 1 else 1.0 - fy) + 1e-9
            total += w * value
            weight += w
    if weight < 1e-8:
        return np.inf
    return total / weight


@kernel("float64[::1](float64[:, :, ::1], float32[:, ::1], float64, float64, float64, float64)")
def end_distances(trajectories, field, resolution, origin_x, origin_y, nose):
    """A distance field at the last pose of each trajectory, meant with the point `nose` ahead; shape (K,).

    Where the end cannot be reached at all it is inf; a nose in an obstacle counts as far as it can be.
    """
    count, steps, _ = trajectories.shape
    out = np.empty(count, np.float64)
    for k in range(count):
        x, y, yaw = trajectories[k, steps - 1, 0], trajectories[k, steps - 1, 1], trajectories[k, steps - 1, 2]
        end = read_field(field, resolution, origin_x, origin_y, x, y)
        if nose > 0.0 and math.isfinite(end):
            px, py = x + nose * math.cos(yaw), y + nose * math.sin(yaw)
            ahead = read_field(field, resolution, origin_x, origin_y, px, py)
            ahead = min(ahead, end + nose / resolution)
            end = 0.5 * (end + ahead)
        out[k] = end
    return out


@kernel("uint8[:, ::1](uint8[:, ::1], int64)")
def shrink(cells, factor):
    """The highest cost of each block of factor x factor cells (255, unknown, counts as such)."""
    height, width = cells.shape
    h, w = (height + factor - 1) // factor, (width + factor - 1) // factor
    out = np.zeros((h, w), np.uint8)
    for y in range(height):
        for x in range(width):
            out[y // factor, x // factor] = max(out[y // factor, x // factor], cells[y, x])
    return out
