"""Motion sensors for a house that has none: one on a wall of each room, with a long view of it."""

from __future__ import annotations

import math

import numpy as np

from rosbot_patrol.campaign.floor import Floor
from rosbot_patrol.simulation.sensors.motion_sensors import SensorPlace

HEIGHT = 1.6  # of a sensor [m]
REACH = 6.0  # of an HC-SR501, with some margin [m]

_PORTS = (11411, 11412, 11413)
_BEAMS = 72
_OFF = 0.05  # from the wall [m]


def hang_sensors(floor: Floor) -> list[SensorPlace]:
    """Hang a sensor into each room of a floor but the base: opposite the room's point, where the view is longest."""
    cut = floor.ways.cut(HEIGHT)
    found = []
    for number, room in enumerate(room for room in floor.rooms if room.id != floor.rooms.base.id):
        x, y = room.pose.x, room.pose.y
        ranges = np.minimum(cut.cast(x, y, -math.pi, math.tau / _BEAMS, _BEAMS, longest=9.0), REACH) - _OFF
        angles = -math.pi + np.arange(_BEAMS) * math.tau / _BEAMS
        ends = np.column_stack((x + ranges * np.cos(angles), y + ranges * np.sin(angles)))
        inside = np.array([floor.room_at(*(end + ((x, y) - end) * 0.1)) == room.id for end in ends])
        k = int(np.where(inside, ranges, -1.0).argmax())
        found.append(
            SensorPlace(
                id=room.id,
                room=room.id,
                port=_PORTS[number % len(_PORTS)],
                x=float(ends[k, 0]),
                y=float(ends[k, 1]),
                z=HEIGHT,
                yaw=float(math.remainder(angles[k] + math.pi, math.tau)),
            )
        )
    return found
