"""The sensors file: which sensor id hangs in which room, and what is expected of it.

    sensors:
      - {id: 3, room: 5, name: hall door, peers: [192.168.1.23]}

A file with the positions of simulated sensors is also such a file. Its keys port, x, y, z, yaw and angle_unit are for
the simulator and are ignored here; the simulator ignores name, heartbeat, peers and enabled. So one file can serve both
and cannot contradict itself; `check_places` compares two files.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbot_patrol import params
from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import param
from rosbot_patrol.rosserial.server.policy import parse_networks
from rosbot_patrol.yaml_files import read_mapping

PLACE_KEYS = frozenset({"port", "x", "y", "z", "yaw"})  # the simulator's


def _bad_name(value: str) -> str | None:
    return None if value.isprintable() else f"is {value!r}, expected one line without control characters"


@dataclass(frozen=True, kw_only=True)
class SensorSpec:
    """One motion sensor: the keys of an entry in the file."""

    id: int = param(lo=0, hi=255, doc="id that it reports in /motion_trigger")
    room: int = param(lo=0, hi=255, doc="number of the room that it watches, as in the points file")
    name: str = param("", check=_bad_name, doc="name in messages; empty: the room's name")
    enabled: bool = param(True, doc="false: out of service: neither supervised nor answered")
    heartbeat: float = param(
        0.5,
        unit="s",
        lo=0.0,
        hi=3600.0,
        doc="longest time between its reports; 0: it reports motion only, and its silence means nothing",
    )
    peers: tuple[str, ...] = param((), doc="addresses and networks that it may connect from; empty: any")

    def may_speak_from(self, host: str) -> bool:
        """Whether an address is one of `peers`; a serial device, which has no address, always is."""
        try:
            address = ipaddress.ip_address(host.partition("%")[0])
        except ValueError:
            return True
        return not self.peers or any(address in network for network in parse_networks(self.peers, "peers"))


class SensorList:
    """The sensors of a file, or those that the tutorial implies: a sensor's id is the number of its room.

    Args:
        specs: of the file; None: no file.
        room_names: name of each room by number.
        source: the file, for messages.
    """

    def __init__(
        self, specs: Iterable[SensorSpec] | None, room_names: Mapping[int, str], source: str = "the sensor file"
    ) -> None:
        self.has_file = specs is not None
        self.source = source
        self._specs = {spec.id: spec for spec in specs or ()}
        self._room_names = dict(room_names)

    def __iter__(self) -> Iterator[SensorSpec]:
        return iter(self._specs.values())

    def __len__(self) -> int:
        return len(self._specs)

    def find(self, sensor_id: int) -> SensorSpec | None:
        """Entry of an id; None if unknown."""
        if self.has_file or sensor_id not in self._room_names:
            return self._specs.get(sensor_id)
        return SensorSpec(id=sensor_id, room=sensor_id)

    def room_of(self, sensor_id: int) -> int | None:
        """Number of the room that a sensor watches; None if it is unknown or out of service."""
        spec = self.find(sensor_id)
        return spec.room if spec is not None and spec.enabled else None

    def refusal(self, sensor_id: int) -> str:
        """Reason in one sentence why `room_of` returns None."""
        if not self.has_file:
            return f"there is no room {sensor_id}, and no file of sensors that gives this id another"
        if sensor_id in self._specs:
            return f"{self.source} has it as enabled: false"
        return f"{self.source} has no sensor with id {sensor_id}"

    def room_name(self, room: int) -> str:
        """Name of a room, "" if unknown."""
        return self._room_names.get(room, "")

    def title(self, sensor_id: int) -> str:
        """Name of a sensor for people, such as `sensor 3 "hall door" in room 5 (corridor hall)`."""
        spec = self.find(sensor_id)
        if spec is None:
            return f"sensor {sensor_id}"
        name = f' "{spec.name}"' if spec.name else ""
        return f"sensor {sensor_id}{name} in room {spec.room} ({self.room_name(spec.room)})"

    def check_places(self, places: Iterable[tuple[int, int]], source: str) -> None:
        """Compare the file with another one that gives (id, room).

        Raises:
            ParamError: an id watches another room there.
        """
        for sensor_id, room in places:
            spec = self._specs.get(sensor_id)
            if spec is not None and spec.room != room:
                raise ParamError(
                    f"{self.source}: sensors",
                    f"sensor {sensor_id} watches room {spec.room}, and room {room} in {source}: one of them is wrong",
                )


def load_sensors(path: str | Path, room_names: Mapping[int, str], *, rooms_source: str) -> SensorList:
    """Read the sensors file.

    Args:
        path: of the file; "" or "none" (roslaunch takes no empty argument) for none: ids are numbers of rooms.
        room_names: name of each room by number, from the points file `rooms_source`.
        rooms_source: for messages.

    Raises:
        ParamError: it cannot be read or is wrong; names file and key.
    """
    if str(path) in ("", "none"):
        return SensorList(None, room_names)
    path = Path(path).expanduser()
    tree = read_mapping(path, keys="sensors")
    for key in tree:
        if key not in ("sensors", "angle_unit"):
            raise ParamError(f"{path}: {key}", params.unknown_name(str(key), ["sensors", "angle_unit"]))
    listed = tree.get("sensors")
    if not isinstance(listed, list) or not listed:
        raise ParamError(f"{path}: sensors", f"expected a list of sensors, got {listed!r}")
    specs = [_spec(item, f"{path}: sensors[{i}]/") for i, item in enumerate(listed)]
    for i, spec in enumerate(specs):
        before = [j for j in range(i) if specs[j].id == spec.id]
        if before:
            raise ParamError(f"{path}: sensors[{i}]/id", f"is {spec.id}, which sensors[{before[0]}] has already")
        if spec.room not in room_names:
            known = f"{rooms_source} has the rooms {', '.join(map(str, sorted(room_names)))}"
            raise ParamError(f"{path}: sensors[{i}]/room", f"there is no room {spec.room}: {known}")
    return SensorList(specs, room_names, str(path))


def _spec(item: Any, name: str) -> SensorSpec:
    if isinstance(item, Mapping):
        item = {key: value for key, value in item.items() if key not in PLACE_KEYS}
    spec = params.load_strict(SensorSpec, item, name=name)
    parse_networks(spec.peers, name + "peers")
    return spec
