"""Devices of a robot that are plugged in: lidars, bases and cameras, by their USB numbers or the robot's version.

Many lidars have the same USB bridge (CP210x), so what is found there is what it may be.
"""

from __future__ import annotations

import getpass
import grp
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.drivers.cameras.usb_devices import list_cameras

LIDAR, BASE, CAMERA = "lidar", "base", "camera"

# USB numbers of serial devices: what they may be, and the sentence
_SERIAL = {
    ("10c4", "ea60"): (LIDAR, "an RPLIDAR or an LDS-01, behind a CP210x"),
    ("0483", "5740"): (BASE, "an OpenCR, the base of a TurtleBot3"),
    ("2341", "0043"): (BASE, "an Arduino Uno"),
    ("2341", "0042"): (BASE, "an Arduino Mega"),
    ("1a86", "7523"): (BASE, "an Arduino or another board, behind a CH340"),
}
# the serial line of the base by ROSBOT_VER, as rosbot_ekf names it
_BY_VERSION = {"ROSBOT_2.0": "/dev/ttyS1", "ROSBOT_2.0_PRO": "/dev/ttyS4"}
_NAMED = "/dev/ttyCORE2", "/dev/rosbot"

RULES = """\
# Names for the devices of a robot, and access for the group dialout: put this into /etc/udev/rules.d, then run
# udevadm control --reload and plug them in again.
SUBSYSTEM=="tty", ATTRS{idVendor}=="10c4", ATTRS{idProduct}=="ea60", GROUP="dialout", MODE="0660", SYMLINK+="rplidar"
SUBSYSTEM=="tty", ATTRS{idVendor}=="0483", ATTRS{idProduct}=="5740", GROUP="dialout", MODE="0660", SYMLINK+="rosbot"
"""


@dataclass(frozen=True)
class Attached:
    """A device.

    Attributes:
        kind: lidar, base or camera.
        path: of its device file.
        about: what it is, or may be.
        problem: why this user cannot open it, "" if they can.
    """

    kind: str
    path: Path
    about: str
    problem: str = ""

    @property
    def text(self) -> str:
        """One line for a person."""
        return f"{self.kind:7} {self.path}: {self.about}" + (f"; {self.problem}" if self.problem else "")


def find_attached(environment: Mapping[str, str] = os.environ) -> list[Attached]:
    """Devices that are plugged in, the base of a ROSbot by ROSBOT_VER. $SYSFS_PATH may replace /sys."""
    sysfs = Path(environment.get("SYSFS_PATH", "/sys"))
    found = [each for entry in sorted((sysfs / "class" / "tty").glob("tty[UA]*")) if (each := _serial(entry))]
    named = [*_NAMED, *filter(None, [_BY_VERSION.get(environment.get("ROSBOT_VER", ""))])]
    found += [_attached(BASE, Path(path), "the base of a ROSbot") for path in named if Path(path).exists()]
    found += [_attached(CAMERA, each.path, each.text) for each in list_cameras(sysfs)]
    return found


def report(found: list[Attached]) -> str:
    """Lines for a person: what is there, and what is missing."""
    lines = [each.text for each in found]
    for kind, advice in (
        (LIDAR, "plug it in, or name its port (lidar_port:=...)"),
        (BASE, "plug it in, or name its port (base_port:=...)"),
        (CAMERA, "plug it in, or give a network camera's address (camera_url:=...)"),
    ):
        if not any(each.kind == kind for each in found):
            lines.append(f"{kind:7} none is found: {advice}")
    return "\n".join(lines)


def _serial(entry: Path) -> Attached | None:
    device = (entry / "device").resolve()
    for folder in (device, *list(device.parents)[:3]):
        if (folder / "idVendor").is_file():
            numbers = tuple((folder / name).read_text().strip() for name in ("idVendor", "idProduct"))
            kind, about = _SERIAL.get((numbers[0], numbers[1]), ("", ""))
            return _attached(kind, Path("/dev") / entry.name, f"{about} ({':'.join(numbers)})") if kind else None
    return None


def _attached(kind: str, path: Path, about: str) -> Attached:
    if not path.exists() or os.access(path, os.R_OK | os.W_OK):
        return Attached(kind, path, about)
    group = grp.getgrgid(path.stat().st_gid).gr_name
    return Attached(kind, path, about, f"you may not open it: sudo adduser {getpass.getuser()} {group}, log in again")
