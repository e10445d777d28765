"""Which mission runs when, and what ends it: priorities, own motion, people's orders, battery, stop, arming, clocks."""

import dataclasses
import json
import math

import pytest
from belief_pictures import good_network
from patrol_world import ROOMS, World, looking, phase

from rosbot_patrol.errors import ParamError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.goal import GoalLink
from rosbot_patrol.patrol.calls.queue import PriorityParams
from rosbot_patrol.patrol.guard.battery import BatteryParams, check_battery
from rosbot_patrol.patrol.mission.manager import PatrolManager
from rosbot_patrol.patrol.mission.params import ManagerParams
from rosbot_patrol.patrol.records.inputs import Battery, Guarded
from rosbot_patrol.patrol.records.mission import Phase, Verdict
from rosbot_patrol.patrol.records.request import Origin, Request
from rosbot_patrol.patrol.visibility.viewpoints import Viewpoint


def ask(*rooms, origin=Origin.SCHEDULE):
    return [Request(room_id=room, origin=origin) for room in rooms]


def driving_to(room):
    return lambda world: phase(world) is Phase.DRIVING and world.manager.mission.room.id == room


def run(world, seconds):
    end = world.now + seconds
    world.run(lambda w: w.now > end)


# -- priorities


def test_the_most_urgent_goes_first_and_equals_in_order():
    world = World()
    world.requests = [
        *ask(1, 3),
        *ask(0, origin=Origin.SILENT_SENSOR),
        *ask(2, origin=Origin.ACTION),
    ]
    world.run(lambda w: len(w.ended) == 4)
    assert [m.room.id for m in world.ended] == [2, 0, 1, 3]
    assert [m.origin for m in world.ended[:2]] == [Origin.ACTION, Origin.SILENT_SENSOR]
    assert len({m.id for m in world.ended}) == 4


def test_calls_are_those_of_sensors_that_have_no_verdict_yet():
    world = World()
    world.requests = ask(1)
    world.triggers = [2, 3]
    world.run(driving_to(2))
    manager = world.manager
    assert sorted(manager.calls().values()) == [2, 3]
    assert manager.calls()[manager.mission.id] == 2
    assert manager.served() == {1, 2, 3}
    world.run(lambda w: len(w.ended) == 3)
    assert manager.calls() == {}


def test_the_room_that_the_robot_comes_home_from_is_not_served_by_that():
    world = World()
    world.triggers = [2]
    world.run(lambda w: phase(w) is Phase.LOOKING)
    assert world.manager.served() == {2}
    world.run(lambda w: phase(w) is not Phase.LOOKING)
    assert world.manager.served() == frozenset()


def test_a_sensors_call_puts_a_round_back_which_then_goes_on():
    world = World()
    world.requests = ask(1, 2)
    world.run(driving_to(1))
    first = world.manager.mission.id
    world.triggers = [3]
    world.run(lambda w: len(w.ended) == 3)
    assert [m.room.id for m in world.ended] == [3, 1, 2]
    assert world.ended[1].id == first
    assert world.ended[1].times["driving"] > 5.0
    assert [m.verdict for m in world.ended] == [Verdict.CLEAR] * 3


def test_a_call_of_the_room_that_a_round_looks_at_makes_it_a_triggers():
    world = World()
    world.requests = ask(1)
    world.run(driving_to(1))
    world.triggers = [1]
    world.step()
    world.triggers = [2]
    world.run(lambda w: len(w.ended) == 2)
    assert [(m.room.id, m.origin) for m in world.ended] == [(1, Origin.TRIGGER), (2, Origin.TRIGGER)]


def test_one_sensors_mission_is_not_put_back_for_another():
    world = World()
    world.triggers = [1]
    world.run(driving_to(1))
    world.triggers = [2]
    world.run(lambda w: len(w.ended) == 2)
    assert [m.room.id for m in world.ended] == [1, 2]


