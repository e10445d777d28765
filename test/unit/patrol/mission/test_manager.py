"""The patrol in a small world: a robot that glides to goals and turns by command, a detector that sees by room."""

import dataclasses
import math

import pytest
from belief_pictures import good_network
from patrol_world import PERSON, ROOMS, World, looking, phase

from rosbot_patrol.goal import GoalLink, GoalState
from rosbot_patrol.patrol.calls.queue import MissionQueue
from rosbot_patrol.patrol.mission.manager import PatrolManager
from rosbot_patrol.patrol.mission.params import ManagerParams
from rosbot_patrol.patrol.records.inputs import Guarded
from rosbot_patrol.patrol.records.mission import Phase, Verdict
from rosbot_patrol.patrol.records.request import Request, request_to_plain


def test_an_empty_room_is_clear_and_the_robot_comes_home_after_one_turn():
    world = World()
    mission = world.mission(2)
    assert mission.verdict.value == "clear"
    assert world.phases == ["driving", "looking", "returning", "idle"]
    assert [g.pose.x for g in world.goals] == [20.0, 0.0]
    assert abs(math.degrees(world.yaw) - 360) < 6
    assert [s for s in world.speeds if s is not None][-1] == 0.0
    assert world.notices == []


def test_a_person_makes_one_notice_and_the_verdict():
    world = World(person_when=looking)
    mission = world.mission(1)
    assert mission.verdict.value == "confirmed"
    assert len(world.notices) == 1
    assert world.notices[0].seen.label == "person"
    assert world.notices[0].phase is Phase.LOOKING
    assert mission.sightings > 10
    assert abs(math.degrees(world.yaw) - 360) < 6


def test_the_picture_that_a_notice_speaks_of_is_kept_until_then():
    world, sure = World(person_when=looking), dataclasses.replace(PERSON, probability=0.95)
    world.boxes = lambda w: (PERSON if any(out.pictures for out in w.all) else sure,)
    world.triggers = [2]
    world.run(lambda w: w.notices)
    first = next(k for k, out in enumerate(world.all) if out.pictures)
    assert first < len(world.all) - 3  # more pictures were needed
    assert {out.pictures for out in world.all[first:]} == {(world.notices[0].seen.stamp,)}


@pytest.mark.parametrize("when", [Phase.DRIVING, Phase.RETURNING])
def test_detection_is_live_while_driving(when):
    world = World(person_when=lambda w: phase(w) is when)
    world.triggers = [2]
    world.run(lambda w: w.notices)
    assert phase(world) is when  # not when it is home again
    world.run(lambda w: w.ended)
    assert world.ended[0].verdict.value == "confirmed"


def test_a_person_seen_while_idle_is_no_business_of_the_patrol():
    world = World(person_when=lambda w: w.manager.mission is None)
    for _ in range(200):
        world.step()
    assert world.notices == []


def test_an_unreachable_room_is_reported_without_a_turn_elsewhere():
    world = World(refuse={20.0})
    mission = world.mission(2)
    assert mission.verdict.value == "unreachable"
    assert "room 2 (name2) cannot be reached" in mission.reason
    assert "tried 2 times: Failed to find a valid plan" in mission.reason
    assert "looking" not in world.phases
    assert not any(world.speeds)
    assert world.goals[-1].pose.x == 0.0


def test_a_person_on_the_way_to_an_unreachable_room_stays_confirmed():
    world = World(refuse={20.0}, person_when=lambda w: len(w.goals) == 1)
    world.refuse = set()
    world.triggers = [2]
    world.run(lambda w: w.notices)
    world.refuse = {20.0}
    world.run(lambda w: w.ended)
    assert world.ended[0].verdict.value == "confirmed"


def test_an_unknown_room_is_refused_and_the_next_is_taken(caplog):
    world = World()
    world.mission(9, 1)
    assert "motion trigger refused: there is no room 9: rooms.yaml has the rooms 0 to 3" in caplog.text
    assert world.ended[0].room.id == 1


