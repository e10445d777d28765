"""A room comes back from the bytes of every mode, through the emulated device and the driver."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from rosbot_patrol.drivers.rplidar.device_info import Health
from rosbot_patrol.drivers.rplidar.lidar import Lidar, samples_of_a_turn
from rosbot_patrol.drivers.rplidar.turns import Turn
from rosbot_patrol.errors import DeviceError, ProtocolError
from rosbot_patrol.simulation.devices.rplidar import MODELS, DeviceModel, RplidarDevice


def room(angle: np.ndarray) -> np.ndarray:
    """Distances [mm] in a room of 4 x 3 m, by angle [degrees]."""
    radians = np.radians(angle)
    with np.errstate(divide="ignore"):
        return np.minimum(2000 / np.abs(np.cos(radians)), 1500 / np.abs(np.sin(radians)))


@dataclass
class Wire:
    """An emulated lidar on a wire, in a time of its own."""

    device: RplidarDevice
    now: float = 0.0
    waiting: bytes = b""
    dtr: list[bool] = field(default_factory=list)
    is_cut: bool = False

    def send(self, data: bytes) -> None:
        self.waiting += self.device.feed(data, self.now)

    def read(self, timeout: float) -> bytes:
        if self.is_cut:
            raise OSError("gone")
        if not self.waiting:
            self.now += min(timeout, 0.002)
            self.waiting = self.device.stream(self.now)
        data, self.waiting = self.waiting, b""
        return data

    def set_dtr(self, on: bool) -> None:
        self.dtr.append(on)

    def close(self) -> None:
        self.is_cut = True

    def clock(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def made(kind: DeviceModel, distances: object = room) -> tuple[Lidar, Wire]:
    wire = Wire(RplidarDevice(kind, distances))
    return Lidar(wire, clock=wire.clock, sleep=wire.sleep), wire


def turns_of(lidar: Lidar, count: int) -> list[Turn]:
    found: list[Turn] = []
    for _ in range(20000):
        found += lidar.read_turns(0.01)
        if len(found) >= count:
            return found
    raise AssertionError(f"{len(found)} turns only")


@pytest.mark.parametrize("is_typical", [False, True])
@pytest.mark.parametrize("name", MODELS)
def test_the_room_comes_back(name: str, is_typical: bool) -> None:
    lidar, _ = made(MODELS[name])
    lidar.connect()
    assert lidar.health() == (Health.GOOD, 0)
    modes, typical = lidar.modes()
    mode = modes[typical if is_typical else 0]
    lidar.set_motor(600)
    lidar.start_scan(mode)
    limit = 5.5 if "ULTRA" in mode.answer.name else 2.0
    for turn in turns_of(lidar, 5):
        assert abs(len(turn) - samples_of_a_turn(mode, 10.0)) <= 3
        off = np.abs(turn.distance * 1000.0 - room(np.degrees(turn.angle)))
        assert off.max() < limit + 0.004 * turn.distance.max() * 1000.0 * 0.5, mode
        assert np.median(off) < limit
        assert (np.diff(np.unwrap(turn.angle)) > -math.radians(5.0)).all()
    assert lidar.spoilt == (0, 0)


def test_without_conf_an_old_lidar_has_two_modes() -> None:
    lidar, wire = made(replace(MODELS["A1"], firmware=(1, 20)))
    lidar.connect()
    modes, typical = lidar.modes()
    assert [(mode.name, round(mode.sample_time * 1e6)) for mode in modes] == [("Standard", 500), ("Express", 250)]
    lidar.start_scan(modes[typical])
    assert wire.device.requests[-1].hex(" ") == "a5 82 05 00 00 00 00 00 22"
    assert len(turns_of(lidar, 2)[1]) == pytest.approx(400, abs=2)


def test_the_motor_of_each_series() -> None:
    for name, expected in {"A1": None, "A2": "a5 f0 02 94 02 c1", "C1": None, "S2": "a5 a8 02 58 02 55"}.items():
        lidar, wire = made(MODELS[name])
        lidar.connect()
        before = len(wire.device.requests)
        lidar.set_motor(600)
        asked = [each.hex(" ") for each in wire.device.requests[before:]]
        assert asked == ([expected] if expected else [])
        lidar.set_motor(0)
        assert wire.dtr == ([False, False, True] if name == "A1" else [False])


def test_one_that_still_streams_is_stopped_first() -> None:
    lidar, wire = made(MODELS["A2"])
    lidar.connect()
    lidar.start_scan(lidar.modes()[0][1])
    again = Lidar(wire, clock=wire.clock, sleep=wire.sleep)
    assert again.connect().name == "A2M8"
    assert not wire.device.is_scanning


def test_silence_is_an_error_that_names_the_question() -> None:
    lidar, wire = made(MODELS["A2"])
    wire.device.feed = lambda data, now: b""
    with pytest.raises(DeviceError, match=r"no answer to GET_INFO within 0.5 s"):
        lidar.connect()


def test_a_mode_of_an_unknown_type_is_refused() -> None:
    lidar, wire = made(MODELS["A2"])
    lidar.connect()
    wire.device._conf = lambda payload: b"\xa5\x5a\x05\0\0\0\x20" + payload[:4] + b"\x99"
    with pytest.raises(ProtocolError, match="setting 0x70 is"):
        lidar.modes()