def test_without_preemption_a_round_goes_on():
    world = World(PatrolManager(ROOMS, ManagerParams(priorities=PriorityParams(preempt=False)), network=good_network))
    world.requests = ask(1)
    world.run(driving_to(1))
    world.triggers = [2]
    world.run(lambda w: len(w.ended) == 2)
    assert [m.room.id for m in world.ended] == [1, 2]


def test_from_a_mission_that_is_over_it_goes_on_to_the_next_room_not_home_first():
    world = World()
    world.mission(1, 2, count=2)
    assert [g.pose.x for g in world.goals] == [10.0, 20.0, 0.0]


def test_times_per_phase_are_told():
    world = World()
    mission = world.mission(2)
    assert set(mission.times) == {"waiting", "driving", "looking", "returning"}
    assert mission.times["driving"] == pytest.approx(10.0, abs=0.3)
    assert mission.times["returning"] == pytest.approx(10.0, abs=0.3)
    assert list(mission.began) == ["waiting", "driving", "looking", "returning"]
    assert mission.began["looking"] - mission.began["driving"] == pytest.approx(10.0, abs=0.3)


# -- own motion


def pass_room_1(world, when=12.0):
    """Drive to room 3, past room 1 at x = 10."""
    world.triggers = [3]
    world.run(lambda w: w.x > when)
    return world


def ids(world):
    return [m.room.id for m in world.ended]


def test_a_sensor_that_the_robot_passes_starts_no_mission_but_is_on_record():
    world = pass_room_1(World())
    world.triggers = [1]
    world.run(lambda w: w.ended)
    assert ids(world) == [3]
    assert not world.manager.queue
    assert [room for _, room in world.ended[0].own_motion] == [1]
    (ignored,) = [call for out in world.all for call in out.ignored]
    assert (ignored.room_id, ignored.mission) == (1, world.ended[0].id)


def test_a_sensor_that_still_calls_when_the_robot_has_gone_on_is_followed():
    world = pass_room_1(World())
    world.triggers = [1]
    world.run(lambda w: w.x > 19.0)
    world.triggers = [1]
    world.run(lambda w: len(w.ended) == 2)
    assert ids(world) == [3, 1]


def test_a_sensor_of_a_room_that_the_robot_is_far_from_is_followed():
    world = pass_room_1(World(), when=6.0)
    world.triggers = [1]
    world.run(lambda w: len(w.ended) == 2)
    assert ids(world) == [3, 1]


@pytest.mark.parametrize("dead", ["detector", "camera"])
def test_a_room_that_was_passed_blindly_is_looked_at(dead):
    world = World()
    world.triggers = [3]
    world.run(lambda w: w.x > 1.0)
    setattr(world, dead, False)
    world.run(lambda w: w.x > 12.0)
    world.triggers = [1]
    world.step()
    assert world.manager.queue.rooms == (1,)


def test_a_room_in_which_something_is_in_view_is_looked_at():
    seen = lambda w: w.x > 11.9 and len(w.all) % 7 == 0  # noqa: E731 (too seldom to be confirmed)
    world = World(person_when=seen)
    world.triggers = [3]
    world.run(lambda w: w.x > 11.9)
    world.run(lambda w: w.manager._parts.decision.has_candidate(w.now))
    world.triggers = [1]
    world.step()
    assert world.manager.queue.rooms == (1,)


def test_a_robot_that_stands_is_not_what_a_sensor_sees():
    world = World()
    run(world, 5.0)
    assert world.mission(0).room.id == 0


# -- people's orders


@pytest.mark.parametrize("moment", [Phase.DRIVING, Phase.LOOKING, Phase.RETURNING])
def test_cancel_ends_everything_where_the_robot_is(moment):
    world = World()
    world.triggers = [2]
    world.run(lambda w: (phase(w) is moment and 2.0 < w.x < 19.0) or phase(w) is moment is Phase.LOOKING)
    if moment is not Phase.RETURNING:
        world.triggers = [3]
    world.step()
    said = world.manager.cancel()
    x = world.x
    run(world, 3.0)
    assert world.x == x
    assert world.reports[-1].phase is Phase.IDLE
    assert world.cancels == 1
    assert {m.room.id for m in world.ended} == ({2} if moment is Phase.RETURNING else {2, 3})
    expected = Verdict.CLEAR if moment is Phase.RETURNING else Verdict.UNVERIFIED
    assert {m.verdict for m in world.ended} == {expected}
    assert said.startswith("given up: room")
    assert world.mission(1, count=len(world.ended) + 1).verdict is Verdict.CLEAR


