"""A simulated robot whose readings and commands go over the wires of emulated devices, as on a ROSbot.

In place of messages there are an RPLIDAR and the base's controller on pseudo-terminals, and a camera that sends JPEGs
over HTTP. The drivers of a real robot do the rest (`simulation:=hardware`).
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from rosbot_patrol.geometry import Twist2D, compose
from rosbot_patrol.params import param
from rosbot_patrol.simulation.devices.network_camera import NetworkCamera
from rosbot_patrol.simulation.devices.rosbot_base import FIRMWARES, RosbotBase
from rosbot_patrol.simulation.devices.rplidar import MODELS, RplidarDevice
from rosbot_patrol.simulation.devices.serial_line import Device, SerialLine
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.noise import noise_of
from rosbot_patrol.simulation.robot.description import Mount, RobotDescription
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene.slices import Slice

log = logging.getLogger(__name__)

_RANGE_PERIOD = 0.1  # [s]
_RANGE_MIN = 0.15  # [m] of the lidar
_JPEG_QUALITY = 85


@dataclass(frozen=True, kw_only=True)
class HardwareParams:
    """The emulated devices."""

    folder: str = param("", doc="folder of the serial lines rplidar and rosbot; empty: readings come as messages")
    lidar: str = param("A2", choices=("A1", "A2", "A3", "C1", "S1", "S2"), doc="model of the lidar")
    firmware: str = param("0.16.2", choices=tuple(FIRMWARES), doc="generation of the base's firmware")
    camera_port: int = param(8881, lo=0, hi=65535, doc="TCP port of the camera; 0: any")
    camera_rate: float = param(10.0, unit="Hz", lo=0.1, hi=30.0, doc="pictures a second, in simulated time")


def mounted(robot: RobotDescription) -> RobotDescription:
    """A robot with lidar and camera where rosbot_all_hardware.launch and astra.launch say that they are."""
    laser, camera = robot.laser, robot.camera
    optical = from_xyz_rpy((-0.03, -0.045, 0.18), (-math.pi / 2.0, 0.0, -math.pi / 2.0))
    return replace(
        robot,
        laser=laser and Mount(frame=laser.frame, pose=from_xyz_rpy((0.0, 0.0, 0.058), (0.0, 0.0, math.pi))),
        camera=camera and Mount(frame=camera.frame, pose=optical),
    )


class _Wheels:
    """What the base's controller drives and measures."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def command(self, linear: float, turning: float) -> None:
        self._engine.command(Twist2D(linear, 0.0, turning))

    def pose(self, now: float) -> tuple[float, float, float]:
        del now
        pose = self._engine.robot.odometry.pose
        return pose.x, pose.y, pose.yaw

    def speeds(self) -> tuple[float, float]:
        twist = self._engine.robot.odometry.twist
        return twist.vx, twist.wz

    def heading(self) -> tuple[float, float]:
        reading = self._engine.imu()
        return reading.yaw, reading.rates[2]


class _Port:
    """One device on a pseudo-terminal that can be pulled and plugged in again."""

    def __init__(self, device: Device, link: Path, baud: int) -> None:
        self._device, self._link, self._baud = device, link, baud
        self._line: SerialLine | None = SerialLine(link)

    def set_plugged(self, *, plugged: bool) -> None:
        """Be plugged in or not."""
        if plugged and self._line is None:
            self._line = SerialLine(self._link)
        elif not plugged and self._line is not None:
            self._line.hang_up()
            self._line = None

    def advance(self, now: float) -> None:
        """Take what came, and send what is due."""
        if self._line is None:
            return
        data = self._line.read(0.0)
        answer = self._device.feed(data, now) if data and self._line.baud == self._baud else b""
        answer += self._device.stream(now)
        if answer:
            self._line.write(answer)


