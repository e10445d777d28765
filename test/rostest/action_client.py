#!/usr/bin/env python3
"""A client of move_base on Debian's actionlib, driven by lines of JSON; says what it hears, each with a time.

{"send": [x, y, yaw]} by SimpleActionClient; with a fourth value, that frame; a list of four as yaw is a quaternion
{"goal": [id, x, y, yaw]} as a bare message on move_base/goal    {"cancel": null} by SimpleActionClient
{"cancel_id": [id, stamp]} as a bare message on move_base/cancel, stamp 0 or [s] ago
"""

import json
import math
import sys
import threading
import time

import actionlib
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus
from geometry_msgs.msg import PoseStamped, Twist
from move_base_msgs.msg import (
    MoveBaseAction,
    MoveBaseActionFeedback,
    MoveBaseActionGoal,
    MoveBaseActionResult,
    MoveBaseGoal,
    RecoveryStatus,
)

lock = threading.Lock()


def say(**what):
    with lock:
        print(json.dumps({"t": time.monotonic(), **what}), flush=True)


class Client(actionlib.SimpleActionClient):
    """Debian's drops a transition that comes before send_goal has returned, as on a busy machine: it waits here."""

    def __init__(self, *where):
        self.sending = threading.RLock()
        super().__init__(*where)

    def send_goal(self, *goal, **callbacks):
        with self.sending:
            super().send_goal(*goal, **callbacks)

    def _handle_transition(self, gh):
        with self.sending:
            super()._handle_transition(gh)


def make_goal(x, y, yaw, frame="map"):
    goal = MoveBaseGoal()
    pose = goal.target_pose
    pose.header.frame_id, pose.header.stamp = frame, rospy.Time.now()
    pose.pose.position.x, pose.pose.position.y = x, y
    q = yaw if isinstance(yaw, list) else [0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)]
    o = pose.pose.orientation
    o.x, o.y, o.z, o.w = q
    return goal


def on_result(message):
    status = message.status
    say(result=GoalStatus.to_string(status.status), id=status.goal_id.id, text=status.text)


def on_feedback(message):
    say(feedback=message.feedback.base_position.pose.position.x, frame=message.feedback.base_position.header.frame_id)


def main():
    rospy.init_node("client", anonymous=True, disable_signals=True)
    client = Client("move_base", MoveBaseAction)
    goals = rospy.Publisher("move_base/goal", MoveBaseActionGoal, queue_size=5)
    cancels = rospy.Publisher("move_base/cancel", GoalID, queue_size=5)
    rospy.Subscriber("move_base/result", MoveBaseActionResult, on_result, tcp_nodelay=True)
    rospy.Subscriber("move_base/feedback", MoveBaseActionFeedback, on_feedback, tcp_nodelay=True)
    rospy.Subscriber("/cmd_vel", Twist, lambda m: say(v=m.linear.x, w=m.angular.z), tcp_nodelay=True)
    rospy.Subscriber("move_base/recovery_status", RecoveryStatus, lambda m: say(recovery=m.recovery_behavior_name))
    rospy.Subscriber("move_base/current_goal", PoseStamped, lambda m: say(current=m.pose.position.x))
    say(ready=client.wait_for_server(rospy.Duration(40.0)))

    def done(status, _result):
        say(done=GoalStatus.to_string(status), text=client.get_goal_status_text())

    for line in sys.stdin:
        command = json.loads(line)
        count = command.pop("count")
        for name, value in command.items():
            say(count=count, command=name)
            if name == "send":
                goal = make_goal(*value)
                client.send_goal(goal, done_cb=done, active_cb=lambda: say(active=True))
            elif name == "cancel":
                client.cancel_goal()
            elif name == "goal":
                goal = MoveBaseActionGoal(
                    goal_id=GoalID(id=value[0], stamp=rospy.Time.now()), goal=make_goal(*value[1:])
                )
                goals.publish(goal)
            elif name == "cancel_id":
                stamp = rospy.Time.now() - rospy.Duration(value[1]) if value[1] is not None else rospy.Time(0)
                cancels.publish(GoalID(id=value[0], stamp=stamp))


main()
