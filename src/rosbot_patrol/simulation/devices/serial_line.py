"""A pseudo-terminal that stands for the serial line between an emulated device and its driver."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import select
import struct
import termios
import time
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

_TCGETS2 = 0x802C542A
_TERMIOS2 = struct.Struct("<4IB19s2I")
_STEP = 0.001  # [s]
_CHUNK = 4096


class Device(Protocol):
    """An emulated device: bytes in, bytes out."""

    def feed(self, data: bytes, now: float) -> bytes:
        """Take bytes that came at a time [s]; returns the answers."""

    def stream(self, now: float) -> bytes:
        """What it sends unasked by a time [s]."""


class SerialLine:
    """One end of a pseudo-terminal, for the device.

    Args:
        link: path by which the driver opens the other end; a symbolic link that is replaced.

    Attributes:
        path: of the other end.
    """

    def __init__(self, link: Path | None = None) -> None:
        self._master, self._slave = pty.openpty()  # the slave stays open, so that the line outlives its users
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self._link = link
        self.path = Path(os.ttyname(self._slave))
        if link is not None:
            link.unlink(missing_ok=True)
            link.symlink_to(self.path)
            self.path = link

    @property
    def baud(self) -> int:
        """The speed that the driver has set."""
        raw = fcntl.ioctl(self._master, _TCGETS2, bytes(_TERMIOS2.size))
        return int(_TERMIOS2.unpack(raw)[-1])

    def read(self, timeout: float) -> bytes:
        """Bytes from the driver, b"" if none come within the time [s]."""
        if not select.select([self._master], [], [], timeout)[0]:
            return b""
        try:
            return os.read(self._master, _CHUNK)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> None:
        """Send bytes; what the line cannot hold is lost, as on a line that nobody reads."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._master, data)

    def hang_up(self) -> None:
        """Pull the plug: whoever has the other end open gets an error."""
        if self._link is not None:
            self._link.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            fcntl.ioctl(self._slave, termios.TIOCNOTTY)
        os.close(self._master)
        os.close(self._slave)


def serve(
    device: Device,
    line: SerialLine,
    is_running: Callable[[], bool],
    *,
    baud: int | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Run a device on a line.

    Args:
        device: to run.
        line: its own end.
        is_running: asked again and again; False ends it.
        baud: speed at which it understands the driver; None: any.
        clock: its time [s].
    """
    while is_running():
        data = line.read(_STEP)
        answer = device.feed(data, clock()) if data and baud in (None, line.baud) else b""
        answer += device.stream(clock())
        if answer:
            line.write(answer)
