"""rplidarNode: the scans of a Slamtec RPLIDAR on `scan`.

Matches rplidar_ros 2.1 (ROS 1): parameters, topic, services `start_motor` and `stop_motor`, the words of its errors,
and exit status 255 where the device cannot be opened, does not answer, or reports a fault at the start.

Differs:
- Scans have fixed angles (`~upstream_angles` for the original's, which change from turn to turn).
- A lidar that is unplugged, falls silent or goes mad is opened again, with growing pauses. /diagnostics says so.
- One that does not answer is explained: no permission, another program, another speed, a scan that does not stop.
- STOP is sent before the motor ends, and both at the end of the node, SIGTERM included.
- `~auto_standby` stops the motor while nobody listens.
- `~wait_for_port`: time that the serial device may take to appear at the start, before the node gives up.
"""

from __future__ import annotations

import dataclasses
import logging
import math
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rospy
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Empty, EmptyRequest, EmptyResponse

from rosbot_patrol.drivers.rplidar.device_info import DeviceInfo, Health, ScanMode
from rosbot_patrol.drivers.rplidar.laser_scan import RANGE_MIN, Layout, fixed_angles, upstream_angles
from rosbot_patrol.drivers.rplidar.lidar import Lidar, samples_of_a_turn
from rosbot_patrol.drivers.rplidar.opening import ChannelParams, open_channel, why_silent
from rosbot_patrol.drivers.rplidar.turns import Turn
from rosbot_patrol.errors import DeviceError, ProtocolError
from rosbot_patrol.params import param
from rosbot_patrol.ros.runtime import diagnostics
from rosbot_patrol.ros.runtime.node import load_params, run_node
from rosbot_patrol.ros.runtime.process import Priority

log = logging.getLogger(__name__)

UPSTREAM_EXIT = 255
_SILENT = 2.0  # [s] without a turn, as upstream waits for one
_PAUSES = (0.5, 1.0, 2.0, 5.0)  # [s] before the next try to open it
_IDLE = 0.1  # [s] between two looks while the motor is off, or for a device that is not there yet
_REPORT = 1.0  # [s]


@dataclass(frozen=True, kw_only=True)
class RplidarParams(ChannelParams):
    """Parameters of rplidarNode."""

    frame_id: str = param("laser_frame", doc="frame of the scans")
    inverted: bool = param(False, doc="the lidar hangs upside down")
    angle_compensate: bool = param(False, doc="with upstream_angles: spread the samples over even angles")
    upstream_angles: bool = param(False, doc="angles as the original's, which change with the number of samples")
    scan_mode: str = param("", doc="name of the mode; empty: the lidar's typical one")
    scan_frequency: float = param(
        math.nan, unit="Hz", lo=1.0, hi=50.0, doc="turns a second; default 10, over UDP 20", ignores_nan=True
    )
    initial_reset: bool = param(False, doc="reset the lidar first")
    auto_standby: bool = param(False, doc="stop the motor while nobody listens to the scans")
    wait_for_port: float = param(
        0.0, unit="s", lo=0.0, doc="time for the serial device to appear at the start; without it, the node ends"
    )

    @property
    def turns_per_second(self) -> float:
        """The frequency, or upstream's default of the channel."""
        if not math.isnan(self.scan_frequency):
            return self.scan_frequency
        return 20.0 if self.channel_type == "udp" else 10.0


class _Refused(Exception):
    """The lidar cannot be used: upstream's words, and ours."""

    def __init__(self, upstream: str, why: str) -> None:
        super().__init__(upstream, why)
        self.upstream, self.why = upstream, why


