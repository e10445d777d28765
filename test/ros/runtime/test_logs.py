"""A log line waits for nobody: rospy's question to the master is answered beforehand."""

import logging

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

import rospy
import rospy.client
import rospy.impl.paramserver
import rospy.impl.rosout
from rospy.msproxy import MasterProxy

from rosbot_patrol.ros.runtime import logs


def test_a_kind_of_line_comes_once_in_a_while_and_tells_how_often_it_was_held_back() -> None:
    repeats = logs.LineThrottle(10.0)
    said = [repeats.due("no trajectory", 0.3 * k) for k in range(40)]
    assert [text for text in said if text is not None] == ["", " (and 33 times before)"]
    assert repeats.due("no map", 5.0) == ""


def test_a_clock_that_goes_back_holds_nothing_back() -> None:
    repeats = logs.LineThrottle(10.0)
    assert repeats.due("no map", 100.0) == ""
    assert repeats.due("no map", 101.0) is None
    assert repeats.due("no map", 3.0) == " (and 1 time before)"


class _Master:
    """The master's parameters, and the questions that came."""

    def __init__(self, **given):
        self.given = {f"/{key}": value for key, value in given.items()}
        self.asked: list[str] = []

    def getParam(self, _caller, name):
        self.asked.append(name)
        return (1, "", self.given[name]) if name in self.given else (-1, "is not set", 0)

    def subscribeParam(self, _caller, _uri, name):
        self.asked.append(name)
        return 1, "", self.given.get(name, {})


class _Rosout:
    """Takes what rospy publishes on /rosout, and stands for the node's topics."""

    def __init__(self):
        self.lines = []

    def publish(self, line):
        self.lines.append(line)

    @staticmethod
    def get_topics():
        return ["/scan"]


class _Time:
    now = rospy.Time


@pytest.fixture
def start(monkeypatch):
    """Start logging as a node does; returns the master and what came on /rosout."""
    package = logging.getLogger("rosbot_patrol")
    before, level, propagate = package.handlers[:], package.level, package.propagate

    def begin(**given):
        proxy = MasterProxy("http://localhost:1")
        proxy.target = _Master(**given)
        rosout = _Rosout()
        monkeypatch.setattr(rospy.client, "_param_server", proxy)
        monkeypatch.setattr(rospy.impl.paramserver, "_param_server_cache", None)
        monkeypatch.setattr(rospy.impl.rosout, "_rosout_pub", rosout)
        monkeypatch.setattr(rospy.impl.rosout, "get_topic_manager", lambda: rosout)
        monkeypatch.setattr(rospy.impl.rosout, "Time", _Time)
        rospy.impl.rosout.load_rosout_handlers(None)
        package.handlers[:] = []
        logs.install()
        return proxy.target, rosout

    handlers = logging.getLogger("rosout").handlers[:]
    yield begin
    logging.getLogger("rosout").handlers[:] = handlers
    package.handlers[:], package.propagate = before, propagate
    package.setLevel(level)


def test_no_line_asks_the_master(start):
    master, rosout = start()
    asked = len(master.asked)
    for number in range(20):
        logging.getLogger("rosbot_patrol.patrol").warning("line %d", number)
        rospy.logwarn("line %d of rospy", number)
    assert len(rosout.lines) == 40
    assert len(master.asked) == asked == 1


@pytest.mark.parametrize("given", [True, False])
def test_a_parameter_set_before_the_start_counts(start, given):
    master, rosout = start(rosout_disable_topics_generation=given)
    logging.getLogger("rosbot_patrol.patrol").warning("a line")
    assert list(rosout.lines[0].topics) == ([] if given else ["/scan"])
    assert len(master.asked) == 1


def test_other_parameters_are_still_asked_for(start):
    master, _ = start(use_sim_time=True)
    assert rospy.get_param("/use_sim_time") is True
    assert "/use_sim_time" in master.asked