class Hardware:
    """The robot's devices. Only the simulation's thread calls it.

    A fault `lidar_silent` or `base_silent` pulls the device's plug, `camera_silent` takes the camera off the network.

    Args:
        engine: the simulated world, with a robot.
        params: which devices, and where.

    Attributes:
        camera_port: TCP port of the camera.
    """

    def __init__(self, engine: Engine, params: HardwareParams) -> None:
        self._engine, self._params = engine, params
        folder = Path(params.folder).expanduser()
        folder.mkdir(parents=True, exist_ok=True)
        model, firmware = MODELS[params.lidar], FIRMWARES[params.firmware]
        self._base = RosbotBase(firmware, _Wheels(engine))
        lidar = RplidarDevice(model, self._distances)
        self._ports = {
            "lidar": _Port(lidar, folder / "rplidar", model.baud),
            "base": _Port(self._base, folder / "rosbot", firmware.baud),
        }
        self._camera: NetworkCamera | None = NetworkCamera(params.camera_port)
        self.camera_port = self._camera.port
        self._picture_due = self._ranges_due = 0.0
        self._scene: tuple[float, Slice] | None = None
        self._casts = 0
        log.info(
            "emulated devices: %s at %d baud, %s at %d baud, http://127.0.0.1:%d/stream",
            *(folder / "rplidar", model.baud, folder / "rosbot", firmware.baud, self.camera_port),
        )

    def advance(self) -> None:
        """Let the devices live until the engine's time."""
        now = self._engine.now
        if now >= self._ranges_due:
            self._ranges_due += _RANGE_PERIOD
            self._base.ranges = {frame.replace("_", "/", 1): each for frame, each in self._engine.ranges().items()}
            self._base.voltage = self._engine.robot.battery.voltage
        for name, port in self._ports.items():
            port.set_plugged(plugged=not self._engine.faults.is_silent(name))
            port.advance(now)
        self._show_picture(now)

    def close(self) -> None:
        """Pull all plugs."""
        for port in self._ports.values():
            port.set_plugged(plugged=False)
        if self._camera is not None:
            self._camera.close()

    def _show_picture(self, now: float) -> None:
        if self._engine.faults.is_silent("camera"):
            if self._camera is not None:
                self._camera.close()
                self._camera = None
            return
        if self._camera is None:
            self._camera = NetworkCamera(self.camera_port)
        if now >= self._picture_due and self._engine.has_camera:
            self._picture_due = max(self._picture_due + 1.0 / self._params.camera_rate, now)
            if self._camera.is_watched:
                colour = np.ascontiguousarray(self._engine.picture(depth=False).colour)
                self._camera.show(simplejpeg.encode_jpeg(colour, _JPEG_QUALITY, "RGB", "420"))

    def _distances(self, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances [mm] at a lidar's angles [degrees, clockwise, evenly spaced], 0 without an echo."""
        engine, params = self._engine, self._engine.params.lidar
        _, base_from_laser = engine.robot.laser
        at = compose(engine.pose, base_from_laser)
        turn = np.unwrap(np.radians(angles))
        step = float(turn[-1] - turn[0]) / (len(turn) - 1) if len(turn) > 1 else 1e-3
        # its 0 degrees look against the x axis of its frame, and its angles grow clockwise: cast from the last one
        last = at.yaw + math.pi - float(turn[-1])
        lengths = self._cut().cast(at.x, at.y, last, step, len(turn), longest=math.inf)[::-1]
        self._casts += 1
        lengths = lengths + noise_of(engine.params.seed, "lidar", self._casts).normal(0.0, params.noise, len(turn))
        heard = (lengths >= _RANGE_MIN) & (lengths <= params.range_max)
        return np.where(heard, 1e3 * lengths, 0.0)

    def _cut(self) -> Slice:
        """What stands at the height of the lidar's beams now."""
        engine = self._engine
        if self._scene is None or self._scene[0] != engine.now:
            height = engine.robot.lidar_height
            self._scene = engine.now, engine.ways.cut(height).plus(engine.population.cut(height))
        return self._scene[1]
