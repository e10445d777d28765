import math

import pytest

from rosbot_patrol.control.mux import LockParams, MuxParams, SourceParams, TwistMux
from rosbot_patrol.errors import ParamError
from rosbot_patrol.geometry import STOP, Twist2D
from rosbot_patrol.params import load

AHEAD, BACK, TURN = Twist2D(0.3), Twist2D(-0.1), Twist2D(0.0, 0.0, 1.0)


def source(name, priority, timeout=0.5):
    return SourceParams(name=name, topic=f"/cmd_vel/{name}", priority=priority, timeout=timeout)


def mux(lock_timeout=0.0, lock_priority=255):
    lock = LockParams(name="e_stop", topic="/e_stop", priority=lock_priority, timeout=lock_timeout)
    topics = (source("move_base", 10), source("teleop", 30), source("patrol", 20))
    return TwistMux(MuxParams(topics=topics, locks=(lock,)))


def test_nobody_speaks():
    choice = mux().choose(1.0)
    assert (choice.source, choice.twist, choice.lock) == (None, STOP, None)


def test_the_highest_that_speaks_is_heard_and_gives_way_when_silent():
    it = mux()
    it.command("move_base", AHEAD, 0.0)
    assert it.choose(0.0).source == "move_base"
    it.command("teleop", BACK, 0.1)
    it.command("patrol", TURN, 0.4)
    assert it.choose(0.4).twist == BACK
    assert it.choose(0.7).twist == TURN
    assert it.choose(1.0).source is None


def test_a_command_is_fresh_once():
    it = mux()
    it.command("teleop", BACK, 0.0)
    assert it.choose(0.0).fresh
    assert not it.choose(0.1).fresh
    it.command("teleop", BACK, 0.2)
    assert it.choose(0.2).fresh


def test_a_source_that_has_gone_is_silent_until_it_speaks_again():
    it = mux()
    it.command("move_base", AHEAD, 0.0)
    it.command("teleop", BACK, 0.1)
    assert it.forget("teleop")
    assert not it.forget("patrol")  # had no say
    assert it.choose(0.1).source == "move_base"
    it.command("teleop", BACK, 0.2)
    assert it.choose(0.2).source == "teleop"


def test_a_lock_stops_everyone_below_it_until_released():
    it = mux(lock_priority=25)
    it.lock("e_stop", True, 0.0)
    it.command("patrol", AHEAD, 0.0)
    choice = it.choose(0.1)
    assert (choice.source, choice.twist, choice.lock) == (None, STOP, "e_stop")
    it.command("teleop", BACK, 0.1)
    assert it.choose(0.1).source == "teleop"
    it.lock("e_stop", False, 0.2)
    assert it.choose(0.2).source == "teleop"
    assert it.choose(0.45).source == "teleop"


def test_a_lock_with_a_time_out_holds_when_it_falls_silent():
    it = mux(lock_timeout=1.0)
    it.command("teleop", BACK, 0.0)
    assert it.choose(0.0).lock == "e_stop"
    it.lock("e_stop", False, 0.1)
    assert it.choose(0.2).source == "teleop"
    it.command("teleop", BACK, 1.2)
    assert it.choose(1.2).lock == "e_stop"


def test_time_that_goes_back_silences_everyone():
    it = mux()
    it.command("teleop", BACK, 100.0)
    assert it.choose(3.0).source is None
    it.command("teleop", BACK, 3.1)
    assert it.choose(3.2).source == "teleop"


def test_a_command_that_is_no_number_is_a_stop():
    it = mux()
    it.command("teleop", Twist2D(math.nan, 0.0, 0.0), 0.0)
    assert it.choose(0.0).twist == STOP


@pytest.mark.parametrize("topics", [(source("a", 1), source("a", 2)), (source("a", 1), source("b", 1))])
def test_doubles_are_refused(topics):
    with pytest.raises(ParamError, match="is given twice"):
        TwistMux(MuxParams(topics=topics))


def test_configuration_in_twist_mux_format():
    tree = {
        "topics": [{"name": "joy", "topic": "joy_vel", "timeout": 0.5, "priority": 100}],
        "locks": [{"name": "pause", "topic": "pause", "timeout": 0.0, "priority": 100}],
    }
    assert load(MuxParams, tree).topics[0] == SourceParams(name="joy", topic="joy_vel", priority=100)
    del tree["topics"][0]["priority"]
    with pytest.raises(ParamError, match=r"topics\[0\]/priority: is missing"):
        load(MuxParams, tree, name="FILE: ")