def test_a_sender_in_a_loop_does_not_flood_the_log(caplog):
    caplog.set_level("INFO")
    world = World()
    world.triggers = [9] * 50
    world.run(lambda w: w.now > 102.0)
    world.triggers = [9] * 50
    world.run(lambda w: w.now > 104.0)
    assert caplog.text.count("there is no room 9") == 1
    world.run(lambda w: w.now > 115.0)
    world.triggers = [9, 1]
    world.run(lambda w: w.manager.mission)
    assert caplog.text.count("there is no room 9") == 2
    world.triggers = [1] * 50
    world.run(looking)
    assert caplog.text.count("motion in room 1") == 2  # taken, and again


def test_room_0_is_a_room_like_others():
    assert World().mission(0).verdict.value == "clear"


def test_triggers_wait_in_order_one_a_room():
    world = World()
    world.triggers = [1]
    world.run(looking)
    world.mission(3, 2, 3, 3, count=3)
    assert [m.room.id for m in world.ended] == [1, 3, 2]
    assert world.ended[1].triggers == 3
    assert not world.manager.queue


def test_the_rooms_own_sensor_adds_to_the_mission_but_makes_no_other():
    world = World()
    world.triggers = [1]
    world.run(looking)
    world.mission(1)
    for _ in range(50):
        world.step()
    assert len(world.ended) == 1
    assert world.ended[0].triggers == 2


def test_the_rooms_own_sensor_calls_again_once_the_robot_has_left():
    world = World()
    world.triggers = [2]
    world.run(lambda w: phase(w) is Phase.RETURNING and w.x < 10.0)
    world.mission(2, count=2)
    assert [m.room.id for m in world.ended] == [2, 2]


def test_on_leaving_the_robot_itself_is_what_the_sensor_sees():
    world = World()
    world.triggers = [2]
    world.run(lambda w: phase(w) is Phase.RETURNING)
    world.mission(2)
    assert not world.manager.queue


@pytest.mark.parametrize(("dead", "word"), [("detector", "detector"), ("camera", "camera")])
def test_blind_is_unverified_never_clear(dead, word):
    world = World()
    world.triggers = [1]
    world.run(looking)
    setattr(world, dead, False)
    world.run(lambda w: w.ended)
    assert world.ended[0].verdict.value == "unverified"
    assert word in world.ended[0].reason
    assert world.notices == []
    (told,) = world.words
    assert told.kind == "room 1"
    assert told.text.startswith("motion in room 1 (name1), which could not be looked at to the end: the ")
    assert word in told.text


def test_a_detector_that_dies_for_a_part_of_the_turn_is_unverified():
    world = World()
    world.triggers = [1]
    world.run(lambda w: w.yaw > 1.0)
    world.detector = False
    world.run(lambda w: w.yaw > 4.5)
    world.detector = True
    world.run(lambda w: w.ended)
    assert world.ended[0].verdict.value == "unverified"


def test_a_detector_that_respawns_is_waited_for():
    world = World()
    world.triggers = [1]
    world.detector = False
    world.run(looking)
    for _ in range(100):
        world.step()
    assert world.yaw == 0.0
    world.detector = True
    world.run(lambda w: w.ended)
    assert world.ended[0].verdict.value == "clear"


def test_a_turn_that_fails_is_unverified():
    world = World(moves=False)
    mission = world.mission(1)
    assert mission.verdict.value == "unverified"
    assert "did not turn far enough" in mission.reason
    assert world.goals[-1].pose.x == 0.0


def test_starting_says_what_it_waits_for_and_keeps_triggers():
    world = World(link=GoalLink(is_up=False), detector=False, detector_at=-math.inf)
    world.triggers = [1]
    for _ in range(20):
        world.step()
    assert world.reports[-1].phase is Phase.STARTING
    assert "move_base" in world.reports[-1].why
    assert world.reports[-1].queue == (1,)
    world.link, world.detector = GoalLink(is_up=True), True
    world.run(lambda w: w.ended)


