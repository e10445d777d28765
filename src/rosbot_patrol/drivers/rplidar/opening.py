"""Open the way to a lidar, and say why nobody answers there."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from rosbot_patrol.drivers.channels import BAUDS, SerialChannel, TcpChannel, UdpChannel
from rosbot_patrol.drivers.rplidar.frames import FRAME_SIZES, FrameFinder
from rosbot_patrol.drivers.rplidar.lidar import Channel, Lidar
from rosbot_patrol.drivers.rplidar.protocol import AnswerType
from rosbot_patrol.errors import DeviceError
from rosbot_patrol.params import param
from rosbot_patrol.rosserial.server.serial_port import why_closed

_FEW = 3  # frames that show a running scan


@dataclass(frozen=True, kw_only=True)
class ChannelParams:
    """The way to the lidar."""

    channel_type: str = param("serial", choices=("serial", "tcp", "udp"), doc="way to the lidar")
    serial_port: str = param("/dev/ttyUSB0", doc="serial device")
    serial_baudrate: int = param(
        115200, lo=1, doc="A1, A2M8: 115200; A2M7, A2M12, A3, S1: 256000; C1: 460800; S2, S3: 1000000"
    )
    tcp_ip: str = param("192.168.0.7", doc="address of a lidar behind TCP")
    tcp_port: int = param(20108, lo=1, hi=65535, doc="its port", reads_text=True)
    udp_ip: str = param("192.168.11.2", doc="address of a lidar behind UDP")
    udp_port: int = param(8089, lo=1, hi=65535, doc="its port", reads_text=True)

    @property
    def where(self) -> str:
        """The place, for messages."""
        return {
            "serial": f"{self.serial_port} at {self.serial_baudrate} baud",
            "tcp": f"{self.tcp_ip}:{self.tcp_port}",
            "udp": f"{self.udp_ip}:{self.udp_port} (UDP)",
        }[self.channel_type]


def open_channel(params: ChannelParams) -> Channel:
    """Open it. Raises DeviceError with what to do."""
    try:
        if params.channel_type == "tcp":
            return TcpChannel(params.tcp_ip, params.tcp_port)
        if params.channel_type == "udp":
            return UdpChannel(params.udp_ip, params.udp_port)
        return SerialChannel(params.serial_port, params.serial_baudrate)
    except OSError as err:
        if params.channel_type != "serial":
            raise DeviceError(params.where, f"cannot be reached: {err}") from err
        why = why_closed(params.serial_port, err, device="the lidar", parameter="serial_port")
        raise DeviceError(params.where, why) from err


def why_silent(
    params: ChannelParams,
    heard: bytes,
    *,
    open_at: Callable[[str, int], Channel] = SerialChannel,
    bauds: Iterable[int] = BAUDS,
) -> str:
    """Why a lidar did not answer, and what to do. Tries the other speeds of a serial device; takes about a second.

    Args:
        params: of the channel, which has to be closed.
        heard: what came in place of an answer.
        open_at: opens a serial device at a speed; raises OSError.
        bauds: speeds to try.
    """
    if params.channel_type != "serial":
        return f"{_what_came(heard)}: look at the lidar's power and network"
    for baud in bauds:
        if baud != params.serial_baudrate and _answers(params.serial_port, baud, open_at):
            return f"it answers at {baud} baud: set serial_baudrate to {baud}"
    return f"{_what_came(heard)}: look at its power, its cable, and whether {params.serial_port} is the lidar"


def _what_came(heard: bytes) -> str:
    if not heard:
        return "not a byte came"
    for kind in FRAME_SIZES:
        if kind is not AnswerType.NODES and sum(map(bool, FrameFinder(kind).feed(heard))) >= _FEW:
            return "a scan comes that does not stop"
    return f"{len(heard)} bytes came that are no answer ({heard[:8].hex(' ')} ...)"


def _answers(port: str, baud: int, open_at: Callable[[str, int], Channel]) -> bool:
    try:
        channel = open_at(port, baud)
    except OSError:
        return False
    try:
        Lidar(channel).connect(tries=1)
    except (DeviceError, OSError):
        return False
    finally:
        channel.close()
    return True
