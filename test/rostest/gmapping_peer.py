"""What slam_gmapping has about it, as a process: odometry and a lidar in a square room, and an ear for what it says.

Reads commands as lines, answers each with a line of JSON: what came since the last one.
"""

import math
import time

import numpy as np
import rospy
import tf2_ros
from nav_msgs.msg import MapMetaData, OccupancyGrid
from nav_msgs.srv import GetMap
from room_peer import ranges_at, serve, transform
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float64
from tf2_msgs.msg import TFMessage


class Peer:
    def __init__(self):
        self.maps, self.infos, self.entropies, self.corrections = [], [], [], []
        self.x = self.slip = 0.0
        self.tf = tf2_ros.TransformBroadcaster()
        self.static = tf2_ros.StaticTransformBroadcaster()
        level = transform("base_link", "laser", 0.0, 0.0, 0.0, rospy.Time())
        tilted = transform("base_link", "tilted", 0.0, 0.0, 0.0, rospy.Time())
        tilted.transform.rotation.x, tilted.transform.rotation.w = math.sin(0.5), math.cos(0.5)
        self.static.sendTransform([level, tilted])
        self.scan = rospy.Publisher("scan", LaserScan, queue_size=10)
        rospy.Subscriber("map", OccupancyGrid, self.maps.append)
        rospy.Subscriber("map_metadata", MapMetaData, self.infos.append)
        rospy.Subscriber("slam_gmapping/entropy", Float64, self.entropies.append)
        rospy.Subscriber("tf", TFMessage, self.hear_tf)

    def hear_tf(self, message):
        self.corrections += [t for t in message.transforms if t.child_frame_id == "odom"]

    def drive(self, scans, step=0.0, slip=0.0, broken="", frame="laser", back=0.0, range_max=8.0):
        for _ in range(scans):
            stamp = rospy.Time.now() - rospy.Duration.from_sec(back)
            self.tf.sendTransform(transform("odom", "base_link", self.x + self.slip, 0.0, 0.0, stamp))
            message = LaserScan(angle_min=-math.pi, angle_max=math.pi, range_min=0.1, range_max=range_max)
            message.header.frame_id, message.header.stamp = frame, stamp
            ranges = ranges_at(self.x, 0.0)
            broken_ranges = {"nan": [math.nan] * 180, "inf": [math.inf] * 180, "none": [], "few": ranges[:90]}
            message.ranges, message.angle_increment = broken_ranges.get(broken, ranges), 2 * math.pi / 179
            self.scan.publish(message)
            time.sleep(0.1)
            self.x += step
            self.slip += slip

    def call(self):
        try:
            answer = rospy.ServiceProxy("dynamic_map", GetMap)().map
            self.answer = [answer.info.width, answer.info.height, len(answer.data)]
        except rospy.ServiceException as err:
            self.answer = str(err)

    def report(self):
        time.sleep(0.4)
        said = {"maps": len(self.maps), "infos": len(self.infos), "tf": len(self.corrections), "x": self.x}
        if self.maps:
            last = self.maps[-1]
            cells = np.array(last.data)
            said |= {
                "frame": last.header.frame_id,
                "size": [last.info.width, last.info.height],
                "origin": [last.info.origin.position.x, last.info.origin.position.y],
                "walls": int((cells == 100).sum()),
                "free": int((cells == 0).sum()),
            }
        if self.entropies:
            said["entropy"] = self.entropies[-1].data
        if self.corrections:
            last = self.corrections[-1]
            ahead = (last.header.stamp - rospy.Time.now()).to_sec()
            said |= {"odom": last.transform.translation.x, "parent": last.header.frame_id, "ahead": ahead}
        said["answer"] = getattr(self, "answer", None)
        for heard in (self.maps, self.infos, self.entropies, self.corrections):
            heard.clear()
        return said


if __name__ == "__main__":
    serve("peer", Peer)
