"""A recorded patrol, judged by the truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbot_patrol.msg", reason="the workspace is not on the path: `. scripts/env`")
import rospy
from rosbot_patrol.msg import Alert, PatrolState

from rosbot_patrol.campaign.cast import Person
from rosbot_patrol.campaign.houses.files import house_files, load_house
from rosbot_patrol.campaign.plan import Patrol
from rosbot_patrol.campaign.record import Result
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.ros.campaign.evaluation import Run, evaluate
from rosbot_patrol.ros.campaign.watch import Recording, State

ROOT = Path(__file__).parents[3]
FLAT = house_files("flat", ROOT)
POINT, PLACE = (3.10, 3.15), (4.3, 3.15)


@pytest.fixture(scope="module")
def patrol() -> Patrol:
    assert load_house(FLAT).rooms.find(1) is not None
    return Patrol(
        number=4, seed=1, kind="standing", house="flat", room=1, room_name="living room", expected="confirmed",
        scenario={"title": "somebody"}, people=(Person(name="bob"),),
    )  # fmt: skip


def state(time: float, name: str, mission: str = "m1", **changes: Any) -> State:
    message = PatrolState(state=name, mission=mission, room_id=1 if mission else 0, share_seen=-1.0)
    for field, value in changes.items():
        setattr(message, field, value)
    message.header.stamp = rospy.Time.from_sec(time)
    return State(time, message)


def recording(*, seen_at: float | None, verdict: str, after: str = "") -> Recording:
    """Turns in the room from 20 s to 30 s, where Bob stands all the time."""
    heard = Recording(triggers=[(2.0, 1)], goals=[2.1], estimates=[(10.0, Pose2D(*POINT, 0.05))])
    times = [float(t) for t in np.arange(0.0, 50.0, 0.05)]
    turn = [Pose2D(*POINT, 0.63 * (min(max(t, 20.0), 30.0) - 20.0) - 2.0) for t in times]
    heard.robot = times, turn
    heard.actors = {"bob": (times[::4], [Pose2D(*PLACE, 0.0)] * len(times[::4]))}
    heard.states = [
        state(0.5, PatrolState.IDLE, ""),
        state(2.1, PatrolState.DRIVING),
        state(20.0, PatrolState.LOOKING),
        state(30.0, PatrolState.RETURNING, share_seen=0.9),
        state(45.0, PatrolState.IDLE, after, last_verdict=verdict, why="on guard, at home again"),
    ]
    for kind, when in ((Alert.SEEN, seen_at), (Alert.DELIVERED, seen_at), (Alert.VERDICT, 30.0)):
        if when is not None:
            heard.alerts.append((when, Alert(id="m1", kind=kind)))
    return heard


def judged(patrol: Patrol, heard: Recording, folder: Path, **changes: Any) -> Result:
    given: dict[str, Any] = {"problem": "", "mails": ["m1"], "contacts": [], "wall_s": 60.0}
    return evaluate(patrol, heard, FLAT, folder, Run(**{**given, **changes}))


def test_who_was_found_was_found_in_time(patrol: Patrol, tmp_path: Path) -> None:
    result = judged(patrol, recording(seen_at=24.0, verdict="confirmed"), tmp_path)
    assert result.failures == ()
    assert result.detected
    assert result.times["goal"] == pytest.approx(0.1)
    assert result.times["notice"] == pytest.approx(22.0)
    assert result.times["seen_to_notice"] == pytest.approx(1.6, abs=0.5)
    assert result.times["home"] == pytest.approx(43.0)
    assert result.share_told == pytest.approx(0.9)
    assert result.share_true is not None
    assert 0.8 < result.share_true <= 1.0
    assert result.home


def test_mails_of_a_later_mission_are_not_this_one_s(patrol: Patrol, tmp_path: Path) -> None:
    heard = recording(seen_at=24.0, verdict="confirmed")
    assert judged(patrol, heard, tmp_path, mails=["m1", "m1.2", "other"]).mails == 2
    assert judged(patrol, heard, tmp_path, mails=["other"]).failures == ("0 mails",)


def test_who_was_in_view_and_not_found_was_missed(patrol: Patrol, tmp_path: Path) -> None:
    result = judged(patrol, recording(seen_at=None, verdict="clear"), tmp_path, mails=[])
    assert result.failures == ("missed",)
    assert result.in_view == pytest.approx(1.6, abs=0.5)


def test_whose_robot_goes_on_to_another_room_does_not_have_to_be_home(patrol: Patrol, tmp_path: Path) -> None:
    result = judged(patrol, recording(seen_at=24.0, verdict="confirmed", after="m2"), tmp_path)
    assert result.home is None
    assert result.failures == ()


def test_a_house_that_never_came_up_is_a_problem_and_nothing_else(patrol: Patrol, tmp_path: Path) -> None:
    result = judged(patrol, Recording(), tmp_path, problem="roslaunch ended", mails=[])
    assert result.failures == ("roslaunch ended",)
    assert result.verdict == ""
    assert result.share_true is None


def test_a_touch_is_told_with_who_moved(patrol: Patrol, tmp_path: Path) -> None:
    heard = recording(seen_at=24.0, verdict="confirmed")
    heard.contacts = [(35.0, "bob"), (35.1, "bob"), (40.0, "bob")]
    result = judged(patrol, heard, tmp_path, contacts=["bob", "bob", "bob"])
    first, second = result.touches
    assert first == "bob at 35.0 s, the robot at (3.10, 3.15), at 0.00 m/s, bob at 0.00 m/s"
    assert second.startswith("bob at 40.0 s")
    assert result.failures == (f"touched {first}; {second}",)
