"""What the simulator publishes: the time, the ground truth, and the robot's readings."""

from __future__ import annotations

import math

import rospy
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from rosbot_patrol.msg import Contacts
from rosbot_patrol.ros.messages.convert import time_to_msg, transform_to_msg
from rosbot_patrol.ros.simulator import messages
from rosbot_patrol.ros.simulator.pace import SharedClock
from rosbot_patrol.ros.simulator.readings import Due, RateParams, Readings
from rosbot_patrol.simulation.engine import STEP, Engine

TICK = 0.01  # period of /clock [s]
STEPS_PER_TICK = round(TICK / STEP)


class Outputs:
    """Time and ground truth, and the robot's readings where they come as messages; `publish(tick)` sends what is due.

    Only the simulation's thread calls it.

    Args:
        engine: the simulated world.
        rates: publishing rates.
        readings: of the robot; None: they go over the wires of emulated devices.
        shared: clock of another node; None: this node publishes /clock.
    """

    def __init__(
        self, engine: Engine, rates: RateParams, readings: Readings | None, *, shared: SharedClock | None = None
    ) -> None:
        self._engine, self._shared = engine, shared
        self._touching = False
        self._clock = rospy.Publisher("/clock", Clock, queue_size=1) if shared is None else None
        self._truth = rospy.Publisher("ground_truth/odom", Odometry, queue_size=1)
        self._contacts = rospy.Publisher("ground_truth/contacts", Contacts, queue_size=10)
        self._actors = rospy.Publisher("ground_truth/actors", TFMessage, queue_size=10)
        self._due: list[Due] = [(rates.ground_truth, 0, self._send_truth), (rates.actors, 0, self._send_actors)]
        if readings is not None:
            self._due = readings.due + self._due

    def publish(self, tick: int) -> None:
        """Send the time and the messages due at a tick; nothing after the node has been told to end."""
        try:
            self._publish(tick)
        except rospy.ROSException:  # a topic has been closed
            if not rospy.is_shutdown():
                raise

    def _publish(self, tick: int) -> None:
        now = self._engine.now + (self._shared.ahead if self._shared else 0.0)
        if self._clock is not None:
            self._clock.publish(Clock(time_to_msg(now)))
        if not self._engine.has_robot:
            return
        self._send_contacts(now)
        for rate, offset, send in self._due:
            if is_due(tick - offset, rate):
                send(now)

    def _send_truth(self, now: float) -> None:
        if self._truth.get_num_connections():
            robot = self._engine.robot.description
            self._truth.publish(
                messages.odometry_msg(
                    self._engine.pose, self._engine.twist, now, "map", z=robot.base_height, child=robot.base, exact=True
                )
            )

    def _send_actors(self, now: float) -> None:
        if self._actors.get_num_connections():
            actors = self._engine.population.walkers
            self._actors.publish(TFMessage([transform_to_msg(a.pose, "map", a.name, now) for a in actors]))

    def _send_contacts(self, now: float) -> None:
        if not self._contacts.get_num_connections():
            return
        touches = self._engine.touches()
        if touches or self._touching:
            self._contacts.publish(messages.contacts_msg(touches, now, self._engine.robot.description.base))
        self._touching = bool(touches)


def is_due(tick: int, rate: float) -> bool:
    """Whether a message of a rate [Hz] is due at a tick: the first at or after each whole period."""
    per_tick = rate * TICK
    return math.floor(tick * per_tick + 1e-9) > math.floor((tick - 1) * per_tick + 1e-9)
