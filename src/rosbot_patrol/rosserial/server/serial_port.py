"""A serial device as a non-blocking link, at any speed (Linux)."""

from __future__ import annotations

import errno
import fcntl
import os
import struct
import termios
import tty

_TCGETS2, _TCSETS2 = 0x802C542A, 0x402C542B
_CBAUD, _BOTHER = 0o010017, 0o010000
_TERMIOS2 = struct.Struct("<4IB19s2I")  # c_iflag, c_oflag, c_cflag, c_lflag, c_line, c_cc, c_ispeed, c_ospeed


def _set_speed(fd: int, baud: int) -> None:
    """Set any speed, such as the 525000 baud of the ROSbot's base; termios has no constant for it."""
    fields = list(_TERMIOS2.unpack(fcntl.ioctl(fd, _TCGETS2, bytes(_TERMIOS2.size))))
    fields[2] = (fields[2] & ~_CBAUD) | _BOTHER | termios.CLOCAL | termios.CREAD
    fields[6] = fields[7] = baud
    fcntl.ioctl(fd, _TCSETS2, _TERMIOS2.pack(*fields))


def why_closed(path: str, err: OSError, *, device: str, parameter: str) -> str:
    """Why a serial device could not be opened, and what to do.

    Args:
        path: of the device.
        err: of the attempt.
        device: what should be plugged in there, such as "the lidar".
        parameter: name of the parameter with the path.
    """
    if err.errno in (errno.EACCES, errno.EPERM):
        user = os.environ.get("USER", "USER")
        return f"{path} may not be opened by this user: sudo adduser {user} dialout, then log in again"
    if err.errno in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return f"{path} is not there: plug {device} in, or set {parameter} (ls /dev/serial/by-id)"
    if err.errno in (errno.EBUSY, errno.EWOULDBLOCK):
        return f"another program uses {path}: end it first (fuser {path} tells which)"
    return str(err)


class SerialPort:
    """An open serial device, 8N1 and raw, with the methods of a socket that the server uses.

    Raises:
        OSError: the device is not there, is no serial device, or may not be opened.
    """

    def __init__(self, path: str, baud: int) -> None:
        self._fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            tty.setraw(self._fd)
            _set_speed(self._fd, baud)
            termios.tcflush(self._fd, termios.TCIOFLUSH)
        except (OSError, termios.error) as err:
            os.close(self._fd)
            raise OSError(f"{path} cannot be used as a serial device at {baud} baud: {err}") from err

    def fileno(self) -> int:
        """The file descriptor."""
        return self._fd

    def recv(self, size: int) -> bytes:
        """Bytes that have arrived; raises BlockingIOError if there are none."""
        return os.read(self._fd, size)

    def send(self, data: bytes) -> int:
        """Write as much as fits; returns how much; raises BlockingIOError if nothing fits."""
        return os.write(self._fd, data)

    def close(self) -> None:
        """Close the device."""
        os.close(self._fd)
