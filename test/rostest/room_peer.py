"""What the peers of amcl and slam_gmapping share: a square room's beams and transforms, and the orders of a test."""

import json
import math
import signal
import sys

import rospy
from geometry_msgs.msg import TransformStamped

HALF = 2.0  # of the room's edge [m]


def transform(parent, child, x, y, yaw, stamp):
    message = TransformStamped()
    message.header.frame_id, message.child_frame_id, message.header.stamp = parent, child, stamp
    message.transform.translation.x, message.transform.translation.y = x, y
    message.transform.rotation.z, message.transform.rotation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return message


def ranges_at(x, y, count=180):
    found = []
    for k in range(count):
        c, s = math.cos(-math.pi + 2 * math.pi * k / (count - 1)), math.sin(-math.pi + 2 * math.pi * k / (count - 1))
        wall_x = ((HALF - x) / c) if c > 1e-9 else ((-HALF - x) / c if c < -1e-9 else math.inf)
        wall_y = ((HALF - y) / s) if s > 1e-9 else ((-HALF - y) / s if s < -1e-9 else math.inf)
        found.append(min(wall_x, wall_y))
    return found


def serve(name, make_peer):
    """Be a node; read orders as lines of JSON ("do" and its arguments), answer each with what came since the last."""
    rospy.init_node(name, disable_signals=True)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # a read of stdin does not hold up the end
    peer = make_peer()
    print(json.dumps({"ready": True}), flush=True)
    for line in sys.stdin:
        order = json.loads(line)
        getattr(peer, order.pop("do"))(**order)
        print(json.dumps(peer.report()), flush=True)