def test_a_move_base_that_dies_gets_the_goal_again():
    world = World()
    world.triggers = [3]
    world.run(lambda w: w.x > 5.0)
    world.link = GoalLink(is_up=False)
    for _ in range(100):
        world.step()
    assert "waiting for move_base" in world.reports[-1].why
    world.link = GoalLink(is_up=True)
    world.run(lambda w: w.ended)
    assert world.ended[0].verdict.value == "clear"
    assert len({g.tag for g in world.goals}) == 3


def test_a_move_base_that_stays_down_is_bounded_and_said():
    world = World()
    world.triggers = [3]
    world.run(lambda w: w.x > 5.0)
    world.link = GoalLink(is_up=False)
    world.run(lambda w: w.ended, limit=200)
    assert world.ended[0].verdict.value == "unreachable"
    assert "did not answer for 60 s" in world.ended[0].reason
    assert "motion in" in world.words[0].text
    assert "did not answer for 60 s" in world.words[0].text
    assert "not at home" in world.reports[-1].why


def test_a_drive_that_never_ends_is_cancelled():
    world = World(speed=0.0)
    world.triggers = [1]
    world.run(lambda w: w.cancels, limit=600)
    assert phase(world) is Phase.RETURNING
    assert "not there after 460 s" in world.manager.mission.reason


def test_another_ones_result_is_not_ours():
    world = World()
    world.triggers = [1]
    world.step()
    world.step()
    world.link = GoalLink(is_up=True, tag="someone else's", state=GoalState.SUCCEEDED)
    for _ in range(20):
        world.step()
    assert phase(world) is Phase.DRIVING


@pytest.mark.parametrize("moment", [Phase.DRIVING, Phase.LOOKING, Phase.RETURNING])
def test_a_killed_patrol_goes_on_with_mission_and_queue(moment):
    world = World(person_when=lambda w: phase(w) is Phase.LOOKING)
    world.triggers = [2]
    world.run(lambda w: phase(w) is moment and w.manager.mission.notified == (moment is Phase.RETURNING))
    rooms = [2, 3]
    if moment is Phase.RETURNING:
        rooms = [2]  # another call would end it there
    else:
        world.triggers = [3]
    world.step()
    memory = world.manager.snapshot()
    again = World(PatrolManager(ROOMS, network=good_network, memory=memory), person_when=world.person_when, x=world.x)
    again.run(lambda w: len(w.ended) == len(rooms))
    assert [m.room.id for m in again.ended] == rooms
    assert again.ended[0].id == memory["mission"]["id"]
    assert again.ended[0].verdict.value == "confirmed"
    assert len([n for n in again.notices if n.mission.room.id == 2]) == (0 if memory["mission"]["notified"] else 1)
    assert len({m.id for m in again.ended}) == len(rooms)
    assert again.goals[0].pose.x == (0.0 if moment is Phase.RETURNING else 20.0)


@pytest.mark.parametrize("is_running", [True, False])
def test_a_notice_that_is_newer_than_the_memory_confirms_its_mission(is_running):
    world = World()
    world.triggers = [2]
    world.run(looking)
    memory = world.manager.snapshot()
    if not is_running:  # killed before the memory knew that the mission had begun
        plain = memory["mission"]
        request = Request(room_id=2, id=plain["id"], wall=plain["called"])
        memory |= {"mission": None, "queue": [request_to_plain(request)]}
    again = World(PatrolManager(ROOMS, network=good_network, memory=memory), x=world.x)
    assert again.manager.note_earlier_notice(world.manager.mission.id, "a person was seen in room 2")
    again.run(lambda w: w.ended)
    assert (again.ended[0].verdict.value, again.ended[0].reason) == ("confirmed", "a person was seen in room 2")
    assert again.ended[0].sightings == 1
    assert again.notices == []


