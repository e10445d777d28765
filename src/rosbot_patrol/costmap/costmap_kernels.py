"""Inner loops of the costmap: exact bounded distances, ray tracing, merging of layers, polygons."""

from __future__ import annotations

import math

import numpy as np

from rosbot_patrol.kernels import kernel


@kernel("void(uint8[:, ::1], int64, int64, int64, int64, int64, uint8[::1], boolean)")
def inflate(cells, x0, y0, x1, y1, radius, table, inflate_unknown):
    """Raise the costs of cells [y0:y1, x0:x1] by their distance to the nearest lethal cell.

    Exact Euclidean distances in two passes (Meijster, Roerdink, Hesselink 2000), bounded by `radius` cells; lethal
    cells up to `radius` outside the rectangle count. `table[d2]` is the cost at the squared distance d2 in cells.
    """
    height, width = cells.shape
    rx0, rx1 = max(x0 - radius, 0), min(x1 + radius, width)
    ry0, ry1 = max(y0 - radius, 0), min(y1 + radius, height)
    w, h = rx1 - rx0, ry1 - ry0
    cap = radius + 1
    down = np.empty((h, w), np.uint16)
    # vertical distance to the nearest lethal cell above (lower index), then below
    for x in range(w):
        down[0, x] = 0 if cells[ry0, rx0 + x] == 254 else cap
    for y in range(1, h):
        for x in range(w):
            d = min(down[y - 1, x] + 1, cap)
            down[y, x] = 0 if cells[ry0 + y, rx0 + x] == 254 else d
    for y in range(h - 2, -1, -1):
        for x in range(w):
            d = down[y + 1, x] + 1
            down[y, x] = min(d, down[y, x])
    site = np.empty(w, np.int32)
    site_d2 = np.empty(w, np.int32)
    start = np.empty(w, np.int32)
    r2 = radius * radius
    for iy in range(y0, y1):
        row = down[iy - ry0]
        n = 0
        for u in range(w):
            g = np.int32(row[u])
            if g > radius:
                continue
            g2 = g * g
            begin = 0
            while n > 0:
                v = site[n - 1]
                # first column at which u is nearer than v
                sep = (np.float64(u) * u - np.float64(v) * v + g2 - site_d2[n - 1]) / (2.0 * (u - v))
                begin = math.floor(sep) + 1
                if begin > start[n - 1]:
                    break
                n -= 1
            if n == 0:
                begin = 0
            if begin < w:
                site[n], site_d2[n], start[n] = u, g2, max(begin, 0)
                n += 1
        if n == 0:
            continue
        k = 0
        out = cells[iy]
        for u in range(x0 - rx0, x1 - rx0):
            while k + 1 < n and start[k + 1] <= u:
                k += 1
            dx = np.int64(u - site[k])
            d2 = dx * dx + site_d2[k]
            if d2 > r2 or d2 == 0:
                continue
            cost = table[d2]
            old = out[rx0 + u]
            if old == 255:
                if (inflate_unknown and cost > 0) or cost >= 253:
                    out[rx0 + u] = cost
            elif cost > old:
                out[rx0 + u] = cost


@kernel("void(uint8[:, ::1], int64, int64, int64, int64, float64, uint8)", inline="never")
def draw_ray(cells, x0, y0, x1, y1, max_cells, value):
    """Set the cells of a line (Bresenham), at most `max_cells` long, both ends included; those inside the grid."""
    height, width = cells.shape
    dx, dy = abs(x1 - x0), abs(y1 - y0)
    length = math.sqrt(float(dx * dx + dy * dy))
    steps = max(dx, dy)
    if length > max_cells:
        steps = int(steps * max_cells / length)
    sx = 1 if x1 > x0 else -1
    sy = 1 if y1 > y0 else -1
    x, y = x0, y0
    error = max(dx, dy) // 2
    for _ in range(steps + 1):
        if x < 0 or y < 0 or x >= width or y >= height:
            return
        cells[y, x] = value
        if dx >= dy:
            x += sx
            error -= dy
            if error < 0:
                y += sy
                error += dx
        else:
            y += sy
            error -= dx
            if error < 0:
                x += sx
                error += dy


