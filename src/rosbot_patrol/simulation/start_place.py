"""Places around a point, the nearest first, to look for a free one."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rosbot_patrol.geometry import Pose2D

STEP = 0.25  # between two places [m]


def places_around(pose: Pose2D, reach: float, step: float = STEP) -> Iterator[Pose2D]:
    """Poses with the same heading on circles around a pose, up to `reach` [m] from it, `step` [m] apart."""
    for ring in range(1, int(reach / step) + 1):
        radius = ring * step
        count = max(math.ceil(math.tau * radius / step), 8)
        for k in range(count):
            angle = math.tau * k / count
            yield Pose2D(pose.x + radius * math.cos(angle), pose.y + radius * math.sin(angle), pose.yaw)
