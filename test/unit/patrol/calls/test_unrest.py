"""Order of the waiting rooms: a loud sensor does not come first."""

from __future__ import annotations

import numpy as np
from floors import points
from room_world import POINT, World

from rosbot_patrol.patrol.calls.queue import MissionQueue
from rosbot_patrol.patrol.calls.unrest import Unrest
from rosbot_patrol.patrol.intruder.lidar_motion import LidarTrack
from rosbot_patrol.patrol.mission.agenda import Agenda
from rosbot_patrol.patrol.mission.params import ManagerParams
from rosbot_patrol.patrol.records.request import Origin, Request, request_from_plain, request_to_plain

HOME, THERE, FAR = (2.0, 4.7), POINT[:2], (4.0, 1.5)


def waiting(*requests: Request) -> MissionQueue:
    queue = MissionQueue()
    for request in requests:
        queue.add(request)
    return queue


def test_the_first_call_of_a_quiet_sensor_goes_before_the_tenth_of_a_loud_one() -> None:
    queue = waiting(*(Request(room_id=room, earlier=earlier) for room, earlier in ((1, 9), (2, 3), (3, 0), (4, 0))))
    assert queue.rooms == (3, 4, 2, 1)


def test_a_room_in_which_something_moves_goes_first_among_its_equals() -> None:
    queue = waiting(Request(room_id=1), Request(room_id=2, earlier=9), Request(room_id=3, priority=5))
    queue.stirring = frozenset({2})
    assert queue.rooms == (3, 2, 1)


def test_a_mission_that_was_put_back_goes_before_both() -> None:
    queue = waiting(Request(room_id=1), Request(room_id=2))
    queue.put_back(Request(room_id=3, earlier=9))
    assert queue.rooms == (3, 1, 2)


def test_calls_fade_and_are_bounded() -> None:
    unrest = Unrest()
    for _ in range(8):
        unrest.call(1, 100.0)
    assert [unrest.calls(1, at) for at in (100.0, 700.0, 1300.0, 1e6)] == [8, 4, 2, 0]
    for _ in range(5000):
        unrest.call(2, 100.0)
    assert unrest.calls(2, 100.0) == 1000
    assert unrest.calls(3, 100.0) == 0


def test_a_movement_counts_for_a_minute() -> None:
    unrest = Unrest()
    unrest.move(1, 100.0)
    assert unrest.stirring(159.0) == {1}
    assert not unrest.stirring(161.0)


def test_a_forged_flood_cannot_put_a_real_call_last() -> None:
    world = World(rooms=points(HOME, THERE, THERE, THERE, FAR))
    for _ in range(20):
        world.triggers = (1, 2, 3)
        world.step()
    world.until(lambda w: flood(w) and len(w.ended) == 2)
    world.triggers = (4,)  # the first call of this sensor, behind those that wait
    world.step()
    world.until(lambda w: flood(w) and len(w.ended) == 4)
    assert [mission.room.id for mission in world.ended][-1] == 4


def flood(world: World) -> bool:
    world.triggers = (1, 2, 3)
    return True


def test_what_the_lidar_follows_brings_its_room_forward() -> None:
    world = World(rooms=points(HOME, THERE, FAR))
    assert world.house is not None
    agenda = Agenda(points(HOME, THERE, FAR), ManagerParams())
    agenda.ask([Request(room_id=room, origin=Origin.ACTION) for room in (1, 2)], 0.0, None)
    track = LidarTrack(first=np.zeros((1, 2)), start=FAR, since=0.0, x=FAR[0], y=FAR[1], at=1.0)
    agenda.see_motion(1.0, [track], world.house)
    assert agenda.queue.rooms == (1, 2)  # it stands
    track.has_moved = True
    agenda.see_motion(1.0, [track], world.house)
    assert agenda.queue.rooms == (2, 1)
    agenda.see_motion(100.0, [], None)
    assert agenda.queue.rooms == (1, 2)


def test_a_kept_request_of_an_older_version_has_no_earlier_calls() -> None:
    plain = request_to_plain(Request(room_id=1, earlier=4))
    assert request_from_plain(plain).earlier == 4
    del plain["earlier"]
    assert request_from_plain(plain).earlier == 0
