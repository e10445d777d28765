"""Client of move_base's action, which also detects whether the server is alive."""

from __future__ import annotations

import threading
import time

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatusArray
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal

from rosbot_patrol.goal import SILENCE, Goal, GoalLink, ending_text, goal_state
from rosbot_patrol.ros.messages import convert


class MoveBase:
    """Send goals to the action server `move_base` and report their state.

    Args:
        frame: frame of the goals.
        silence: silence of its status after which the server counts as down [s], wall time.
    """

    def __init__(self, frame: str = "map", silence: float = SILENCE) -> None:
        self._frame = frame
        self._silence = silence
        self._client = actionlib.SimpleActionClient("move_base", MoveBaseAction)
        self._lock = threading.Lock()
        self._heard = float("-inf")
        self._tag = ""
        rospy.Subscriber("move_base/status", GoalStatusArray, self._on_status, queue_size=1)

    def _on_status(self, _: GoalStatusArray) -> None:
        self._heard = time.monotonic()

    @property
    def is_up(self) -> bool:
        """Whether the server is alive and receives our messages."""
        client = self._client.action_client
        connected = all(
            end.get_num_connections() > 0
            for end in (client.pub_goal, client.pub_cancel, client.result_sub, client.status_sub)
        )
        return connected and time.monotonic() - self._heard < self._silence

    def link(self) -> GoalLink:
        """State of server and goal."""
        with self._lock:
            if not self._tag:
                return GoalLink(is_up=self.is_up)
            state = self._client.get_state()
            text = self._client.get_goal_status_text() or ending_text(state)
            return GoalLink(is_up=self.is_up, tag=self._tag, state=goal_state(state), text=text)

    def send(self, goal: Goal) -> None:
        """Send a goal; the previous one is dropped."""
        message = MoveBaseGoal()
        message.target_pose = convert.pose_to_msg(goal.pose, self._frame, rospy.get_time())
        with self._lock:
            self._client.send_goal(message)
            self._tag = goal.tag

    def cancel(self) -> None:
        """Cancel the goal, if there is one."""
        with self._lock:
            if self._tag:
                self._client.cancel_goal()

    def cancel_all(self) -> None:
        """Cancel every goal of the server, whoever sent it."""
        self._client.cancel_all_goals()
