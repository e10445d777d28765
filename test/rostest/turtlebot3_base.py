"""An emulated OpenCR of a TurtleBot3 on a pseudo-terminal, with the topics of Robotis' firmware.

usage: turtlebot3_base.py LINK

It tells each command that it gets, and drives on for ever like the real one.
"""

import io
import math
import sys
from pathlib import Path

import genpy
from geometry_msgs.msg import TransformStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Imu, JointState, MagneticField
from std_msgs.msg import Bool, Empty
from tf.msg import tfMessage

from rosbot_patrol.rosserial.device.client_session import DeviceSession, Message
from rosbot_patrol.rosserial.protocol.topics import FIRST_USER_ID, TopicInfo
from rosbot_patrol.simulation.devices.rosbot_base import FreeDrive
from rosbot_patrol.simulation.devices.serial_line import SerialLine, serve

PERIOD = 1.0 / 30.0  # [s]
SENT = {"imu": Imu, "cmd_vel_rc100": Twist, "odom": Odometry, "joint_states": JointState}
SENT |= {"battery_state": BatteryState, "magnetic_field": MagneticField, "/tf": tfMessage}
ORDERS = {"motor_power": Bool, "reset": Empty}
OWN = {"sensor_state": "turtlebot3_msgs/SensorState", "version_info": "turtlebot3_msgs/VersionInfo"}


def topic(number, name, kind):
    if isinstance(kind, str):  # a type that only Robotis' package has
        return TopicInfo(topic_id=number, name=name, message_type=kind, md5="0" * 32)
    return TopicInfo(topic_id=number, name=name, message_type=kind._type, md5=kind._md5sum)


class OpenCr:
    """The firmware's side of rosserial."""

    def __init__(self):
        self.drive = FreeDrive()
        listens = {"cmd_vel": Twist, "sound": "turtlebot3_msgs/Sound", **ORDERS}
        first = FIRST_USER_ID + 25
        self.publishers = {name: topic(first + at, name, kind) for at, (name, kind) in enumerate((OWN | SENT).items())}
        subscribers = [topic(FIRST_USER_ID + at, name, kind) for at, (name, kind) in enumerate(listens.items())]
        self.session = DeviceSession(list(self.publishers.values()), subscribers)
        self.due = 0.0

    def feed(self, data, now):
        for event in self.session.receive(data, now):
            if isinstance(event, Message) and event.topic_id == FIRST_USER_ID:
                command = Twist().deserialize(event.data)
                self.drive.pose(now)
                self.drive.command(command.linear.x, command.angular.z)
                print(f"command {command.linear.x:.3f} {command.angular.z:.3f}", flush=True)
        return b"".join(self.session.take_output())

    def stream(self, now):
        self.session.tick(now)
        stamp = self.session.server_time(now)
        if stamp is not None and now >= self.due:
            self.due = now + PERIOD
            self.publish(now, genpy.Time.from_sec(stamp))
        return b"".join(self.session.take_output())

    def publish(self, now, stamp):
        x, y, yaw = self.drive.pose(now)
        odometry = Odometry(child_frame_id="base_link")
        odometry.header.frame_id, odometry.header.stamp = "odom", stamp
        odometry.pose.pose.position.x, odometry.pose.pose.position.y = x, y
        turn = odometry.pose.pose.orientation
        turn.z, turn.w = math.sin(yaw / 2.0), math.cos(yaw / 2.0)
        transform = TransformStamped(header=odometry.header, child_frame_id="base_footprint")
        transform.transform.translation.x, transform.transform.translation.y = x, y
        transform.transform.rotation = turn
        volts = 12.1
        battery = BatteryState(voltage=volts, percentage=volts / 11.1, design_capacity=1.8, present=True)
        for name, message in {"odom": odometry, "/tf": tfMessage([transform]), "battery_state": battery}.items():
            data = io.BytesIO()
            message.serialize(data)
            self.session.publish(self.publishers[name].topic_id, data.getvalue())


def main():
    line = SerialLine(Path(sys.argv[1]))
    print("ready", flush=True)
    serve(OpenCr(), line, lambda: True, baud=115200)


main()
