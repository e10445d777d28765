#!/usr/bin/env python3
"""A real action server that ends its n-th goal as a bag's n-th ended: the bag's results come on /recorded/result."""

import threading

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from move_base_msgs.msg import MoveBaseAction, MoveBaseActionResult, MoveBaseResult


class Recorded:
    def __init__(self):
        self.results, self.begun = [], 0
        self.changed = threading.Condition()
        rospy.Subscriber("/recorded/result", MoveBaseActionResult, self.hear, queue_size=100)
        self.server = actionlib.SimpleActionServer("move_base", MoveBaseAction, self.go, auto_start=False)
        self.server.start()

    def hear(self, result):
        with self.changed:
            self.results.append(result.status)
            self.changed.notify_all()

    def go(self, goal):
        number, self.begun = self.begun, self.begun + 1
        with self.changed:
            while len(self.results) <= number and not (rospy.is_shutdown() or self.server.is_preempt_requested()):
                self.changed.wait(0.05)
        if len(self.results) <= number:
            self.server.set_preempted(MoveBaseResult(), "given up")
        elif self.results[number].status == GoalStatus.SUCCEEDED:
            self.server.set_succeeded(MoveBaseResult(), self.results[number].text)
        else:
            self.server.set_aborted(MoveBaseResult(), self.results[number].text)


rospy.init_node("move_base")
Recorded()
print("ready", flush=True)
rospy.spin()
