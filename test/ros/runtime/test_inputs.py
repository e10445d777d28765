"""The newest value of an input, and whether it still counts."""

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.ros.runtime.latest import Latest


@pytest.mark.parametrize(
    ("now", "fresh"),
    [(10.0, True), (10.5, True), (10.51, False), (9.99, True), (9.0, False)],
    ids=["at once", "at the bound", "old", "came after now was read", "the clock went back"],
)
def test_a_value_is_fresh_for_its_time(now, fresh):
    latest = Latest()
    assert not latest.fresh(now, 0.5)
    latest.set("odometry", 10.0)
    assert latest.fresh(now, 0.5) is fresh
