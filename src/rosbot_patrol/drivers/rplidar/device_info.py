"""What a lidar says of itself: model, health, and the modes of its scan."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum

from rosbot_patrol.drivers.rplidar.protocol import AnswerType
from rosbot_patrol.errors import ProtocolError

_MODELS = {
    0x18: "A1M8",
    0x28: "A2M8",
    0x2C: "A2M12",
    0x31: "A3M1",
    0x41: "C1M1",
    0x61: "S1M1",
    0x71: "S2M1",
    0x81: "S3M1",
    0x82: "S3M1",
}
_CONF_SINCE = (1, 24)  # firmware; and every model from 0x40 on


class Motor(Enum):
    """How the speed of the motor is set."""

    DTR = "the line DTR: on or off"
    PWM = "a duty cycle"
    RPM = "turns per minute"
    OWN = "by itself"


class Health(IntEnum):
    """A lidar's own judgement."""

    GOOD = 0
    WARNING = 1
    ERROR = 2


@dataclass(frozen=True)
class DeviceInfo:
    """Answer to GET_INFO.

    Attributes:
        firmware: major and minor version.
        serial_number: 32 hexadecimal digits.
    """

    model: int
    firmware: tuple[int, int]
    hardware: int
    serial_number: str

    @classmethod
    def from_bytes(cls, payload: bytes) -> DeviceInfo:
        """Read 20 bytes. Raises ProtocolError if there are fewer."""
        _require(payload, 20, "its description")
        return cls(payload[0], (payload[2], payload[1]), payload[3], payload[4:20].hex().upper())

    @property
    def name(self) -> str:
        """Name of the model."""
        return _MODELS.get(self.model, f"model 0x{self.model:02X}")

    @property
    def has_conf(self) -> bool:
        """Whether it tells its modes."""
        return self.model >> 4 >= 4 or self.firmware >= _CONF_SINCE

    @property
    def asks_for_motor_flags(self) -> bool:
        """Whether only its accessory board knows if the motor has a duty cycle."""
        return 2 <= self.model >> 4 <= 5

    def motor(self, flags: int = 0) -> Motor:
        """How its motor is driven, by the flags of the accessory board if it has one."""
        series = self.model >> 4
        if series < 2:
            return Motor.DTR
        if series >= 6:
            return Motor.RPM
        return Motor.PWM if flags & 1 else Motor.OWN


@dataclass(frozen=True)
class ScanMode:
    """A mode of the scan.

    Attributes:
        sample_time: between two samples [s].
        max_distance: [m].
    """

    id: int
    name: str
    answer: AnswerType
    sample_time: float
    max_distance: float


def modes_without_conf(standard: float, express: float) -> list[ScanMode]:
    """The modes of a lidar that does not tell them, by its two times between samples [s]."""
    return [
        ScanMode(0, "Standard", AnswerType.NODES, standard, 16.0),
        ScanMode(1, "Express", AnswerType.EXPRESS, express, 16.0),
    ]


def read_health(payload: bytes) -> tuple[Health, int]:
    """Health and error code. Raises ProtocolError for an answer that is none."""
    _require(payload, 3, "its health")
    if payload[0] > Health.ERROR:
        raise ProtocolError("", f"the lidar's health is {payload[0]}, expected 0 to 2")
    return Health(payload[0]), int.from_bytes(payload[1:3], "little")


def read_sample_times(payload: bytes) -> tuple[float, float]:
    """Times between two samples of the standard and the express scan [s]."""
    _require(payload, 4, "its times between samples")
    standard, express = (int.from_bytes(payload[at : at + 2], "little") * 1e-6 for at in (0, 2))
    return standard, express


def _require(payload: bytes, size: int, what: str) -> None:
    if len(payload) < size:
        raise ProtocolError("", f"the lidar's answer about {what} has {len(payload)} bytes, expected {size}")
