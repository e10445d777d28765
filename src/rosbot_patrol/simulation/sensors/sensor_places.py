"""Reader of the file with the motion sensors' places; `sensors.sensor_file` reads it too, for their names."""

from __future__ import annotations

import dataclasses
import math

from rosbot_patrol import params
from rosbot_patrol.errors import ParamError
from rosbot_patrol.simulation.sensors.motion_sensors import SensorPlace
from rosbot_patrol.yaml_files import read_mapping

_OF_THE_WATCH = ("name", "enabled", "heartbeat", "peers")  # keys of rosbot_patrol.sensors.sensor_file


def read_sensors(file: str) -> list[SensorPlace]:
    """Read the motion sensors of a file; an empty name means none.

    Raises:
        ParamError: the file cannot be read, or a key is wrong; the text names file and key.
    """
    if not file:
        return []
    tree = read_mapping(file, keys="angle_unit and sensors")
    listed = tree.get("sensors")
    if not isinstance(listed, list):
        raise ParamError(f"{file}: sensors", f"expected a list of sensors, got {listed!r}")
    unit = tree.get("angle_unit", "rad")
    if unit not in ("rad", "deg"):
        raise ParamError(f"{file}: angle_unit", f"is {unit!r}, expected rad or deg")
    places = [
        params.load(SensorPlace, item, name=f"{file}: sensors[{i}]/", ignore=_OF_THE_WATCH)
        for i, item in enumerate(listed)
    ]
    twice = [p.id for i, p in enumerate(places) if p.id in {q.id for q in places[:i]}]
    if twice:
        raise ParamError(f"{file}: sensors", f"the id {twice[0]} is used twice")
    if unit == "deg":
        places = [dataclasses.replace(p, yaw=math.radians(p.yaw)) for p in places]
    return places
