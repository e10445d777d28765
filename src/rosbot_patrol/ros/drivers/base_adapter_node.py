"""base_adapter: makes the guard's topics and frames of those of another base.

- `cmd_vel` goes to `base/cmd_vel` with limits, and with a stop once commands cease or this node ends: some bases drive
  on for ever.
- `base/odom` goes to `odom`, with the frame of the base called base_link, and with a transform for a base without one.
- `base/battery` goes to `battery` as a BatteryState.
"""

from __future__ import annotations

import logging
import math
import threading
import time

import rospy
from geometry_msgs.msg import TransformStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Float32
from tf2_msgs.msg import TFMessage

from rosbot_patrol.drivers.bases.adapter import AdapterParams, CommandGate, check_adapter, share_of_voltage
from rosbot_patrol.geometry import STOP, Twist2D
from rosbot_patrol.ros.messages.convert import twist_from_msg, twist_to_msg
from rosbot_patrol.ros.runtime import diagnostics
from rosbot_patrol.ros.runtime.node import load_params, run_node
from rosbot_patrol.ros.runtime.process import Priority

log = logging.getLogger(__name__)

_PERIOD = 0.02  # [s]


class BaseAdapter:
    """Topics of a base in, topics of the guard out, and the other way round."""

    def __init__(self, params: AdapterParams) -> None:
        self._params, self._gate = params, CommandGate(params)
        self._lock = threading.Lock()
        self._heard = -math.inf
        self._commands = rospy.Publisher("base/cmd_vel", Twist, queue_size=1, tcp_nodelay=True)
        self._odometry = rospy.Publisher("odom", Odometry, queue_size=10)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10) if params.publish_tf else None
        self._battery = rospy.Publisher("battery", BatteryState, queue_size=1)
        self._health = diagnostics.Health(hardware_id="base")
        if params.base_frame not in ("", "base_link"):
            self._static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
            self._static.publish(TFMessage([_alias(params.base_frame)]))
        rospy.Subscriber("cmd_vel", Twist, self._on_command, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber("base/odom", Odometry, self._on_odometry, queue_size=10, tcp_nodelay=True)
        if params.battery:
            kind = BatteryState if params.battery == "state" else Float32
            rospy.Subscriber("base/battery", kind, self._on_battery, queue_size=1)
        rospy.on_shutdown(lambda: self._send(STOP))

    def run(self) -> None:
        """Watch over commands and odometry until shutdown."""
        was_silent = False
        while not rospy.is_shutdown():
            now = time.monotonic()
            with self._lock:
                due = self._gate.due(now)
            if due is not None:
                self._send(due)
            silent = now - self._heard > self._params.odometry_timeout
            text = "the base sends no odometry: look at its cable and driver" if silent else "the base sends odometry"
            if silent != was_silent:
                (log.error if silent else log.info)("%s", text)
            was_silent = silent
            self._health.set("", diagnostics.ERROR if silent else diagnostics.OK, text)
            time.sleep(_PERIOD)

    def _send(self, twist: Twist2D) -> None:
        self._commands.publish(twist_to_msg(twist))

    def _on_command(self, message: Twist) -> None:
        with self._lock:
            command = self._gate.take(twist_from_msg(message), time.monotonic())
        self._send(command)

    def _on_odometry(self, message: Odometry) -> None:
        self._heard = time.monotonic()
        message.child_frame_id = "base_link"
        self._odometry.publish(message)
        if self._tf is not None:
            transform = TransformStamped(header=message.header, child_frame_id="base_link")
            position, at = message.pose.pose.position, transform.transform.translation
            at.x, at.y, at.z = position.x, position.y, position.z
            transform.transform.rotation = message.pose.pose.orientation
            self._tf.publish(TFMessage([transform]))

    def _on_battery(self, message: BatteryState | Float32) -> None:
        p = self._params
        if p.battery == "state":
            state = message
            if not 0.0 <= state.percentage <= 1.0 or not state.present:
                state.percentage = share_of_voltage(state.voltage, p.battery_flat, p.battery_full)
        else:
            state = BatteryState(voltage=math.nan, percentage=math.nan)
            state.header.stamp = rospy.Time.now()
            if p.battery == "volts":
                state.voltage = message.data
                state.percentage = share_of_voltage(message.data, p.battery_flat, p.battery_full)
            else:
                state.percentage = message.data / (100.0 if p.battery == "percent" else 1.0)
        state.present = math.isfinite(state.percentage)
        self._battery.publish(state)


def _alias(frame: str) -> TransformStamped:
    """base_link at the same place as the base's own frame."""
    transform = TransformStamped(child_frame_id="base_link")
    transform.header.frame_id = frame
    transform.transform.rotation.w = 1.0
    return transform


def _body() -> None:
    params = load_params(AdapterParams)
    check_adapter(params, rospy.get_name() + "/")
    BaseAdapter(params).run()


def main() -> None:
    """Run the node."""
    run_node("base_adapter", _body, priority=Priority.CONTROL)