def test_cancel_and_home_with_nothing_to_do_say_so():
    world = World()
    run(world, 1.0)
    assert world.manager.cancel() == "there is nothing to give up"
    assert world.manager.go_home() == "the robot drives home"


@pytest.mark.parametrize("moment", [Phase.DRIVING, Phase.LOOKING, Phase.RETURNING])
def test_home_gives_up_and_drives_home(moment):
    world = World()
    world.triggers = [2]
    world.run(lambda w: phase(w) is moment)
    run(world, 0.5)
    assert world.manager.go_home() == "given up: room 2; the robot drives home"
    world.run(lambda w: w.reports[-1].phase is Phase.IDLE and w.x == 0.0)
    assert world.reports[-1].why == "on guard, at home again"
    assert len(world.ended) == 1


def test_a_call_on_the_way_home_is_taken_at_once():
    world = World(x=20.0)
    run(world, 1.0)
    world.manager.go_home()
    world.run(lambda w: w.x < 15.0)
    world.triggers = [3]
    world.run(driving_to(3))
    assert world.x > 13.0
    world.run(lambda w: w.ended)
    assert world.ended[0].verdict is Verdict.CLEAR


def test_withdrawing_leaves_what_a_sensor_called_for():
    world = World()
    run(world, 1.0)
    taken = world.manager.ask(ask(1, 2, 3, origin=Origin.ACTION))
    world.run(driving_to(1))
    world.triggers = [2]
    world.step()
    world.manager.withdraw(set(taken.values()), "cancelled")
    world.run(lambda w: len(w.ended) == 3)
    verdicts = {m.room.id: m.verdict for m in world.ended}
    assert verdicts == {1: Verdict.UNVERIFIED, 3: Verdict.UNVERIFIED, 2: Verdict.CLEAR}


def test_withdrawing_leaves_the_others_in_order_of_arrival():
    world = World(link=GoalLink(is_up=False))
    world.step()
    world.manager.ask(ask(1, origin=Origin.SILENT_SENSOR))
    taken = world.manager.ask(ask(2, 3, origin=Origin.ACTION))
    world.manager.withdraw({taken[2]}, "cancelled")
    world.manager.ask(ask(1, origin=Origin.ACTION))  # as urgent as room 3 now, and asked for before it
    assert world.manager.queue.rooms == (1, 3)


def test_an_orderly_end_gives_every_call_its_verdict():
    world = World()
    world.triggers = [1, 2]
    world.run(looking)
    out = world.manager.abandon("the patrol was ended")
    assert {(m.room.id, m.verdict) for m in out.ended} == {(1, Verdict.UNVERIFIED), (2, Verdict.UNVERIFIED)}
    assert "the patrol was ended" in out.ended[0].reason


# -- another viewpoint


def test_a_room_whose_point_cannot_be_reached_is_looked_at_from_elsewhere():
    world = World(
        PatrolManager(
            ROOMS, network=good_network, viewpoints=lambda room, inputs: [Pose2D(room.pose.x + 1.0, 0.0, 0.0)]
        )
    )
    world.refuse = {20.0}
    mission = world.mission(2)
    assert mission.verdict is Verdict.CLEAR
    assert [g.pose.x for g in world.goals] == [20.0, 20.0, 21.0, 0.0]
    assert "driving to room 2 (name2), to another viewpoint in it" in [r.why for r in world.reports]
    assert mission.views_done[0][0] == 21.0


