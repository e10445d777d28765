"""Recording of a patrol: true poses of the robot and the actors, and the guard's messages."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, field

import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from move_base_msgs.msg import MoveBaseActionGoal
from nav_msgs.msg import Odometry
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from rosbot_patrol.campaign.truth import Track
from rosbot_patrol.geometry import Pose2D, distance
from rosbot_patrol.msg import Alert, Contacts, EspTrigger, PatrolState
from rosbot_patrol.ros.messages.convert import pose2d_from_pose
from rosbot_patrol.simulation.scenario.file import PLAYED


@dataclass
class State:
    """One state of the patrol, received at a simulated time [s]."""

    time: float
    message: PatrolState


@dataclass
class Recording:
    """Recorded messages. Times are simulated [s]."""

    robot: tuple[list[float], list[Pose2D]] = field(default_factory=lambda: ([], []))
    actors: dict[str, tuple[list[float], list[Pose2D]]] = field(default_factory=dict)
    states: list[State] = field(default_factory=list)
    alerts: list[tuple[float, Alert]] = field(default_factory=list)
    triggers: list[tuple[float, int]] = field(default_factory=list)
    goals: list[float] = field(default_factory=list)
    estimates: list[tuple[float, Pose2D]] = field(default_factory=list)
    contacts: list[tuple[float, str]] = field(default_factory=list)
    is_played: bool = False

    def robot_track(self) -> Track:
        """True poses of the robot."""
        return Track(*self.robot)

    def actor_tracks(self) -> dict[str, Track]:
        """True poses of the actors."""
        return {name: Track(*track) for name, track in self.actors.items()}

    def localisation(self) -> tuple[float, float] | None:
        """Mean and largest error of the estimated pose [m]."""
        track = self.robot_track()
        errors = [distance(truth, pose) for time, pose in self.estimates if (truth := _between(track, time))]
        return (sum(errors) / len(errors), max(errors)) if errors else None


def _between(track: Track, time: float) -> Pose2D | None:
    before = track.at(time)
    if before is None or time > track.times[-1]:
        return None
    return before


class CampaignWatch:
    """Recorder of the house's topics, from before its start to its end."""

    def __init__(self) -> None:
        self.heard = Recording()
        self.now = 0.0
        self._lock = threading.Lock()
        self._subscribers = [
            rospy.Subscriber("/ground_truth/odom", Odometry, self._on_robot, queue_size=100),
            rospy.Subscriber("/ground_truth/actors", TFMessage, self._on_actors, queue_size=100),
            rospy.Subscriber("/patrol/state", PatrolState, self._on_state, queue_size=100),
            rospy.Subscriber("/patrol/alerts", Alert, self._on_alert, queue_size=100),
            rospy.Subscriber("/motion_trigger", EspTrigger, self._on_trigger, queue_size=100),
            rospy.Subscriber("/move_base/goal", MoveBaseActionGoal, self._on_goal, queue_size=100),
            rospy.Subscriber("/amcl_pose", PoseWithCovarianceStamped, self._on_estimate, queue_size=100),
            rospy.Subscriber("/ground_truth/contacts", Contacts, self._on_contacts, queue_size=100),
            rospy.Subscriber("/simulator/scenario", String, self._on_act, queue_size=100),
        ]

    def stop(self) -> None:
        """Stop recording."""
        for subscriber in self._subscribers:
            subscriber.unregister()

    def _on_robot(self, message: Odometry) -> None:
        with self._lock:
            self.now = message.header.stamp.to_sec()
            self.heard.robot[0].append(self.now)
            self.heard.robot[1].append(pose2d_from_pose(message.pose.pose))

    def _on_actors(self, message: TFMessage) -> None:
        with self._lock:
            for placed in message.transforms:
                times, poses = self.heard.actors.setdefault(placed.child_frame_id, ([], []))
                at, turn = placed.transform.translation, placed.transform.rotation
                times.append(placed.header.stamp.to_sec())
                poses.append(Pose2D(at.x, at.y, 2.0 * math.atan2(turn.z, turn.w)))

    def _on_state(self, message: PatrolState) -> None:
        with self._lock:
            self.heard.states.append(State(message.header.stamp.to_sec(), message))

    def _on_alert(self, message: Alert) -> None:
        if message.kind == Alert.VERDICT:
            return  # the state reports it
        with self._lock:
            self.heard.alerts.append((message.header.stamp.to_sec(), message))

    def _on_trigger(self, message: EspTrigger) -> None:
        if message.move:
            with self._lock:
                self.heard.triggers.append((self.now, message.id))

    def _on_goal(self, message: MoveBaseActionGoal) -> None:
        with self._lock:
            self.heard.goals.append(self.now)

    def _on_estimate(self, message: PoseWithCovarianceStamped) -> None:
        with self._lock:
            self.heard.estimates.append((message.header.stamp.to_sec(), pose2d_from_pose(message.pose.pose)))

    def _on_contacts(self, message: Contacts) -> None:
        with self._lock:
            stamp = message.header.stamp.to_sec()
            self.heard.contacts += [(stamp, c.other) for c in message.contacts if c.kind != "floor"]

    def _on_act(self, message: String) -> None:
        if message.data == PLAYED:
            self.heard.is_played = True
