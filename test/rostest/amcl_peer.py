"""What amcl has about it, as a process: odometry and a lidar in a square room, and an ear for what it says.

Reads commands as lines, answers each with a line of JSON: what came since the last one.
"""

import math
import time

import rospy
import tf2_ros
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped, Twist
from room_peer import ranges_at, serve, transform
from rosbot_patrol.msg import LocalizationHealth
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Empty, Trigger
from tf2_msgs.msg import TFMessage


class Peer:
    def __init__(self):
        self.poses, self.clouds, self.corrections = [], [], []
        self.x = 0.0
        self.sent = 0  # scans
        self.tf = tf2_ros.TransformBroadcaster()
        self.static = tf2_ros.StaticTransformBroadcaster()
        self.static.sendTransform(transform("base_link", "laser", 0.0, 0.0, 0.0, rospy.Time()))
        self.scan = rospy.Publisher("scan", LaserScan, queue_size=10)
        self.initial = rospy.Publisher("initialpose", PoseWithCovarianceStamped, queue_size=10)
        rospy.Subscriber("amcl_pose", PoseWithCovarianceStamped, self.poses.append)
        rospy.Subscriber("particlecloud", PoseArray, self.clouds.append)
        rospy.Subscriber("tf", TFMessage, self.hear_tf)
        self.turns, self.health, self.said = [], None, {}
        rospy.Subscriber("amcl/cmd_vel", Twist, lambda twist: self.turns.append(twist.angular.z))
        rospy.Subscriber("amcl/health", LocalizationHealth, self.hear_health)

    def hear_tf(self, message):
        self.corrections += [t for t in message.transforms if t.child_frame_id == "odom"]

    def wait_for_ears(self):
        """Until amcl hears scans and tf (this program hears its own tf, too)."""
        end = time.time() + 10.0
        while time.time() < end and not (self.scan.get_num_connections() and self.tf.pub_tf.get_num_connections() > 1):
            time.sleep(0.05)

    def drive(self, scans, step=0.0, broken="", frame="laser", range_max=8.0):
        self.wait_for_ears()
        for _ in range(scans):
            stamp = rospy.Time.now()
            self.tf.sendTransform(transform("odom", "base_link", 5.0 + self.x, 0.0, 0.0, stamp))
            message = LaserScan(angle_min=-math.pi, angle_max=math.pi, range_min=0.1, range_max=range_max)
            message.header.frame_id, message.header.stamp = frame, stamp
            ranges = ranges_at(self.x, 0.0)
            self.sent += 1
            broken_ranges = {"nan": [math.nan] * 180, "inf": [math.inf] * 180, "none": [], "few": ranges[:20]}
            ranges = broken_ranges.get(broken, ranges)
            message.ranges, message.angle_increment = ranges, 2 * math.pi / 179
            self.scan.publish(message)
            time.sleep(0.05)
            self.x += step

    def hear_health(self, message):
        self.health = message

    def late_scan(self, ago):
        """One that was taken before those that came."""
        stamp = rospy.Time.now() - rospy.Duration.from_sec(ago)
        message = LaserScan(angle_min=-math.pi, angle_max=math.pi, range_min=0.1, range_max=8.0)
        message.header.frame_id, message.header.stamp = "laser", stamp
        message.ranges, message.angle_increment = ranges_at(self.x, 0.0), 2 * math.pi / 179
        self.scan.publish(message)

    def relocalize(self):
        answer = rospy.ServiceProxy("amcl/relocalize", Trigger)()
        self.said = {"success": answer.success, "message": answer.message}
        end = time.time() + 10.0
        while time.time() < end and not any(self.turns):
            time.sleep(0.05)

    def reconfigure(self, **changes):
        self.said = dict(Client("amcl", timeout=10.0).update_configuration(changes))
        self.said.pop("groups", None)

    def wait_for_health(self, state):
        end = time.time() + 15.0
        while time.time() < end and (self.health is None or self.health.state != state):
            time.sleep(0.05)

    def initialpose(self, x, frame="map"):
        message = PoseWithCovarianceStamped()
        message.header.frame_id, message.pose.pose.position.x = frame, x
        message.pose.pose.orientation.w = 1.0
        message.pose.covariance[0] = message.pose.covariance[7] = message.pose.covariance[35] = 1e-4
        self.initial.publish(message)

    def call(self, service):
        rospy.ServiceProxy(service, Empty)()

    def settle(self):
        """Wait until what was sent has been answered, or for as long as a busy machine may take."""
        end, heard = time.time() + 2.0, -1
        while time.time() < end and (len(self.corrections) < self.sent or heard != len(self.corrections)):
            heard = len(self.corrections)
            time.sleep(0.3)
        self.sent = 0

    def report(self):
        self.settle()
        said = {"poses": len(self.poses), "tf": len(self.corrections), "x": self.x}
        if self.health is not None:
            said |= {"state": self.health.state, "belief": self.health.belief, "seeking": self.health.seeking}
        said |= {"turned": any(self.turns), "answer": self.said}
        if self.poses:
            last = self.poses[-1]
            said |= {"pose": last.pose.pose.position.x, "frame": last.header.frame_id, "var": last.pose.covariance[0]}
        if self.clouds:
            said["particles"] = len(self.clouds[-1].poses)
        if self.corrections:
            last = self.corrections[-1]
            said |= {"odom": last.transform.translation.x, "parent": last.header.frame_id}
        for heard in (self.poses, self.clouds, self.corrections, self.turns):
            heard.clear()
        return said


if __name__ == "__main__":
    serve("peer", Peer)