def test_a_room_that_cannot_be_reached_at_all_is_unreachable():
    world = World(
        PatrolManager(ROOMS, network=good_network, viewpoints=lambda *_: [Pose2D(21.0, 0, 0), Pose2D(22.0, 0, 0)])
    )
    world.refuse = {20.0, 21.0, 22.0}
    mission = world.mission(2)
    assert mission.verdict is Verdict.UNREACHABLE
    assert "2 other viewpoints in it failed, too" in mission.reason


class TwoViews:
    """`Views` that ask for one more look from x + 2."""

    def __init__(self):
        self.mission = None

    def start(self, mission, belief):
        self.mission = mission

    def see(self, now, inputs):
        pass

    def tracks(self):
        return ()

    def next(self, inputs):
        done = len(self.mission.views_done)
        pose = Pose2D(self.mission.room.pose.x + 2.0, 0.0, 0.0)
        return Viewpoint(pose=pose, turn=math.tau, gain=1.0, way=2.0) if done == 1 else None

    def turn_from(self, pose, view):
        return view.turn

    def blind(self):
        return ""

    def moved(self):
        return ""

    def share(self):
        return 0.5 * len(self.mission.views_done)


def test_a_respawn_in_mid_look_goes_on_with_the_viewpoint_that_was_not_done():
    world = World(PatrolManager(ROOMS, network=good_network, views=TwoViews()))
    world.triggers = [1]
    world.run(lambda w: looking(w) and w.x > 11.0)
    memory = json.loads(json.dumps(world.manager.snapshot()))
    assert memory["mission"]["phase"] == "looking"
    again = World(PatrolManager(ROOMS, network=good_network, views=TwoViews(), memory=memory), x=world.x)
    again.run(lambda w: w.ended)
    assert [g.pose.x for g in again.goals] == [12.0, 0.0]
    assert len(again.ended[0].views_done) == 2
    assert again.ended[0].verdict is Verdict.CLEAR


# -- battery


def low(share, at=0.0):
    return lambda world: Battery(share=share, at=world.now)


def set_battery(world, share, seconds=0.2):
    end = world.now + seconds
    while world.now < end:
        world.battery = None if share is None else Battery(share=share, at=world.now)
        world.step()


def set_voltage(world, volts, seconds):
    end = world.now + seconds
    while world.now < end:
        world.battery = Battery(voltage=volts, at=world.now)
        world.step()


def words_of(world, kind):
    return [word.text for out in world.all for word in out.words if word.kind == kind]


def test_a_low_battery_ends_a_round_but_not_the_look_at_somebody_until_it_is_empty():
    world = World(person_when=lambda w: w.x == 10.0)
    world.triggers = [1]
    world.run(lambda w: w.notices)
    set_battery(world, 0.15, 3.0)
    assert world.manager.mission.phase is Phase.LOOKING
    set_battery(world, 0.07, 0.2)
    assert world.manager.mission.phase is Phase.RETURNING
    assert world.ended == [] or world.ended[-1].verdict is Verdict.CONFIRMED


def test_a_low_battery_lets_a_look_at_somebody_end_by_itself():
    world = World(person_when=lambda w: w.x == 10.0)
    world.triggers = [1]
    world.run(lambda w: w.notices)
    set_battery(world, 0.15, 60.0)
    assert world.ended[-1].verdict is Verdict.CONFIRMED
    assert sum(speed * 0.04 for speed in world.speeds if speed) > 6.0
    assert world.x == 0.0


def test_the_owner_is_told_of_a_robot_that_waits_without_a_charger_and_of_the_charger():
    world = World()
    set_voltage(world, 10.5, 310.0)
    (text,) = words_of(world, "charger")
    assert text == "the battery is low (10.5 V) and the robot stands at home, but is not being charged: plug it in"
    set_voltage(world, 10.9, 20.0)
    assert words_of(world, "charger")[1:] == ["the battery is being charged (10.9 V)"]


def test_the_owner_is_told_at_once_of_a_robot_that_cannot_get_home_with_a_low_battery():
    world = World(x=20.0, refuse={0.0})
    set_battery(world, 0.1, 30.0)
    assert any("away from home, where it cannot be charged: plug it in" in text for text in words_of(world, "charger"))


