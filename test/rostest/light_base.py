#!/usr/bin/env python3
"""A base for move_base's tests in place of simulator, amcl and map_server: it drives as told in a field that is empty.

It publishes the map (100 m x 100 m, a square of walls 4 m off at (4, 4) that nothing leads into), /odom, tf and a scan
that hits nothing, and obeys /cmd_vel for half a second. ~silent: topics not to publish. ~blind: all beams are 0.
"""

import math
import threading

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import Quaternion, TransformStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import LaserScan

SIZE, RESOLUTION, ORIGIN = 2000, 0.05, -50.0
CELL = 4.0  # middle of the closed square, in x and y [m]


def make_map():
    cells = np.zeros((SIZE, SIZE), dtype=np.int8)
    low, high = (int((CELL + d - ORIGIN) / RESOLUTION) for d in (-1.0, 1.0))
    cells[low : high + 1, low : high + 1] = 100
    cells[low + 2 : high - 1, low + 2 : high - 1] = 0
    message = OccupancyGrid()
    message.header.frame_id = "map"
    message.info.resolution, message.info.width, message.info.height = RESOLUTION, SIZE, SIZE
    message.info.origin.position.x = message.info.origin.position.y = ORIGIN
    message.info.origin.orientation.w = 1.0
    message.data = cells.ravel().tolist()
    return message


class Base:
    def __init__(self):
        self.x = self.y = self.yaw = 0.0
        self.twist, self.heard = Twist(), rospy.Time(0)
        self.ticks, self.lock = 0, threading.Lock()
        self.tf = tf2_ros.TransformBroadcaster()
        self.odom = rospy.Publisher("/odom", Odometry, queue_size=5)
        self.scan = rospy.Publisher("/scan", LaserScan, queue_size=5)
        self.map = rospy.Publisher("/map", OccupancyGrid, queue_size=1, latch=True)
        self.map.publish(make_map())
        rospy.Subscriber("/cmd_vel", Twist, self.drive, queue_size=1, tcp_nodelay=True)
        rospy.Timer(rospy.Duration(0.02), self.tick)

    def drive(self, twist):
        self.twist, self.heard = twist, rospy.Time.now()

    def tick(self, event):
        with self.lock:
            now = rospy.Time.now()
            if (now - self.heard).to_sec() > 0.5:
                self.twist = Twist()
            dt = 0.02
            self.yaw += self.twist.angular.z * dt
            self.x += math.cos(self.yaw) * self.twist.linear.x * dt
            self.y += math.sin(self.yaw) * self.twist.linear.x * dt
            silent = rospy.get_param_cached("~silent", [])
            rotation = Quaternion(0.0, 0.0, math.sin(self.yaw / 2.0), math.cos(self.yaw / 2.0))
            places = [
                ("map", "odom", 0.0, 0.0, Quaternion(0, 0, 0, 1)),
                ("odom", "base_link", self.x, self.y, rotation),
            ]
            self.tf.sendTransform([transform(now, *place) for place in places])
            if "odom" not in silent:
                message = Odometry(child_frame_id="base_link")
                message.header.stamp, message.header.frame_id = now, "odom"
                message.pose.pose.position.x, message.pose.pose.position.y = self.x, self.y
                message.pose.pose.orientation = rotation
                message.twist.twist = self.twist
                self.odom.publish(message)
            self.ticks += 1
            if self.ticks % 5 == 0 and "scan" not in silent:
                message = LaserScan(angle_min=-math.pi, angle_max=math.pi, angle_increment=math.tau / 180)
                message.header.stamp, message.header.frame_id = now, "base_link"
                beam = 0.0 if rospy.get_param_cached("~blind", False) else math.inf
                message.range_min, message.range_max, message.ranges = 0.1, 12.0, [beam] * 181
                self.scan.publish(message)


def transform(stamp, parent, child, x, y, rotation):
    message = TransformStamped(child_frame_id=child)
    message.header.stamp, message.header.frame_id = stamp, parent
    message.transform.translation.x, message.transform.translation.y = x, y
    message.transform.rotation = rotation
    return message


rospy.init_node("light_base")
Base()
rospy.spin()
