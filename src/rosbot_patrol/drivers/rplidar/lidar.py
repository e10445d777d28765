"""An RPLIDAR behind a channel: asked, started, read, stopped. Each call blocks for the time that it says.

The requests follow the order of the maker's SDK: stop a scan that still runs, ask for information, health and modes,
start the motor, start the scan.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable
from typing import Protocol

from rosbot_patrol.drivers.rplidar.device_info import (
    DeviceInfo,
    Health,
    Motor,
    ScanMode,
    modes_without_conf,
    read_health,
    read_sample_times,
)
from rosbot_patrol.drivers.rplidar.frames import FRAME_SIZES, FrameFinder
from rosbot_patrol.drivers.rplidar.protocol import AnswerReader, AnswerType, Command, request
from rosbot_patrol.drivers.rplidar.samples import Decoder
from rosbot_patrol.drivers.rplidar.turns import Turn, Turns
from rosbot_patrol.errors import DeviceError, ProtocolError

ANSWER_WITHIN = 2.0  # [s]
_INFO_WITHIN = 0.5  # [s] for the first question
_TRIES = 3
_DRAIN = 0.1  # [s] after STOP a scan may still be in the pipe
_MOTOR_PAUSE = 0.01  # [s]
_RESET_WITHIN = 15.0  # [s]
PWM = 660  # duty cycle of about 10 turns a second
_TYPICAL_WITHOUT_CONF = 1

_COUNT, _SAMPLE_TIME, _MAX_DISTANCE, _ANSWER, _TYPICAL, _NAME = 0x70, 0x71, 0x74, 0x75, 0x7C, 0x7F


class Channel(Protocol):
    """The way to a lidar."""

    def send(self, data: bytes) -> None:
        """Send all bytes; raises OSError."""

    def read(self, timeout: float) -> bytes:
        """Bytes that have come, b"" if none come within the time [s]; raises OSError when the device has gone."""

    def set_dtr(self, on: bool) -> None:
        """Set the line DTR, where there is one."""

    def close(self) -> None:
        """Close it."""


class Lidar:
    """One lidar.

    Args:
        channel: to it.
        clock: steady time [s].
        sleep: waits [s].

    Attributes:
        heard: bytes that came in answer to the last question, at most 4096, to explain a failure.
    """

    def __init__(
        self,
        channel: Channel,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._channel = channel
        self._clock = clock
        self._sleep = sleep
        self._reader = AnswerReader()
        self._finder: FrameFinder | None = None
        self._decoder: Decoder | None = None
        self._turns = Turns()
        self._motor = Motor.OWN
        self.info: DeviceInfo | None = None
        self.heard = b""

    def connect(self, tries: int = _TRIES) -> DeviceInfo:
        """Stop what still runs and ask who is there. Raises DeviceError if nothing answers in any of the tries."""
        self._channel.set_dtr(False)
        for left in reversed(range(tries)):
            self.stop_scan()
            try:
                self.info = DeviceInfo.from_bytes(self.ask(Command.GET_INFO, AnswerType.INFO, within=_INFO_WITHIN))
                break
            except DeviceError:
                if not left:
                    raise
        assert self.info is not None
        flags = 0
        if self.info.asks_for_motor_flags:
            flags = int.from_bytes(self.ask(Command.GET_MOTOR_FLAGS, AnswerType.MOTOR_FLAGS, bytes(4))[:4], "little")
        self._motor = self.info.motor(flags)
        return self.info

    def reset(self) -> None:
        """Let it start anew. Raises DeviceError if it does not come back."""
        self._channel.send(request(Command.RESET))
        until = self._clock() + _RESET_WITHIN
        while True:
            self._sleep(_INFO_WITHIN)
            try:
                self.ask(Command.GET_INFO, AnswerType.INFO, within=_INFO_WITHIN)
            except DeviceError:
                if self._clock() > until:
                    raise
            else:
                return

    def health(self) -> tuple[Health, int]:
        """Its health and error code. Raises DeviceError, ProtocolError."""
        return read_health(self.ask(Command.GET_HEALTH, AnswerType.HEALTH))

    def modes(self) -> tuple[list[ScanMode], int]:
        """Its modes, and the number of the typical one. Raises DeviceError, ProtocolError."""
        assert self.info is not None
        if not self.info.has_conf:
            times = read_sample_times(self.ask(Command.GET_SAMPLE_TIMES, AnswerType.SAMPLE_TIMES))
            return modes_without_conf(*times), _TYPICAL_WITHOUT_CONF
        count = int.from_bytes(self._conf(_COUNT, size=2), "little")
        return [self._mode(each) for each in range(count)], int.from_bytes(self._conf(_TYPICAL, size=2), "little")

    def set_motor(self, speed: int) -> None:
        """Turn the motor: turns per minute for lidars that count them, else on; 0: off."""
        if self._motor is Motor.DTR:
            self._channel.set_dtr(speed == 0)
        elif self._motor is Motor.PWM:
            self._channel.send(request(Command.SET_MOTOR_PWM, struct.pack("<H", PWM if speed else 0)))
        elif self._motor is Motor.RPM:
            self._channel.send(request(Command.SET_MOTOR_RPM, struct.pack("<H", speed)))
        self._sleep(_MOTOR_PAUSE)

    def start_scan(self, mode: ScanMode) -> None:
        """Start a scan. Raises DeviceError if it is refused, ProtocolError if it comes in a form that is not known."""
        self._reader.reset()
        if mode.answer is AnswerType.NODES:
            self._channel.send(request(Command.SCAN))
        else:
            assert self.info is not None
            number = mode.id if self.info.has_conf else 0
            self._channel.send(request(Command.EXPRESS_SCAN, struct.pack("<BHH", number, 0, 0)))
        kind, begin = self._wait_for(lambda kind, is_stream: is_stream, ANSWER_WITHIN, f"the scan mode {mode.name}")
        if kind not in FRAME_SIZES:
            raise ProtocolError("", f"the scan comes as type 0x{kind:02X}, which this driver does not know")
        self._finder, self._decoder = FrameFinder(AnswerType(kind)), Decoder(AnswerType(kind), mode.sample_time)
        self._turns = Turns()
        self._decode(begin)

    def read_turns(self, timeout: float) -> list[Turn]:
        """The turns that the next bytes complete; waits for bytes [s]. Raises OSError when the device has gone."""
        return self._decode(self._channel.read(timeout))

    def stop_scan(self) -> None:
        """End the scan and throw away what is still on its way."""
        self._finder = self._decoder = None
        self._channel.send(request(Command.STOP))
        self._sleep(_DRAIN)
        until = self._clock() + _DRAIN
        while self._channel.read(0.0) and self._clock() < until:
            pass
        self._reader.reset()

    def close(self) -> None:
        """Close the channel."""
        self._channel.close()

    @property
    def spoilt(self) -> tuple[int, int]:
        """Frames with a wrong checksum, and bytes that belonged to none, since the scan began."""
        return (0, 0) if self._finder is None else (self._finder.spoilt, self._finder.skipped)

    def ask(
        self, command: Command, answer: AnswerType, payload: bytes = b"", *, within: float = ANSWER_WITHIN
    ) -> bytes:
        """Ask, and wait for an answer of a type. Raises DeviceError if none comes within the time [s]."""
        self._reader.reset()
        self._channel.send(request(command, payload))
        return self._wait_for(lambda kind, is_stream: kind == answer and not is_stream, within, command.name)[1]

    def _wait_for(self, is_it: Callable[[int, bool], bool], within: float, what: str) -> tuple[int, bytes]:
        until = self._clock() + within
        self.heard = b""
        while (left := until - self._clock()) > 0.0:
            data = self._channel.read(left)
            self.heard = (self.heard + data)[-4096:]
            for answer in self._reader.feed(data):
                if is_it(answer.type, answer.is_stream):
                    return answer.type, answer.payload
                if answer.is_stream:  # of an old scan: the reader would take all that follows for it
                    self._reader.reset()
        raise DeviceError("the lidar", f"no answer to {what} within {within:g} s")

    def _mode(self, number: int) -> ScanMode:
        def value(kind: int, size: int) -> int:
            return int.from_bytes(self._conf(kind, number, size=size)[:size], "little")

        name = self._conf(_NAME, number, size=1).split(b"\0")[0].decode("ascii", "replace")
        kind = value(_ANSWER, 1)
        if kind not in FRAME_SIZES:
            raise ProtocolError("", f"the scan mode {name} sends answers of type 0x{kind:02X}, unknown to this driver")
        sample_time = value(_SAMPLE_TIME, 4) / 256.0 * 1e-6
        return ScanMode(number, name, AnswerType(kind), sample_time, value(_MAX_DISTANCE, 4) / 256.0)

    def _conf(self, kind: int, mode: int | None = None, *, size: int) -> bytes:
        payload = struct.pack("<I", kind) + (b"" if mode is None else struct.pack("<H", mode))
        answer = self.ask(Command.GET_CONF, AnswerType.CONF, payload)
        if int.from_bytes(answer[:4], "little") != kind or len(answer) < 4 + size:
            raise ProtocolError("", f"the lidar's answer about its setting 0x{kind:02X} is {answer.hex(' ')}")
        return answer[4:]

    def _decode(self, data: bytes) -> list[Turn]:
        done: list[Turn] = []
        if self._finder is None or self._decoder is None:
            return done
        for frame in self._finder.feed(data):
            samples = self._decoder.feed(frame)
            if samples is not None:
                done += self._turns.feed(samples)
        return done


def samples_of_a_turn(mode: ScanMode, frequency: float) -> int:
    """Samples that a mode takes in a turn, at so many turns a second."""
    return math.floor(1.0 / mode.sample_time / frequency)