def test_a_low_battery_brings_it_home_where_it_waits():
    world = World()
    world.triggers = [3]
    world.run(driving_to(3))
    set_battery(world, 0.15, 40.0)
    (mission,) = world.ended
    assert mission.verdict is Verdict.UNVERIFIED
    assert "the battery is low (15%)" in mission.reason
    assert world.x == 0.0
    assert world.reports[-1].why == "waiting for the battery, which is low (15%)"
    world.triggers = [1]
    set_battery(world, 0.3, 5.0)  # above the threshold at which it went, below that at which it goes again
    assert world.reports[-1].queue == (1,)
    assert world.manager.mission is None
    set_battery(world, 0.5, 60.0)
    assert [m.verdict for m in world.ended] == [Verdict.UNVERIFIED, Verdict.CLEAR]
    words = [word for out in world.all for word in out.words]
    assert [(word.kind, word.is_over) for word in words] == [("battery", False), ("battery", True)]


def test_a_robot_that_stands_about_goes_home_with_a_low_battery():
    world = World(x=20.0)
    set_battery(world, 0.1, 20.0)
    assert world.x == 0.0


def test_a_silent_battery_is_not_low():
    world = World()
    set_battery(world, 0.1, 1.0)
    run(world, 70.0)
    assert world.mission(1).verdict is Verdict.CLEAR


def test_by_voltage_where_the_share_is_not_told():
    manager = PatrolManager(
        ROOMS, ManagerParams(battery=BatteryParams(battery_low_voltage=10.0, battery_ok_voltage=11.0))
    )
    world = World(manager)
    world.triggers = [1]
    for volts, is_low in [(10.5, False), (9.9, True), (10.5, True), (11.1, False)]:
        set_voltage(world, volts, 6.0)
        assert manager._battery.is_low == is_low


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"battery_low": 0.5}, "/n/battery_ok: is 0.4, expected more than battery_low 0.5"),
        ({"battery_low_voltage": 12.0}, "/n/battery_ok_voltage: is 11.4, expected more than battery_low_voltage 12"),
    ],
)
def test_thresholds_that_contradict_each_other(given, said):
    with pytest.raises(ParamError) as caught:
        check_battery(BatteryParams(**given), "/n/")
    assert str(caught.value) == said


# -- the emergency stop


@pytest.mark.parametrize("moment", [Phase.DRIVING, Phase.LOOKING, Phase.RETURNING])
def test_the_stop_holds_the_robot_and_new_missions_until_it_is_released(moment):
    world = World()
    world.triggers = [2]
    world.run(lambda w: phase(w) is moment)
    run(world, 0.5)
    world.stop = "the emergency stop was pressed"
    world.triggers = [3]
    out = world.step()
    assert out.cancel_all
    assert out.cancel
    assert out.speed == 0.0
    at = world.x, world.yaw
    run(world, 10.0)
    assert (world.x, world.yaw) == at
    assert world.all[-1].speed == 0.0
    assert world.reports[-1].phase is Phase.STOPPED
    assert world.reports[-1].queue == (3,)
    assert world.ended[0].verdict is (Verdict.CLEAR if moment is Phase.RETURNING else Verdict.UNVERIFIED)
    assert "holds until it is released" in world.reports[-1].why
    world.stop = ""
    world.run(lambda w: len(w.ended) == 2)
    assert world.ended[1].room.id == 3


def test_after_the_stop_it_stays_where_it_is():
    world = World()
    world.triggers = [2]
    world.run(lambda w: w.x > 5.0)
    world.stop = "pressed"
    run(world, 1.0)
    world.stop = ""
    x = world.x
    run(world, 5.0)
    assert world.x == x
    assert world.reports[-1].why == "on guard, where it was stopped"


# -- arming

DISARMED = Guarded(mode="disarmed", rooms=frozenset(), why="the house is disarmed")


