"""Which rooms sensor_watch takes for guarded: by the patrol's word, and all of them where there is none that holds."""

from __future__ import annotations

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.msg import Arming as ArmingMsg

from rosbot_patrol.ros.sensors.watch_node import SensorWatch
from rosbot_patrol.sensors.sensor_file import SensorList
from rosbot_patrol.sensors.settings import WatchTimes
from rosbot_patrol.sensors.supervisor import Supervisor


def node() -> SensorWatch:
    """One without a master."""
    made = SensorWatch.__new__(SensorWatch)
    made._guarded, made._muted = None, frozenset()
    made._watch = Supervisor(SensorList(None, {1: "hall", 2: "attic"}, "none"), WatchTimes(), 100.0)
    return made


@pytest.mark.parametrize(
    ("message", "guarded"),
    [
        (None, {1, 2}),  # no patrol was heard yet
        (ArmingMsg(mode="armed_away", all_rooms=True), {1, 2}),
        (ArmingMsg(mode="armed_away", rooms=b"", exit_delay=20.0), set()),
        (ArmingMsg(mode="armed_home", rooms=bytes([2])), {2}),
        (ArmingMsg(mode="disarmed"), set()),
        (ArmingMsg(mode="armed_away", all_rooms=True, muted=bytes([1])), {2}),
    ],
)
def test_the_patrols_word_holds_while_it_lives(message: ArmingMsg | None, guarded: set[int]) -> None:
    watch = node()
    if message is not None:
        watch._on_arming(message)
    assert {room for room in (1, 2) if watch._is_guarded(room)} == guarded
    assert watch._is_guarded(None)  # a sensor without a room


def test_the_word_of_a_patrol_that_has_gone_holds_no_more_until_it_is_back() -> None:
    watch = node()
    watch._on_arming(ArmingMsg(mode="disarmed"))
    now = 100.0
    watch._watch.patrol_heard("/patrol", now)
    states = []
    for second in range(1, 60):
        now = 100.0 + second
        if second > 40:
            watch._watch.patrol_heard("/patrol", now)
        watch._watch.tick(now)
        states.append(watch._is_guarded(1))
    assert not states[5]
    assert states[30]
    assert not states[-1]
