"""An emulated base of a ROSbot: the firmware's side of rosserial, with its topics, its service and its watchdog.

It knows nothing of time or ports: whoever runs it hands over the bytes that came and the time, and sends what it
returns.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from rosbot_patrol.rosserial.device.client_session import DeviceSession, Message
from rosbot_patrol.rosserial.protocol.topics import FIRST_USER_ID, TopicInfo
from rosbot_patrol.simulation.devices import rosbot_messages as messages

_WATCHDOG = 1.0  # [s] after the last command it stops
_RANGES = ("range/fr", "range/fl", "range/rr", "range/rl")
_PERIODS = {"pose": 0.05, "velocity": 0.05, "imu": 0.1, "mpu9250": 0.1, "battery": 0.4, "range": 0.1}  # [s]
_INFO = 1  # level of a line for the log
_SUCCESS, _FAILURE, _COMMAND_NOT_FOUND = 0, 1, 2
# of the service config
_COMMANDS = {"SLED", "EIMU", "EDSE", "EJSM", "RODOM", "EWCH", "RIMU", "SANI"}
_COMMANDS |= {"ETFM", "CALI", "EMOT", "CSER", "CPID", "GPID", "SKIN", "GKIN"}


class Drive(Protocol):
    """What moves: wheels in a simulated house, or `FreeDrive`."""

    def command(self, linear: float, turning: float) -> None:
        """Set the speeds [m/s, rad/s]."""

    def pose(self, now: float) -> tuple[float, float, float]:
        """Odometry x, y [m] and yaw [rad] at a time [s]."""

    def speeds(self) -> tuple[float, float]:
        """Speeds at present [m/s, rad/s]."""

    def heading(self) -> tuple[float, float]:
        """Yaw [rad] and turning rate [rad/s] by the IMU."""


@dataclass
class FreeDrive:
    """Wheels on an endless floor that do at once what they are told."""

    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wish: tuple[float, float] = (0.0, 0.0)
    _stamp: float | None = None

    def command(self, linear: float, turning: float) -> None:
        """Set the speeds [m/s, rad/s]."""
        self.wish = linear, turning

    def pose(self, now: float) -> tuple[float, float, float]:
        """Where the robot has come by a time [s]."""
        seconds = 0.0 if self._stamp is None else now - self._stamp
        self._stamp = now
        x, y, yaw = self.at
        middle = yaw + self.wish[1] * seconds / 2.0
        way = self.wish[0] * seconds
        self.at = x + way * math.cos(middle), y + way * math.sin(middle), yaw + self.wish[1] * seconds
        return self.at

    def speeds(self) -> tuple[float, float]:
        """The speeds that were set [m/s, rad/s]."""
        return self.wish

    def heading(self) -> tuple[float, float]:
        """Yaw [rad] and turning rate [rad/s]."""
        return self.at[2], self.wish[1]


@dataclass(frozen=True, kw_only=True)
class Firmware:
    """A generation of the firmware.

    Attributes:
        baud: speed of its serial line.
        imu: topic of its IMU.
        names_frames: whether ranges name their frames.
    """

    version: str
    baud: int
    imu: str
    names_frames: bool


FIRMWARES = {
    "0.16.2": Firmware(version="0.16.2", baud=525000, imu="imu", names_frames=True),
    "0.13.1": Firmware(version="0.13.1", baud=500000, imu="mpu9250", names_frames=False),
}


@dataclass
class RosbotBase:
    """One emulated base.

    Args:
        firmware: its generation.
        drive: what it moves.

    Attributes:
        voltage: of the battery [V].
        ranges: what the four range sensors measure [m]; -1 for a broken one.
        orders: commands of the service config so far, with their data.
        is_mute: it sends nothing, as with a cable that is pulled.
    """

    firmware: Firmware
    drive: Drive = field(default_factory=FreeDrive)
    voltage: float = 12.2
    ranges: Mapping[str, float] = field(default_factory=lambda: dict.fromkeys(_RANGES, 0.9))
    orders: list[tuple[str, str]] = field(default_factory=list)
    is_mute: bool = False

    def __post_init__(self) -> None:
        names = ["pose", "velocity", self.firmware.imu, "battery", *_RANGES]
        kinds = {name: name.partition("/")[0] for name in names}
        first = FIRST_USER_ID + 25
        self._publishers = {name: messages.topic(first + at, name, kinds[name]) for at, name in enumerate(names)}
        self._commands = messages.topic(FIRST_USER_ID, "cmd_vel")
        kind, request, response = messages.CONFIG
        self._asked = TopicInfo(topic_id=FIRST_USER_ID + 1, name="config", message_type=kind, md5=request)
        self._answers = TopicInfo(topic_id=first + len(names), name="config", message_type=kind, md5=response)
        self._session = DeviceSession(
            list(self._publishers.values()), [self._commands], services=[(self._asked, self._answers)]
        )
        self._due = dict.fromkeys(self._publishers, 0.0)
        self._commanded = -math.inf
        self._was_configured = False

    def feed(self, data: bytes, now: float) -> bytes:
        """Take bytes that came at a time [s]; returns the answers."""
        for event in self._session.receive(data, now):
            if isinstance(event, Message):
                self._obey(event, now)
        return self._take()

    def stream(self, now: float) -> bytes:
        """What is due by a time [s]."""
        self._session.tick(now)
        if now - self._commanded > _WATCHDOG:
            self.drive.command(0.0, 0.0)
        if self._session.configured and not self._was_configured:
            self._session.log(_INFO, f"ROSbot firmware {self.firmware.version}, an emulated one")
        self._was_configured = self._session.configured
        stamp = self._session.server_time(now)
        if stamp is not None:
            for name in self._publishers:
                self._publish(name, now, stamp)
        return self._take()

    def _publish(self, name: str, now: float, stamp: float) -> None:
        if now < self._due[name]:
            return
        kind = name.partition("/")[0]
        self._due[name] = max(self._due[name] + _PERIODS[kind], now)
        self._session.publish(self._publishers[name].topic_id, self._message(name, now, stamp))

    def _message(self, name: str, now: float, stamp: float) -> bytes:
        x, y, yaw = self.drive.pose(now)
        linear, turning = self.drive.speeds()
        if name == "pose":
            return messages.pose(x, y, yaw, stamp)
        if name == "velocity":  # in the frame odom, as the firmware has it
            return messages.twist((linear * math.cos(yaw), linear * math.sin(yaw)), turning)
        if name == "imu":
            return messages.imu(*self.drive.heading(), stamp)
        if name == "mpu9250":
            return messages.old_imu(*self.drive.heading(), stamp)
        if name == "battery":
            return messages.battery(self.voltage)
        frame = name.replace("/", "_") if self.firmware.names_frames else ""
        return messages.distance(frame, self.ranges[name], stamp)

    def _obey(self, message: Message, now: float) -> None:
        if message.topic_id == self._commands.topic_id:
            self.drive.pose(now)  # with the old command until now
            self.drive.command(*messages.read_twist(message.data))
            self._commanded = now
        elif message.topic_id == self._asked.topic_id:
            command, data = messages.read_config(message.data)
            self.orders.append((command, data))
            result = _SUCCESS if command in _COMMANDS else _COMMAND_NOT_FOUND
            result = _FAILURE if command == "EDSE" else result
            self._session.publish(self._answers.topic_id, messages.config_answer("", result))

    def _take(self) -> bytes:
        frames = b"".join(self._session.take_output())
        return b"" if self.is_mute else frames
