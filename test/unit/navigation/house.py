"""The house as a map, a unicycle and a ray-cast lidar: a closed loop around the pure navigator, without a simulator."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.scan import LaserScan

ROOMS = {
    0: (0.0, 0.0),
    1: (2.819, -0.175),
    2: (-3.489, 0.306),
    3: (-4.786, 3.412),
    4: (-3.848, 6.496),
    5: (2.682, 7.352),
    6: (5.651, 12.038),
    7: (14.750, 11.480),
}


def house_map(walls: Path, resolution: float = 0.05) -> Grid:
    """Occupancy of the walls that reach the floor; everything else is free."""
    info = GridInfo(
        resolution=resolution,
        width=round(26.5 / resolution),
        height=round(19.0 / resolution),
        origin_x=-8.5,
        origin_y=-3.2,
    )
    cells = np.zeros(info.shape, np.int8)
    y, x = np.mgrid[: info.height, : info.width]
    x = info.origin_x + (x + 0.5) * resolution
    y = info.origin_y + (y + 0.5) * resolution
    with walls.open() as file:
        for row in csv.DictReader(file):
            if float(row["z_m"]) - float(row["height_m"]) / 2.0 > 0.5:
                continue
            yaw = float(row["yaw_rad"])
            dx, dy = x - float(row["x_m"]), y - float(row["y_m"])
            along = math.cos(yaw) * dx + math.sin(yaw) * dy
            across = -math.sin(yaw) * dx + math.cos(yaw) * dy
            half = resolution / 2.0
            inside = (np.abs(along) <= float(row["length_m"]) / 2.0 + half / 2) & (
                np.abs(across) <= float(row["thickness_m"]) / 2.0 + half / 2
            )
            cells[inside] = 100
    return Grid(info, cells)


def cast(grid: Grid, x: float, y: float, yaw: float, *, beams: int = 180, reach: float = 6.0) -> np.ndarray:
    """Ranges of a full turn of beams from a pose over occupied cells, inf where nothing is within reach."""
    info = grid.info
    angles = yaw - math.pi + np.arange(beams) * math.tau / beams
    steps = np.arange(0.0, reach, info.resolution * 0.5)
    px = np.floor((x + np.outer(np.cos(angles), steps) - info.origin_x) / info.resolution).astype(int)
    py = np.floor((y + np.outer(np.sin(angles), steps) - info.origin_y) / info.resolution).astype(int)
    inside = (px >= 0) & (py >= 0) & (px < info.width) & (py < info.height)
    hit = inside & (grid.cells[py.clip(0, info.height - 1), px.clip(0, info.width - 1)] == 100)
    first = hit.argmax(axis=1)
    return np.where(hit.any(axis=1), steps[first], np.inf)


def scan_of(ranges: np.ndarray, stamp: float, frame: str) -> LaserScan:
    """Those ranges as a scan of a sensor that looks along the robot."""
    return LaserScan(
        stamp=stamp,
        frame_id=frame,
        angle_min=-math.pi,
        angle_increment=math.tau / len(ranges),
        range_min=0.1,
        range_max=12.0,
        ranges=ranges,
    )
