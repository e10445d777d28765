"""The action check_for_objects: each picture sent is answered with its own boxes."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

import actionlib
from darknet_ros_msgs.msg import BoundingBoxes, CheckForObjectsAction, CheckForObjectsResult
from std_msgs.msg import Header

from rosbot_patrol.images.encodings import Picture
from rosbot_patrol.ros.messages.images import picture_from_msg

MOST_PENDING = 10


class Goal:
    """A picture to examine, and the client to answer."""

    def __init__(self, handle: actionlib.ServerGoalHandle) -> None:
        self._handle = handle
        self._lock = threading.Lock()
        self._over = False

    def is_of(self, handle: actionlib.ServerGoalHandle) -> bool:
        """Whether this goal has the given handle."""
        return bool(self._handle == handle)

    def picture(self) -> tuple[Picture, Header]:
        """The picture and its header; ImageError if it cannot be decoded."""
        image = self._handle.get_goal().image
        return picture_from_msg(image), image.header

    def finish(self, boxes: BoundingBoxes) -> None:
        """Send the answer, unless the goal was cancelled meanwhile."""
        result = CheckForObjectsResult(id=self._handle.get_goal().id, bounding_boxes=boxes)
        self._end(lambda: self._handle.set_succeeded(result))

    def abort(self, reason: str) -> None:
        """Answer that the goal cannot be done."""
        self._end(lambda: self._handle.set_aborted(text=reason))

    def cancel(self) -> None:
        """Cancel: the client no longer wants an answer; the goal is preempted."""
        self._end(self._handle.set_canceled)

    def _end(self, answer: Callable[[], None]) -> None:
        with self._lock:
            if self._over:
                return
            self._over = True
            answer()
            # actionlib keeps a goal in a reference cycle until Python's collector runs: 1 MB each with its picture
            self._handle.get_goal().image.data = b""

    @property
    def over(self) -> bool:
        """Whether no answer is needed any more."""
        return self._over


class CheckForObjects:
    """The action server; keeps goals until the detector takes them.

    Args:
        name: name of the action.
        notify: called when a goal has come.
    """

    def __init__(self, name: str, notify: Callable[[], None]) -> None:
        self._lock = threading.Lock()
        self._goals: deque[Goal] = deque()
        self._current: Goal | None = None
        self._notify = notify
        self._server = actionlib.ActionServer(
            name, CheckForObjectsAction, self._on_goal, self._on_cancel, auto_start=False
        )
        self._server.start()

    @property
    def pending(self) -> bool:
        """Whether a goal is waiting."""
        return bool(self._goals)

    def take(self) -> Goal | None:
        """Take the oldest goal that still wants an answer."""
        with self._lock:
            while self._goals:
                goal = self._goals.popleft()
                if not goal.over:
                    self._current = goal
                    return goal
        return None

    def _on_goal(self, handle: actionlib.ServerGoalHandle) -> None:
        with self._lock:
            if len(self._goals) >= MOST_PENDING:
                handle.set_rejected(text=f"{MOST_PENDING} pictures wait already")
                return
            handle.set_accepted()
            self._goals.append(Goal(handle))
        self._notify()

    def _on_cancel(self, handle: actionlib.ServerGoalHandle) -> None:
        with self._lock:
            goals = [*self._goals, *([self._current] if self._current else [])]
        for goal in goals:
            if goal.is_of(handle):
                goal.cancel()