@kernel("int64[::1](uint8[:, ::1], float64, float64, float64, float64, float64, float64[:, ::1], float64)")
def clear_rays(cells, resolution, origin_x, origin_y, sensor_x, sensor_y, ends, raytrace_range):
    """Set the cells from the sensor to each end [m] free, up to `raytrace_range`; returns the bounds touched."""
    height, width = cells.shape
    cx = math.floor((sensor_x - origin_x) / resolution)
    cy = math.floor((sensor_y - origin_y) / resolution)
    bounds = np.array([width, height, 0, 0], dtype=np.int64)
    if cx < 0 or cy < 0 or cx >= width or cy >= height:
        bounds[0] = bounds[1] = 0
        return bounds
    reach = raytrace_range / resolution
    for i in range(ends.shape[0]):
        ex = math.floor((ends[i, 0] - origin_x) / resolution)
        ey = math.floor((ends[i, 1] - origin_y) / resolution)
        draw_ray(cells, cx, cy, ex, ey, reach, 0)
        length = math.sqrt(float((ex - cx) * (ex - cx) + (ey - cy) * (ey - cy)))
        if length > reach:
            ex = cx + int((ex - cx) * reach / length)
            ey = cy + int((ey - cy) * reach / length)
        ex, ey = min(max(ex, 0), width - 1), min(max(ey, 0), height - 1)
        bounds[0], bounds[1] = min(bounds[0], ex, cx), min(bounds[1], ey, cy)
        bounds[2], bounds[3] = max(bounds[2], ex + 1, cx + 1), max(bounds[3], ey + 1, cy + 1)
    return bounds


@kernel("int64[::1](uint8[:, ::1], float64, float64, float64, float64, float64, float64[:, ::1], float64)")
def mark_points(cells, resolution, origin_x, origin_y, sensor_x, sensor_y, points, obstacle_range):
    """Make the cells of points [m] nearer to the sensor than `obstacle_range` lethal; returns the bounds touched."""
    height, width = cells.shape
    bounds = np.array([width, height, 0, 0], dtype=np.int64)
    reach = obstacle_range * obstacle_range
    for i in range(points.shape[0]):
        dx, dy = points[i, 0] - sensor_x, points[i, 1] - sensor_y
        if dx * dx + dy * dy >= reach:
            continue
        ix = math.floor((points[i, 0] - origin_x) / resolution)
        iy = math.floor((points[i, 1] - origin_y) / resolution)
        if ix < 0 or iy < 0 or ix >= width or iy >= height:
            continue
        cells[iy, ix] = 254
        bounds[0], bounds[1] = min(bounds[0], ix), min(bounds[1], iy)
        bounds[2], bounds[3] = max(bounds[2], ix + 1), max(bounds[3], iy + 1)
    if bounds[2] == 0:
        bounds[0] = bounds[1] = 0
    return bounds


@kernel("void(uint8[:, ::1], uint8[:, ::1], int64, int64, int64, int64)")
def merge_max(master, layer, x0, y0, x1, y1):
    """Upstream's combination by maximum: unknown cells of the layer say nothing, unknown ones of the master yield."""
    for y in range(y0, y1):
        for x in range(x0, x1):
            new, old = layer[y, x], master[y, x]
            if new != 255 and (old == 255 or old < new):
                master[y, x] = new


@kernel("void(uint8[:, ::1], uint8[:, ::1], int64, int64, int64, int64)")
def merge_over(master, layer, x0, y0, x1, y1):
    """Upstream's combination by overwriting: all but the layer's unknown cells."""
    for y in range(y0, y1):
        for x in range(x0, x1):
            new = layer[y, x]
            if new != 255:
                master[y, x] = new


@kernel("void(uint8[:, ::1], uint8[:, ::1], int64, int64, int64, int64, float64[::1], boolean)")
def sample_map(master, source, x0, y0, x1, y1, affine, use_maximum):
    """Write a map that lies differently into the master.

    `affine` is (a, b, c, d, e, f): source ix = a * x + b * y + c, source iy = d * x + e * y + f, for the master's
    cells x, y.
    """
    height, width = source.shape
    a, b, c, d, e, f = affine[0], affine[1], affine[2], affine[3], affine[4], affine[5]
    for y in range(y0, y1):
        for x in range(x0, x1):
            sx = math.floor(a * x + b * y + c)
            sy = math.floor(d * x + e * y + f)
            if sx < 0 or sy < 0 or sx >= width or sy >= height:
                continue
            new, old = source[sy, sx], master[y, x]
            if not use_maximum or (new != 255 and (old == 255 or old < new)):
                master[y, x] = new


@kernel("void(uint8[:, ::1], float64[:, ::1], uint8)")
def fill_polygon(cells, corners, value):
    """Set the cells whose centres lie in a polygon; corners in cells (x, y), shape (N, 2)."""
    height, width = cells.shape
    n = corners.shape[0]
    y0 = max(math.floor(corners[:, 1].min()), 0)
    y1 = min(math.ceil(corners[:, 1].max()), height)
    x0 = max(math.floor(corners[:, 0].min()), 0)
    x1 = min(math.ceil(corners[:, 0].max()), width)
    for y in range(y0, y1):
        py = y + 0.5
        for x in range(x0, x1):
            px = x + 0.5
            inside = False
            j = n - 1
            for i in range(n):
                if (corners[i, 1] > py) != (corners[j, 1] > py):
                    slope = (corners[j, 0] - corners[i, 0]) / (corners[j, 1] - corners[i, 1])
                    if px < corners[i, 0] + slope * (py - corners[i, 1]):
                        inside = not inside
                j = i
            if inside:
                cells[y, x] = value
