"""USB cameras as the kernel lists them: which camera each video device belongs to.

The number of a video device changes when a camera is plugged in again. Vendor, product and serial number do not.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class UsbCamera:
    """A camera that is plugged in.

    Attributes:
        path: its video device.
        vendor, product: its USB numbers as 4 hexadecimal digits, "" for a device that is not on USB.
        serial: its serial number, "" if it has none.
        name: what it calls itself.
    """

    path: Path
    vendor: str
    product: str
    serial: str
    name: str

    @property
    def text(self) -> str:
        """Name and USB numbers, for messages."""
        numbers = f" (usb:{self.vendor}:{self.product}{':' if self.serial else ''}{self.serial})" if self.vendor else ""
        return f"{self.name}{numbers}"

    def is_like(self, other: UsbCamera) -> bool:
        """Whether it may be the same camera in another place."""
        return (self.vendor, self.product, self.serial) == (other.vendor, other.product, other.serial)


def list_cameras(sysfs: Path | None = None) -> list[UsbCamera]:
    """Cameras that are plugged in, in order of their numbers.

    Only the first node of each device is listed: the others carry its metadata.

    Args:
        sysfs: the kernel's device tree; default $SYSFS_PATH, else /sys.
    """
    folder = (sysfs or Path(os.environ.get("SYSFS_PATH", "/sys"))) / "class" / "video4linux"
    if not folder.is_dir():
        return []
    entries = sorted(folder.iterdir(), key=lambda each: (len(each.name), each.name))
    first = [entry for entry in entries if entry.name.startswith("video") and _text(entry / "index") in ("0", "")]
    return [_camera(entry) for entry in first]


def camera_at(path: Path, sysfs: Path | None = None) -> UsbCamera | None:
    """The camera behind a device or a link to it, None if the kernel lists none."""
    real = path.resolve()
    return next((each for each in list_cameras(sysfs) if each.path == real), None)


def find_usb(wanted: Sequence[str], sysfs: Path | None = None) -> UsbCamera | None:
    """The first camera with one of the numbers VENDOR:PRODUCT or VENDOR:PRODUCT:SERIAL, None if there is none."""
    for camera in list_cameras(sysfs):
        numbers = f"{camera.vendor}:{camera.product}"
        if any(each in (numbers, f"{numbers}:{camera.serial}") for each in wanted):
            return camera
    return None


def _camera(entry: Path) -> UsbCamera:
    usb = (entry / "device").resolve().parent  # of the interface
    name = _text(entry / "name") or entry.name
    return UsbCamera(
        Path("/dev") / _devname(entry), _text(usb / "idVendor"), _text(usb / "idProduct"), _text(usb / "serial"), name
    )


def _devname(entry: Path) -> str:
    for line in _text(entry / "uevent").splitlines():
        if line.startswith("DEVNAME="):
            return line.removeprefix("DEVNAME=")
    return entry.name


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