class RplidarNode:
    """One lidar, from its bytes to its scans."""

    def __init__(self, params: RplidarParams) -> None:
        self._params = params
        self._publisher = rospy.Publisher("scan", LaserScan, queue_size=10, tcp_nodelay=True)
        self._health = diagnostics.Health(hardware_id="rplidar")
        self._wanted = True  # by the services
        self._changed = threading.Event()
        self._services: list[rospy.Service] = []
        self._mode: ScanMode | None = None
        self._is_running = False
        self._began = rospy.Time()  # of the turn under way
        self._heard = 0.0  # time of the last turn
        self._turns = 0  # since the last report
        self._reported = 0.0

    def run(self) -> int:
        """Serve until shutdown; returns the exit status."""
        tries = 0
        self._await_port()
        while not rospy.is_shutdown():
            try:
                lidar, info = self._open()
            except _Refused as err:
                if not self._services:  # it never worked: as upstream
                    log.error("%s", err.upstream)
                    log.error("%s", err.why)
                    return UPSTREAM_EXIT
                self._tell(diagnostics.ERROR, err.why)
                self._pause(_PAUSES[min(tries, len(_PAUSES) - 1)])
                tries += 1
                continue
            try:
                self._offer_services()
                self._serve(lidar, info)
                return 0
            except (OSError, DeviceError, ProtocolError) as err:
                log.error("the lidar is lost, and will be opened again: %s", err)
                self._tell(diagnostics.ERROR, f"lost: {err}")
                tries = 0
            finally:
                self._end(lidar)
        return 0

    # -- opening

    def _await_port(self) -> None:
        p = self._params
        if p.wait_for_port and self._is_missing():
            log.warning("%s is not there: waiting up to %g s for it", p.serial_port, p.wait_for_port)
            self._tell(diagnostics.WARN, f"waiting for {p.serial_port}")
            self._pause(p.wait_for_port)

    def _is_missing(self) -> bool:
        return self._params.channel_type == "serial" and not Path(self._params.serial_port).exists()

    def _pause(self, seconds: float) -> None:
        """Wait; no longer than until a serial device that is missing has come."""
        was_missing, until = self._is_missing(), time.monotonic() + seconds
        while not rospy.is_shutdown() and time.monotonic() < until:
            if was_missing and not self._is_missing():
                return
            self._wait(_IDLE)

    def _open(self) -> tuple[Lidar, DeviceInfo]:
        p = self._params
        try:
            channel = open_channel(p)
        except DeviceError as err:
            raise _Refused(_cannot_open(p), str(err)) from err
        lidar = Lidar(channel)
        try:
            info = self._meet(lidar)
        except (DeviceError, ProtocolError, OSError) as err:
            lidar.close()
            why = str(err) if isinstance(err, OSError) else why_silent(p, lidar.heard)
            words = "Error, operation time out. RESULT_OPERATION_TIMEOUT! "
            raise _Refused(words, f"{p.where}: {err}: {why}") from err
        except _Refused:
            lidar.close()
            raise
        return lidar, info

    def _meet(self, lidar: Lidar) -> DeviceInfo:
        info = lidar.connect()
        if self._params.initial_reset:
            lidar.reset()
            info = lidar.connect()
        log.info("RPLIDAR S/N: %s", info.serial_number)
        log.info("Firmware Ver: %d.%02d, hardware revision %d, %s", *info.firmware, info.hardware, info.name)
        health, code = lidar.health()
        if health is Health.ERROR:
            words = "Error, rplidar internal error detected. Please reboot the device to retry."
            raise _Refused(words, f"{self._params.where}: the {info.name} reports error {code}: switch it off and on")
        log.info("RPLidar health status : %s", "OK." if health is Health.GOOD else "Warning.")
        return info

    def _offer_services(self) -> None:
        if not self._services:
            self._services = [
                rospy.Service("start_motor", Empty, self._start_motor),
                rospy.Service("stop_motor", Empty, self._stop_motor),
            ]

    def _start_motor(self, _: EmptyRequest) -> EmptyResponse:
        log.debug("Start motor")
        return self._order(wanted=True)

    def _stop_motor(self, _: EmptyRequest) -> EmptyResponse:
        log.debug("Stop motor")
        return self._order(wanted=False)

    def _order(self, *, wanted: bool) -> EmptyResponse:
        self._wanted = wanted
        self._changed.set()
        return EmptyResponse()

    # -- serving

    def _serve(self, lidar: Lidar, info: DeviceInfo) -> None:
        self._is_running = False
        while not rospy.is_shutdown():
            if not self._is_wanted():
                if self._is_running:
                    self._halt(lidar)
                self._tell(diagnostics.OK, "the motor is off", {"model": info.name})
                self._wait(_IDLE)
            elif not self._is_running:
                if not self._start(lidar):
                    self._idle_without_scan(info)
                    return
            else:
                self._publish_turns(lidar, info)

    def _is_wanted(self) -> bool:
        return self._wanted and not (self._params.auto_standby and self._publisher.get_num_connections() == 0)

    def _start(self, lidar: Lidar) -> bool:
        """Start motor and scan; returns False for a mode that the lidar does not have, or refuses."""
        modes, typical = lidar.modes()
        name = self._params.scan_mode
        chosen = [mode for mode in modes if (mode.name == name if name else mode.id == typical)]
        if not chosen:
            log.error("scan mode `%s' is not supported by lidar, supported modes:", name)
            for mode in modes:
                rate = 1e-3 / mode.sample_time
                log.error("\t%s: max_distance: %.1f m, Point number: %.1fK", mode.name, mode.max_distance, rate)
            return False
        self._mode = chosen[0]
        frequency = self._params.turns_per_second
        lidar.set_motor(round(frequency * 60.0))
        lidar.start_scan(self._mode)
        words = "current scan mode: %s, sample rate: %d Khz, max_distance: %.1f m, scan frequency:%.1f Hz, "
        log.info(words, self._mode.name, round(1e-3 / self._mode.sample_time), self._mode.max_distance, frequency)
        self._is_running, self._turns, self._reported = True, 0, time.monotonic()
        self._began, self._heard = rospy.Time.now(), time.monotonic()
        return True

    def _idle_without_scan(self, info: DeviceInfo) -> None:
        while not rospy.is_shutdown():
            self._tell(diagnostics.ERROR, f"no scan: the {info.name} has no mode {self._params.scan_mode!r}")
            self._wait(1.0)

    def _publish_turns(self, lidar: Lidar, info: DeviceInfo) -> None:
        for turn in lidar.read_turns(0.1):
            self._heard = time.monotonic()
            self._turns += 1
            self._publish(turn)
        silent = time.monotonic() - self._heard
        if silent > _SILENT:
            raise DeviceError(self._params.where, f"no turn of the lidar for {silent:.1f} s: does its motor turn?")
        if time.monotonic() - self._reported >= _REPORT:
            self._report(lidar, info)

    def _publish(self, turn: Turn) -> None:
        assert self._mode is not None
        end = rospy.Time.now()
        began, self._began = self._began, end
        layout = self._layout(turn)
        if layout is None:
            rospy.logwarn_throttle(10.0, "a turn of the lidar has no echo at all: no scan is published")
            return
        message = LaserScan()
        message.header.stamp, message.header.frame_id = began, self._params.frame_id
        message.angle_min, message.angle_max = layout.angle_min, layout.angle_max
        message.angle_increment = layout.angle_increment
        message.scan_time = (end - began).to_sec()
        message.time_increment = message.scan_time / max(len(layout.ranges) - 1, 1)
        message.range_min, message.range_max = RANGE_MIN, self._mode.max_distance
        message.ranges, message.intensities = layout.ranges.astype(np.float32), layout.intensities.astype(np.float32)
        self._publisher.publish(message)

    def _layout(self, turn: Turn) -> Layout | None:
        assert self._mode is not None
        p = self._params
        cells = samples_of_a_turn(self._mode, p.turns_per_second)
        if p.upstream_angles:
            return upstream_angles(turn, cells, inverted=p.inverted, compensate=p.angle_compensate)
        return fixed_angles(turn, cells, inverted=p.inverted)

    def _report(self, lidar: Lidar, info: DeviceInfo) -> None:
        assert self._mode is not None
        rate = self._turns / (time.monotonic() - self._reported)
        spoilt, skipped = lidar.spoilt
        about = {
            "model": info.name,
            "serial number": info.serial_number,
            "firmware": "{}.{:02d}".format(*info.firmware),
            "mode": self._mode.name,
            "turns a second": f"{rate:.1f}",
            "frames with a wrong checksum": spoilt,
            "bytes skipped": skipped,
        }
        self._tell(diagnostics.OK, f"{rate:.1f} turns a second", about)
        self._turns, self._reported = 0, time.monotonic()

    # -- end

    def _halt(self, lidar: Lidar) -> None:
        self._is_running = False
        lidar.stop_scan()
        lidar.set_motor(0)

    def _end(self, lidar: Lidar) -> None:
        self._is_running = False
        try:
            self._halt(lidar)
        except OSError as err:
            log.debug("the lidar could not be stopped: %s", err)
        lidar.close()

    def _wait(self, seconds: float) -> None:
        self._changed.wait(seconds)
        self._changed.clear()

    def _tell(self, level: int, text: str, values: dict[str, object] | None = None) -> None:
        self._health.set("", level, text, values)


def _cannot_open(params: RplidarParams) -> str:
    if params.channel_type == "serial":
        return f"Error, cannot bind to the specified serial port {params.serial_port}."
    host, port = dataclasses.asdict(params)[f"{params.channel_type}_ip"], getattr(params, f"{params.channel_type}_port")
    return f"Error, cannot connect to the ip addr {host} with the {params.channel_type} port {port}."


def body() -> None:
    """Run until shutdown; ends the program with upstream's status where the lidar cannot be used at the start."""
    status = RplidarNode(load_params(RplidarParams)).run()
    if status:
        time.sleep(0.3)  # another thread sends /rosout
        sys.exit(status)


def main() -> None:
    """Run the node."""
    run_node("rplidarNode", body, priority=Priority.CONTROL)