@pytest.mark.parametrize("is_running", [True, False])
def test_a_held_notice_that_is_newer_than_the_memory_waits_for_the_entry_delay_only(is_running):
    world = World()
    world.triggers = [2]
    world.run(looking)
    mission, wall = world.manager.mission.id, world.wall + 100.0
    guarded = Guarded(holds_until=wall + 5.0) if is_running else Guarded()
    again = World(
        PatrolManager(ROOMS, network=good_network, memory=world.manager.snapshot()), x=world.x, guarded=guarded
    )
    assert again.manager.note_earlier_notice(mission, "a person was seen", held_until=wall + 5.0)
    assert not again.manager.note_earlier_notice(mission, "a person was seen")
    began = again.now
    again.run(lambda w: any(out.releases for out in w.all))
    (release,) = [release for out in again.all for release in out.releases]
    assert (release.mission, release.is_dropped) == (mission, False)
    assert (again.now - began > 4.9) == is_running


@pytest.mark.parametrize("memory", [{"count": "x"}, {"count": 1}, {"count": 1, "queue": 5, "mission": 3}, {"a": None}])
def test_memory_that_makes_no_sense_is_said_and_dropped(memory, caplog):
    manager = PatrolManager(ROOMS, network=good_network, memory=memory)
    assert manager.mission is None
    assert "makes no sense" in caplog.text
    assert World(manager).mission(1).verdict.value == "clear"


def test_memory_of_a_room_that_is_gone():
    queue = [request_to_plain(Request(room_id=room)) for room in (9, 1)]
    memory = {"count": 3, "queue": queue, "mission": None, "last_verdict": "clear", "held": {}}
    manager = PatrolManager(ROOMS, network=good_network, memory=memory)
    assert manager.queue.rooms == (1,)


@pytest.mark.parametrize("jump", [-80.0, -2.0, 2.0, 3600.0])
@pytest.mark.parametrize("is_anybody_there", [True, False])
def test_a_clock_that_is_set_in_mid_mission_changes_no_verdict(jump, is_anybody_there):
    world = World(person_when=lambda w: is_anybody_there and looking(w) and w.yaw > 4.0)
    world.triggers = [2]
    world.run(lambda w: looking(w) and w.yaw > 1.0)
    world.now += jump
    world.run(lambda w: w.ended)
    assert world.ended[0].verdict is (Verdict.CONFIRMED if is_anybody_there else Verdict.CLEAR)
    assert len(world.notices) == is_anybody_there


def test_abandon_leaves_nothing_to_go_on_with():
    world = World()
    world.triggers = [1, 2]
    world.run(looking)
    world.manager.abandon("Ctrl-C")
    assert world.manager.snapshot()["mission"] is None
    assert world.manager.snapshot()["queue"] == []


def test_it_stands_still_to_confirm_what_may_be_an_intruder():
    seen = []

    def when(world):
        visible = looking(world) and 1.0 < world.yaw < 1.4
        seen.append(visible)
        return visible and len([s for s in seen if s]) % 3 == 0  # a poor view: one picture in three

    world = World(person_when=when)
    world.mission(1)
    turning = [s for s in world.speeds if s is not None]
    assert turning.count(0.0) > 25 + 1.0 / 0.04


def test_alarm_classes_are_a_parameter():
    manager = PatrolManager(ROOMS, ManagerParams(alarm_classes=["cat"]), network=good_network)
    assert World(manager, person_when=looking).mission(1).verdict.value == "clear"


def test_the_queue_counts_what_it_merges():
    queue = MissionQueue()
    assert [queue.add(Request(room_id=r)) for r in (3, 1, 3)] == [True, True, False]
    assert queue.rooms == (3, 1)
    first = queue.pop()
    assert (first.room_id, first.triggers) == (3, 2)
    assert queue.rooms == (1,)