def test_a_disarmed_house_records_calls_and_starts_nothing():
    world = World(guarded=DISARMED)
    run(world, 1.0)
    for _ in range(100):
        world.triggers = [1]
        world.step()
    assert world.ended == []
    assert world.manager.mission is None
    (ignored,) = [call for out in world.all for call in out.ignored]
    assert (ignored.room_id, ignored.why) == (1, "the house is disarmed")


def test_disarming_ends_what_sensors_called_for_and_leaves_what_people_asked_for():
    world = World()
    world.triggers = [2, 3]
    world.run(driving_to(2))
    world.requests = ask(1, origin=Origin.ACTION)
    world.step()
    world.guarded = DISARMED
    world.run(lambda w: len(w.ended) == 3)
    assert {m.room.id: m.verdict for m in world.ended} == {
        2: Verdict.UNVERIFIED,
        3: Verdict.UNVERIFIED,
        1: Verdict.CLEAR,
    }
    assert "the house is disarmed" in world.ended[0].reason


def test_rooms_that_the_mode_does_not_guard():
    world = World(guarded=Guarded(mode="night", rooms=frozenset({2})))
    world.triggers = [1, 2]
    world.run(lambda w: w.ended)
    assert ids(world) == [2]
    assert not world.manager.queue


@pytest.mark.parametrize("disarms", [True, False])
def test_a_notice_waits_for_the_entry_delay(disarms):
    world = World(person_when=looking)
    world.guarded = Guarded(holds_until=world.wall + world.now + 60.0)
    world.triggers = [1]
    world.run(lambda w: w.notices)
    assert world.notices[0].is_held
    memory = json.loads(json.dumps(world.manager.snapshot()))
    again = World(PatrolManager(ROOMS, network=good_network, memory=memory), x=world.x, now=world.now)
    again.guarded = DISARMED if disarms else world.guarded
    again.run(lambda w: any(out.releases for out in w.all))
    (release,) = [release for out in again.all for release in out.releases]
    assert (release.mission, release.is_dropped) == (world.notices[0].mission.id, disarms)
    assert disarms == (again.now < 160.0)


def test_quiet_hours_hold_rounds_not_sensors():
    world = World(guarded=Guarded(is_quiet=True))
    world.requests = ask(1)
    world.triggers = [2]
    world.run(lambda w: w.ended)
    run(world, 5.0)
    assert ids(world) == [2]


# -- clocks and restarts


@pytest.mark.parametrize("jump", [3600.0, -3600.0])
@pytest.mark.parametrize("moment", [Phase.DRIVING, Phase.LOOKING, Phase.RETURNING])
def test_a_clock_that_is_set_ends_nothing(jump, moment):
    world = World()
    world.triggers = [2]
    world.run(lambda w: phase(w) is moment)
    run(world, 0.5)
    world.now += jump
    world.run(lambda w: w.ended)
    assert world.ended[0].verdict is Verdict.CLEAR
    assert world.ended[0].times["driving"] < 20.0


def test_what_was_called_for_too_long_ago_is_reported_not_followed():
    world = World()
    world.triggers = [1, 2]
    world.run(looking)
    memory = world.manager.snapshot()
    again = World(PatrolManager(ROOMS, network=good_network, memory=memory), wall=world.wall + 13 * 3600.0)
    again.triggers = [3]
    run(again, 1.0)
    assert [(m.room.id, m.verdict) for m in again.ended] == [(2, Verdict.UNVERIFIED), (1, Verdict.UNVERIFIED)]
    assert "down for more than 12 hours" in again.ended[0].reason
    assert again.manager.mission.room.id == 3


def test_a_mission_keeps_its_record_over_a_restart():
    world = pass_room_1(World())
    world.triggers = [1]
    run(world, 1.0)
    mission = world.manager.mission
    memory = json.loads(json.dumps(world.manager.snapshot()))
    kept = PatrolManager(ROOMS, network=good_network, memory=memory).mission
    fields = [f.name for f in dataclasses.fields(mission) if f.name not in ("started", "best")]
    assert {name: getattr(kept, name) for name in fields} == {name: getattr(mission, name) for name in fields}
