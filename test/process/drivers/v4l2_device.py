"""A camera of Video4Linux for a program in a process of its own, by `fake_v4l2.c`."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import simplejpeg

SOURCE = Path(__file__).with_name("fake_v4l2.c")


def pictures(count: int = 8, width: int = 640, height: int = 480) -> list[bytes]:
    """JPEGs that differ."""
    columns = np.linspace(0, 255, width, dtype=np.uint8)
    found = []
    for number in range(count):
        pixels = np.zeros((height, width, 3), np.uint8)
        pixels[..., 0], pixels[..., 1] = columns, 30 * number
        found.append(simplejpeg.encode_jpeg(pixels, 85, "RGB", "420"))
    return found


class FakeV4l2:
    """One camera that can be plugged in, silenced and lent to another program.

    Args:
        folder: for its files.
        jpegs: its pictures.
        number: of its video device.
    """

    def __init__(self, folder: Path, jpegs: list[bytes], number: int = 0) -> None:
        self._folder, self._jpegs = folder, jpegs
        library = folder / "fake_v4l2.so"
        command = ["gcc", "-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o", str(library), str(SOURCE), "-ldl"]
        subprocess.run(command, check=True, timeout=60)
        self.plug_in(number)
        self.env = {
            "LD_PRELOAD": str(library),
            "FAKE_V4L2": str(folder / "video"),
            "SYSFS_PATH": str(folder / "sys"),
        }

    def plug_in(self, number: int) -> None:
        """Appear as a video device."""
        self.device = self._folder / f"video{number}"
        self.device.write_bytes(bytes(4 << 20))
        self._beside("frames").mkdir(exist_ok=True)
        for at, jpeg in enumerate(self._jpegs):
            (self._beside("frames") / f"{at}.jpg").write_bytes(jpeg)
        usb = self._folder / "sys" / "devices" / f"usb{number}"
        (usb / "1.0").mkdir(parents=True, exist_ok=True)
        for name, text in (("idVendor", "2bc5"), ("idProduct", "0501"), ("serial", "A17")):
            (usb / name).write_text(f"{text}\n")
        entry = self._entry
        entry.mkdir(parents=True)
        for name, text in (("index", "0"), ("name", "Test Camera"), ("uevent", f"DEVNAME={self.device}")):
            (entry / name).write_text(f"{text}\n")
        (entry / "device").symlink_to(usb / "1.0")

    def unplug(self) -> None:
        """Vanish."""
        for path in (self._entry / "device", *self._entry.iterdir(), self.device):
            path.unlink(missing_ok=True)
        self._entry.rmdir()

    def set(self, state: str, *, on: bool) -> None:
        """Be `busy` or `silent`, or no longer."""
        if on:
            self._beside(state).touch()
        else:
            self._beside(state).unlink()

    def log(self, kind: str) -> list[tuple[int, float]]:
        """What was logged: frames with their times, or controls with their values."""
        path = self._beside("log")
        lines = [line.split() for line in path.read_text().splitlines()] if path.exists() else []
        return [(int(line[1]), float(line[2])) for line in lines if line[0] == kind]

    def full_env(self) -> dict[str, str]:
        """Environment for a program that sees it."""
        return {**os.environ, **self.env}

    @property
    def _entry(self) -> Path:
        return self._folder / "sys" / "class" / "video4linux" / self.device.name

    def _beside(self, ending: str) -> Path:
        return self._folder / f"video.{ending}"
