"""Ways to a device: a serial line, TCP, UDP."""

from __future__ import annotations

import errno
import fcntl
import select
import socket
import struct
import termios
import time

from rosbot_patrol.rosserial.server.serial_port import SerialPort

_CONNECT_WITHIN = 3.0  # [s]
_SEND_WITHIN = 1.0  # [s]
_CHUNK = 4096
BAUDS = (115200, 256000, 460800, 1000000)  # that Slamtec's lidars use


class _Waiting:
    """Send and read with a limit of time, over something with a socket's methods."""

    def __init__(self, link: SerialPort | socket.socket, name: str) -> None:
        self._link = link
        self.name = name

    def send(self, data: bytes) -> None:
        """Send all bytes. Raises OSError if they do not leave."""
        until = time.monotonic() + _SEND_WITHIN
        while data:
            try:
                data = data[self._link.send(data) :]
            except BlockingIOError:
                left = until - time.monotonic()
                if left <= 0.0:
                    raise OSError(errno.ETIMEDOUT, f"{self.name} takes no bytes") from None
                select.select([], [self._link], [], left)

    def read(self, timeout: float) -> bytes:
        """Bytes that have come, b"" if none come within the time [s]. Raises OSError when the device has gone."""
        if not select.select([self._link], [], [], max(timeout, 0.0))[0]:
            return b""
        try:
            data = self._link.recv(_CHUNK)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError(errno.ENODEV, f"{self.name} has gone")
        return data

    def set_dtr(self, on: bool) -> None:
        """Nothing: there is no such line."""

    def close(self) -> None:
        """Close the link."""
        self._link.close()


class SerialChannel(_Waiting):
    """A serial device, for this program alone.

    Raises:
        OSError: it is not there, may not be opened, is no serial device, or another program has it.
    """

    def __init__(self, path: str, baud: int) -> None:
        port = SerialPort(path, baud)
        super().__init__(port, path)
        try:
            fcntl.flock(port.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            port.close()
            raise

    def set_dtr(self, on: bool) -> None:
        """Set the line DTR; a pseudo-terminal has none."""
        order = termios.TIOCMBIS if on else termios.TIOCMBIC
        try:
            fcntl.ioctl(self._link.fileno(), order, struct.pack("I", termios.TIOCM_DTR))
        except OSError as err:
            if err.errno not in (errno.ENOTTY, errno.EINVAL):
                raise


class TcpChannel(_Waiting):
    """A device behind a TCP port. Raises OSError if nothing answers there within 3 s."""

    def __init__(self, host: str, port: int) -> None:
        link = socket.create_connection((host, port), _CONNECT_WITHIN)
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        link.setblocking(False)
        super().__init__(link, f"{host}:{port}")


class UdpChannel(_Waiting):
    """A device behind a UDP port. Raises OSError for a name that is not known."""

    def __init__(self, host: str, port: int) -> None:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        link = socket.socket(family, kind, protocol)
        link.connect(address)
        link.setblocking(False)
        super().__init__(link, f"{host}:{port} (UDP)")

    def read(self, timeout: float) -> bytes:
        """A datagram, b"" if none comes within the time [s]; a port that refuses counts as silent."""
        try:
            return super().read(timeout)
        except ConnectionRefusedError:
            return b""
