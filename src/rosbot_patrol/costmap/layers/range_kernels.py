"""Inner loop of the range sensor layer: adds one reading to the cells of its cone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel


@kernel(
    "void(uint8[:, ::1], float64, float64, float64, float64, float64, float64, float64, float64, float64, float64,"
    "boolean, int64[::1])"
)
def update_cone(
    cells: NDArray[np.uint8],
    resolution: float,
    origin_x: float,
    origin_y: float,
    sensor_x: float,
    sensor_y: float,
    yaw: float,
    reading: float,
    half_angle: float,
    phi: float,
    inflate: float,
    is_clear: bool,
    changes: NDArray[np.int64],
) -> None:
    """Update the cells in a sensor's cone by Bayes' rule.

    Args:
        cells: probabilities, 0 to 254 for 0 to 1.
        resolution: edge of a cell [m].
        origin_x: left edge of the window [m].
        origin_y: lower edge [m].
        sensor_x: position of the sensor [m].
        sensor_y: the same.
        yaw: its viewing direction [rad].
        reading: distance [m].
        half_angle: of the cone [rad].
        phi: distance beyond which readings count half [m].
        inflate: how much of the space beside the cone is updated, 0 to 1; the model says nothing there.
        is_clear: there is no obstacle up to the reading.
        changes: x0, y0, x1, y1 around the cells that changed, grown here.
    """
    height, width = cells.shape
    delta = max(resolution * reading, 0.75 * resolution)  # half the thickness of the obstacle [m]
    reach = reading + 2.0 * delta
    x0 = max(math.floor((sensor_x - reach - origin_x) / resolution), 0)
    x1 = min(math.floor((sensor_x + reach - origin_x) / resolution) + 1, width)
    y0 = max(math.floor((sensor_y - reach - origin_y) / resolution), 0)
    y1 = min(math.floor((sensor_y + reach - origin_y) / resolution) + 1, height)
    for iy in range(y0, y1):
        for ix in range(x0, x1):
            dx = origin_x + (ix + 0.5) * resolution - sensor_x
            dy = origin_y + (iy + 0.5) * resolution - sensor_y
            distance = math.sqrt(dx * dx + dy * dy)
            if distance > reach or distance < 1e-9:
                continue
            off = math.atan2(dy, dx) - yaw
            off = abs(off - math.floor(off / math.tau + 0.5) * math.tau)
            off -= math.atan2(0.5 * resolution * inflate, distance)  # the part of the cell that is nearest to the axis
            off = max(off, 0.0)
            if off >= half_angle:
                continue
            sure = (1.0 - 0.5 * (1.0 + math.tanh(2.0 * (distance - phi)))) * (1.0 - (off / half_angle) ** 2)
            if is_clear:
                if distance > reading:
                    continue
                says = 0.05
            elif distance < reading - 2.0 * delta:
                says = 0.5 * (1.0 - sure)
            elif distance < reading - delta:
                part = (distance - (reading - 2.0 * delta)) / delta
                says = sure * 0.5 * part * part + 0.5 * (1.0 - sure)
            elif distance < reading + delta:
                part = (reading - distance) / delta
                says = sure * (0.5 - 0.5 * part * part) + 0.5
            else:
                continue
            prior = cells[iy, ix] / 254.0
            occupied = says * prior
            total = occupied + (1.0 - says) * (1.0 - prior)
            if total <= 0.0:
                continue
            new = int(occupied / total * 254.0 + 0.5)
            new = min(max(new, 3), 251)  # never so sure that it cannot change
            if new != cells[iy, ix]:
                cells[iy, ix] = new
                changes[0], changes[1] = min(changes[0], ix), min(changes[1], iy)
                changes[2], changes[3] = max(changes[2], ix + 1), max(changes[3], iy + 1)
