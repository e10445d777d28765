#!/usr/bin/env python3
"""A small real move_base for tests: an actionlib server that glides the robot to its goal, and turns it by /cmd_vel.

Parameters: ~speed [m/s], ~refuse [list of rounded "x,y" goals that it aborts].
Topic /test/lost (std_msgs/Bool): whether the localisation is dead, so that nothing tells map -> odom.
"""

import math
import threading

import actionlib
import rospy
import tf2_ros
from geometry_msgs.msg import Quaternion, TransformStamped, Twist
from move_base_msgs.msg import MoveBaseAction, MoveBaseResult
from std_msgs.msg import Bool


class Robot:
    def __init__(self):
        self.x = self.y = self.yaw = self.wz = 0.0
        self.speed = rospy.get_param("~speed", 4.0)
        self.refuse = rospy.get_param("~refuse", [])
        self.wheels_heard = rospy.Time(0)
        self.lock = threading.Lock()
        self.tf = tf2_ros.TransformBroadcaster()
        self.is_lost = False
        rospy.Subscriber("/cmd_vel", Twist, self.drive, queue_size=1)
        rospy.Subscriber("/test/lost", Bool, self.lose, queue_size=1)
        rospy.Timer(rospy.Duration(0.02), self.tick)
        self.server = actionlib.SimpleActionServer("move_base", MoveBaseAction, self.go, auto_start=False)
        self.server.start()

    def drive(self, twist):
        self.wz, self.wheels_heard = twist.angular.z, rospy.Time.now()

    def lose(self, message):
        self.is_lost = message.data

    def tick(self, event):
        now = rospy.Time.now()
        with self.lock:
            if (now - self.wheels_heard).to_sec() > 0.5:
                self.wz = 0.0
            dt = (event.current_real - event.last_real).to_sec() if event.last_real else 0.0
            self.yaw += self.wz * dt
            half = self.yaw / 2.0
            rotation = Quaternion(0.0, 0.0, math.sin(half), math.cos(half))
        for parent, child, place in (("map", "odom", None), ("odom", "base_link", rotation)):
            if parent == "map" and self.is_lost:
                continue
            message = TransformStamped(child_frame_id=child)
            message.header.frame_id, message.header.stamp = parent, now
            message.transform.rotation = place or Quaternion(0, 0, 0, 1)
            if place:
                message.transform.translation.x, message.transform.translation.y = self.x, self.y
            self.tf.sendTransform(message)

    def go(self, goal):
        target = goal.target_pose.pose.position
        if f"{target.x:.0f},{target.y:.0f}" in self.refuse:
            rospy.sleep(0.1)
            self.server.set_aborted(
                MoveBaseResult(), "Failed to find a valid plan. Even after executing recovery behaviors."
            )
            return
        while not rospy.is_shutdown():
            if self.server.is_preempt_requested():
                self.server.set_preempted(MoveBaseResult(), "cancelled")
                return
            left = math.hypot(target.x - self.x, target.y - self.y)
            step = self.speed * 0.05
            if left <= step:
                self.x, self.y = target.x, target.y
                self.server.set_succeeded(MoveBaseResult(), "Goal reached.")
                return
            self.x += (target.x - self.x) / left * step
            self.y += (target.y - self.y) / left * step
            rospy.sleep(0.05)


rospy.init_node("move_base")
Robot()
rospy.spin()
