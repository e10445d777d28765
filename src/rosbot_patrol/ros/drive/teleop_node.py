"""teleop_twist_keyboard: drives the robot from a terminal.

Matches teleop_twist_keyboard 1.0.0 for Noetic: keys, `cmd_vel` (queue 1), `~speed`, `~turn`, `~speed_limit`,
`~turn_limit`, `~repeat_rate`, `~key_timeout`, `~stamped`, `~frame_id`.

Differs:
- Without a terminal of its own, as under roslaunch, it logs that and waits, instead of ending with an error that causes
  respawns. roslaunch passes its own terminal on: upstream takes the keys there, also the Ctrl-C that should end the
  launch. In the background of a shell it waits until it is in the foreground.
- Typed by hand, it ends after 5 s without a ROS master.
- The terminal is restored however the program ends, and a zero velocity is sent.
"""

from __future__ import annotations

import os
import select
import sys
import termios
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager

import rospy
from geometry_msgs.msg import Twist, TwistStamped

from rosbot_patrol.control.teleop import CTRL_C, HELP, KeyTeleop, TeleopParams, Velocity
from rosbot_patrol.ros.runtime.node import Worker, load_params, run_node


class Sender:
    """Publish the last velocity, once or repeatedly."""

    def __init__(self, params: TeleopParams) -> None:
        self._params = params
        kind = TwistStamped if params.stamped else Twist
        self._publisher = rospy.Publisher("cmd_vel", kind, queue_size=1)
        self._lock = threading.Lock()
        self._velocity: Velocity | None = None
        if params.repeat_rate > 0.0:
            Worker(self._repeat, name="repeat").start()

    @property
    def has_listener(self) -> bool:
        """Whether someone subscribes."""
        is_heard: bool = self._publisher.get_num_connections() > 0
        return is_heard

    @property
    def topic(self) -> str:
        """The topic's name."""
        return str(self._publisher.resolved_name)

    def send(self, velocity: Velocity) -> None:
        """Publish a velocity."""
        with self._lock:
            self._velocity = velocity
            self._publish(velocity)

    def _repeat(self) -> None:
        while not rospy.is_shutdown():
            time.sleep(1.0 / self._params.repeat_rate)
            with self._lock:
                if self._velocity is not None and not rospy.is_shutdown():
                    self._publish(self._velocity)

    def _publish(self, velocity: Velocity) -> None:
        twist = Twist()
        twist.linear.x, twist.linear.y, twist.linear.z = velocity.x, velocity.y, velocity.z
        twist.angular.z = velocity.turn
        if not self._params.stamped:
            self._publisher.publish(twist)
            return
        stamped = TwistStamped(twist=twist)
        stamped.header.stamp, stamped.header.frame_id = rospy.Time.now(), self._params.frame_id
        self._publisher.publish(stamped)


def _has_keys() -> bool:
    """Whether typed keys are for this program: false without a terminal, under roslaunch or in the background."""
    try:
        return sys.stdin is not None and sys.stdin.isatty() and os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except (OSError, ValueError):  # a terminal of another session, a closed input
        return False


def _wait_for_keys() -> bool:
    """Wait for a terminal with keys; false at shutdown."""
    if not _has_keys():
        rospy.loginfo(
            "%s: no terminal here, so there are no keys to drive by; waiting. Run it in a terminal of its own:"
            " rosrun teleop_twist_keyboard teleop_twist_keyboard.py",
            rospy.get_name(),
        )
    while not rospy.is_shutdown():
        if _has_keys():
            return True
        time.sleep(0.5)
    return False


@contextmanager
def _single_keys() -> Iterator[None]:
    """Read keys one by one without echo, until the end of the block."""
    before = termios.tcgetattr(sys.stdin)
    tty.setraw(sys.stdin.fileno(), termios.TCSADRAIN)
    mode = termios.tcgetattr(sys.stdin)
    mode[1] = before[1]  # output processing stays on
    termios.tcsetattr(sys.stdin, termios.TCSADRAIN, mode)
    try:
        yield
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _read_key(timeout: float | None) -> str:
    """Read one key, "" after `timeout` [s] without one or at shutdown; the end of the input reads as Ctrl-C."""
    until = None if timeout is None else time.monotonic() + timeout
    while not rospy.is_shutdown():
        left = 0.2 if until is None else min(0.2, until - time.monotonic())
        if select.select([sys.stdin], [], [], max(left, 0.0))[0]:
            return os.read(sys.stdin.fileno(), 1).decode("ascii", errors="replace") or CTRL_C
        if until is not None and time.monotonic() >= until:
            return ""
    return CTRL_C


def _wait_for_listener(sender: Sender) -> bool:
    """Wait for a subscriber; false if the program should end."""
    is_printed = False
    while not sender.has_listener:
        if not is_printed:
            is_printed = True
            print(f"Waiting for subscriber to connect to {sender.topic}", flush=True)
        if _read_key(0.2) == CTRL_C:
            return False
    return True


def _drive(sender: Sender, params: TeleopParams) -> None:
    teleop = KeyTeleop(params)
    print(HELP + f"currently:\tspeed {teleop.speed:.3g}\tturn {teleop.turn:.3g}", flush=True)
    while True:
        key = _read_key(params.key_timeout or None)
        if key == CTRL_C:
            return
        velocity = teleop.press(key)
        if velocity is not None:
            sender.send(velocity)
        if teleop.note:
            print(teleop.note, flush=True)


def body() -> None:
    """Drive by keys until Ctrl-C."""
    params = load_params(TeleopParams)
    if not _wait_for_keys():
        return
    sender = Sender(params)
    with _single_keys():
        try:
            if _wait_for_listener(sender):
                _drive(sender, params)
        finally:
            sender.send(Velocity())
    time.sleep(0.1)  # another thread sends the zero
    rospy.signal_shutdown("Ctrl-C")


def main() -> None:
    """Run the node."""
    run_node("teleop_twist_keyboard", body, by_hand=True)
