"""hlds_laser_publisher: the scans of the LDS-01 of a TurtleBot3 on `scan`.

Matches hls_lfcd_lds_driver (noetic): parameters, topic and layout of the scans. Differs: a lidar that is unplugged or
silent is opened again, and /diagnostics says so; the motor is stopped at the end; beams without an echo are inf.
"""

from __future__ import annotations

import contextlib
import logging
import math
import time
from dataclasses import dataclass

import numpy as np
import rospy
from sensor_msgs.msg import LaserScan

from rosbot_patrol.drivers.channels import SerialChannel
from rosbot_patrol.drivers.lds.lds01 import BAUD, RANGE_MAX, RANGE_MIN, START, STOP, LdsTurn, TurnReader
from rosbot_patrol.params import param
from rosbot_patrol.ros.runtime import diagnostics
from rosbot_patrol.ros.runtime.node import load_params, run_node
from rosbot_patrol.ros.runtime.process import Priority
from rosbot_patrol.rosserial.server.serial_port import why_closed

log = logging.getLogger(__name__)

_PAUSES = (0.5, 1.0, 2.0, 5.0)  # [s]
_SILENT = 3.0  # [s] without a turn: the motor needs a second to start
_TURNS_A_SECOND = 5.0


@dataclass(frozen=True, kw_only=True)
class LdsParams:
    """Parameters of hlds_laser_publisher."""

    port: str = param("/dev/ttyUSB0", doc="serial device")
    baud_rate: int = param(BAUD, lo=1, doc="its speed")
    frame_id: str = param("laser", doc="frame of the scans")


class LdsNode:
    """One lidar."""

    def __init__(self, params: LdsParams) -> None:
        self._params = params
        self._publisher = rospy.Publisher("scan", LaserScan, queue_size=10, tcp_nodelay=True)
        self._health = diagnostics.Health(hardware_id="lds")
        self._began = rospy.Time()
        self._why = ""

    def run(self) -> None:
        """Serve until shutdown."""
        tries = 0
        while not rospy.is_shutdown():
            try:
                channel = SerialChannel(self._params.port, self._params.baud_rate)
            except OSError as err:
                self._lost(why_closed(self._params.port, err, device="the lidar", parameter="port"))
                self._pause(_PAUSES[min(tries, len(_PAUSES) - 1)])
                tries += 1
                continue
            tries = 0
            try:
                self._serve(channel)
            except OSError as err:
                self._lost(f"{self._params.port}: the lidar is lost, and will be opened again: {err}")
                self._pause(_PAUSES[0])
            finally:
                with contextlib.suppress(OSError):
                    channel.send(STOP)
                channel.close()

    def _serve(self, channel: SerialChannel) -> None:
        channel.send(START)
        reader, heard = TurnReader(), time.monotonic()
        self._began = rospy.Time.now()
        while not rospy.is_shutdown():
            for turn in reader.feed(channel.read(0.1)):
                heard = time.monotonic()
                self._publish(turn)
                self._why = ""
                values = {"turns a second": f"{turn.speed:.1f}", "bytes skipped": reader.skipped}
                self._health.set("", diagnostics.OK, f"{turn.speed:.1f} turns a second", values)
            if time.monotonic() - heard > _SILENT:
                raise OSError(f"no turn for {_SILENT:g} s: is this an LDS-01, at {self._params.baud_rate} baud?")

    def _publish(self, turn: LdsTurn) -> None:
        began, self._began = self._began, rospy.Time.now()
        scan = LaserScan()
        scan.header.stamp, scan.header.frame_id = began, self._params.frame_id
        scan.angle_min, scan.angle_increment = 0.0, math.tau / 360.0
        scan.angle_max = 359.0 * scan.angle_increment
        scan.scan_time = 1.0 / (turn.speed or _TURNS_A_SECOND)
        scan.time_increment = scan.scan_time / 360.0
        scan.range_min, scan.range_max = RANGE_MIN, RANGE_MAX
        scan.ranges, scan.intensities = turn.ranges.astype(np.float32), turn.intensities.astype(np.float32)
        self._publisher.publish(scan)

    def _lost(self, why: str) -> None:
        if why != self._why:
            log.error("%s", why)
        self._why = why
        self._health.set("", diagnostics.ERROR, why)

    def _pause(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while time.monotonic() < until and not rospy.is_shutdown():
            time.sleep(0.1)


def _body() -> None:
    LdsNode(load_params(LdsParams)).run()


def main() -> None:
    """Run the node."""
    run_node("hlds_laser_publisher", _body, priority=Priority.CONTROL)
