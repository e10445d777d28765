"""`goal` knows the numbers of actionlib_msgs/GoalStatus without ROS."""

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from actionlib_msgs.msg import GoalStatus

from rosbot_patrol.goal import GoalState, ending_text, goal_state


@pytest.mark.parametrize("name", ["PENDING", "ACTIVE", "PREEMPTING", "RECALLING"])
def test_a_goal_is_under_way(name: str) -> None:
    assert goal_state(getattr(GoalStatus, name)) is GoalState.ACTIVE
    assert ending_text(getattr(GoalStatus, name)) == ""


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("PREEMPTED", "the goal was given up for another"),
        ("REJECTED", "the goal was rejected"),
        ("RECALLED", "the goal was called back"),
        ("LOST", "the goal was lost"),
        ("ABORTED", ""),
    ],
)
def test_a_goal_has_failed(name: str, text: str) -> None:
    assert goal_state(getattr(GoalStatus, name)) is GoalState.FAILED
    assert ending_text(getattr(GoalStatus, name)) == text


def test_a_goal_has_succeeded() -> None:
    assert goal_state(GoalStatus.SUCCEEDED) is GoalState.SUCCEEDED
    assert ending_text(GoalStatus.SUCCEEDED) == ""
