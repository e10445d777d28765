"""An emulated RPLIDAR: answers requests, and streams samples of a given room.

It knows nothing of time or ports: whoever runs it hands over the bytes that came and the time, and sends what it
returns.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

from rosbot_patrol.drivers.rplidar.frames import FRAME_SIZES
from rosbot_patrol.drivers.rplidar.protocol import SYNC, AnswerType, Command, checksum, descriptor
from rosbot_patrol.simulation.devices.rplidar_frames import SAMPLES, Distances, frame

_SERIAL = bytes(range(16))
_MOST_BEHIND = 0.5  # [s] a stream that nobody reads is not caught up
BOOT_TEXT = b"RP LIDAR System.\r\nFirmware Ver 1.29, HW Ver 7\r\n"


@dataclass(frozen=True)
class DeviceMode:
    """A scan mode: name, type of its answers, microseconds between samples, largest distance [m]."""

    name: str
    answer: AnswerType
    sample_us: float
    max_distance: float


@dataclass(frozen=True, kw_only=True)
class DeviceModel:
    """What a model says of itself.

    Attributes:
        typical: number of its usual mode.
        motor_flags: answer of the accessory board.
        health: 0 good, 1 warning, 2 error.
    """

    model: int
    baud: int
    modes: tuple[DeviceMode, ...]
    firmware: tuple[int, int] = (1, 29)
    typical: int = 1
    motor_flags: int = 1
    health: int = 0


_STANDARD = DeviceMode("Standard", AnswerType.NODES, 500.0, 12.0)
MODELS = {
    "A1": DeviceModel(
        model=0x18, baud=115200, modes=(_STANDARD, DeviceMode("Express", AnswerType.EXPRESS, 250.0, 12.0))
    ),
    "A2": DeviceModel(
        model=0x28, baud=115200, modes=(_STANDARD, DeviceMode("Express", AnswerType.EXPRESS, 125.0, 12.0))
    ),
    "A3": DeviceModel(
        model=0x31, baud=256000, modes=(_STANDARD, DeviceMode("Sensitivity", AnswerType.ULTRA, 62.5, 25.0))
    ),
    "C1": DeviceModel(
        model=0x41,
        baud=460800,
        modes=(_STANDARD, DeviceMode("DenseBoost", AnswerType.DENSE, 200.0, 16.0)),
        motor_flags=0,
    ),
    "S1": DeviceModel(model=0x61, baud=256000, modes=(_STANDARD, DeviceMode("Boost", AnswerType.DENSE, 108.0, 40.0))),
    "S2": DeviceModel(
        model=0x71, baud=1000000, modes=(_STANDARD, DeviceMode("DenseBoost", AnswerType.ULTRA_DENSE, 31.25, 30.0))
    ),
    "HQ": DeviceModel(model=0x31, baud=256000, modes=(_STANDARD, DeviceMode("HQ", AnswerType.HQ, 62.5, 25.0))),
}


@dataclass
class RplidarDevice:
    """One emulated lidar.

    Args:
        kind: what it is.
        distances: of angles [degrees, clockwise]: [mm], 0 for no echo.
        frequency: of its motor [turns/s].

    Attributes:
        requests: all that it was asked, as bytes.
        motor: last speed or duty cycle set, -1 before.
    """

    kind: DeviceModel
    distances: Distances
    frequency: float = 10.0
    requests: list[bytes] = field(default_factory=list)
    motor: int = -1
    _data: bytearray = field(default_factory=bytearray)
    _mode: DeviceMode | None = None
    _angle: float = 0.0
    _due: float = 0.0
    _is_new: bool = False

    def feed(self, data: bytes, now: float) -> bytes:
        """Take bytes that came at a time [s]; returns the answers."""
        self._data += data
        answers = b""
        while (asked := self._request()) is not None:
            self.requests.append(asked)
            answers += self._answer(asked[1], asked[3:-1], now)
        return answers

    def stream(self, now: float) -> bytes:
        """The frames of the scan that are due by a time [s]."""
        if self._mode is None or self.motor == 0:
            self._due = now
            return b""
        self._due = max(self._due, now - _MOST_BEHIND)
        kind, step_s = self._mode.answer, self._mode.sample_us * 1e-6
        step, count = 360.0 * self.frequency * step_s, SAMPLES[self._mode.answer]
        sent = []
        while self._due <= now:
            sent.append(frame(kind, self._angle, step, self.distances, is_new_scan=self._is_new))
            self._is_new = False
            self._angle = (self._angle + step * count) % 360.0
            self._due += step_s * count
        return b"".join(sent)

    @property
    def is_scanning(self) -> bool:
        """Whether it streams."""
        return self._mode is not None

    def _request(self) -> bytes | None:
        """The next whole request; bytes that are none are skipped."""
        while (start := self._data.find(SYNC)) >= 0:
            del self._data[:start]
            if len(self._data) < 2:
                return None
            size = 2
            if self._data[1] & 0x80:
                if len(self._data) < 3:
                    return None
                size = 4 + self._data[2]
            if len(self._data) < size:
                return None
            asked = bytes(self._data[:size])
            if size == 2 or checksum(asked[:-1]) == asked[-1]:
                del self._data[:size]
                return asked
            del self._data[:1]
        self._data.clear()
        return None

    def _answer(self, command: int, payload: bytes, now: float) -> bytes:
        kind = self.kind
        if command in (Command.STOP, Command.RESET):
            self._mode = None
            return BOOT_TEXT if command == Command.RESET else b""
        if command in (Command.SET_MOTOR_PWM, Command.SET_MOTOR_RPM):
            self.motor = int.from_bytes(payload, "little")
        elif command == Command.GET_INFO:
            about = bytes((kind.model, kind.firmware[1], kind.firmware[0], 5)) + _SERIAL
            return descriptor(AnswerType.INFO, 20) + about
        elif command == Command.GET_HEALTH:
            return descriptor(AnswerType.HEALTH, 3) + struct.pack("<BH", kind.health, 0)
        elif command == Command.GET_SAMPLE_TIMES:
            times = (round(kind.modes[each].sample_us) for each in (0, 1))
            return descriptor(AnswerType.SAMPLE_TIMES, 4) + struct.pack("<HH", *times)
        elif command == Command.GET_MOTOR_FLAGS:
            return descriptor(AnswerType.MOTOR_FLAGS, 4) + struct.pack("<I", kind.motor_flags)
        elif command == Command.GET_CONF:
            return self._conf(payload)
        elif command == Command.SCAN:
            return self._begin(kind.modes[0], now)
        elif command == Command.EXPRESS_SCAN:
            return self._begin(kind.modes[payload[0] if kind.firmware >= (1, 24) else 1], now)
        return b""

    def _begin(self, mode: DeviceMode, now: float) -> bytes:
        self._mode, self._angle, self._due, self._is_new = mode, 0.0, now, True
        return descriptor(mode.answer, FRAME_SIZES[mode.answer], is_stream=True)

    def _conf(self, payload: bytes) -> bytes:
        setting = int.from_bytes(payload[:4], "little")
        number = int.from_bytes(payload[4:6], "little")
        mode = self.kind.modes[number] if number < len(self.kind.modes) else self.kind.modes[0]
        value = {
            0x70: struct.pack("<H", len(self.kind.modes)),
            0x71: struct.pack("<I", round(mode.sample_us * 256)),
            0x74: struct.pack("<I", round(mode.max_distance * 256)),
            0x75: bytes((mode.answer,)),
            0x7C: struct.pack("<H", self.kind.typical),
            0x7F: mode.name.encode() + b"\0",
            0x01: struct.pack("<HH", 600, 660),
        }.get(setting, b"")
        return descriptor(AnswerType.CONF, 4 + len(value)) + struct.pack("<I", setting) + value
