"""The look around with a map, in the small world of `room_world`."""

from __future__ import annotations

import dataclasses
import math

import pytest
from room_world import POINT, ROOMS, WIDTH, Place, World

from rosbot_patrol.geometry import Pose2D, wrap_angle
from rosbot_patrol.goal import GoalState
from rosbot_patrol.patrol.intruder.camera_tracking import CameraTrackingParams
from rosbot_patrol.patrol.intruder.known_objects import KnownObject
from rosbot_patrol.patrol.mission.manager import ManagerParams
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Phase
from rosbot_patrol.patrol.search.room_search import RoomSearch
from rosbot_patrol.patrol.search.survey import SightParams
from rosbot_patrol.patrol.visibility.viewpoints import ViewpointParams


def test_a_room_is_looked_at_from_further_viewpoints_until_enough_is_seen() -> None:
    world = World()
    mission = world.mission()
    assert mission.verdict.value == "clear"
    assert mission.share_seen >= 0.95
    assert len(mission.views_done) == 2
    assert mission.views_done[1][0] < 5.0  # where the corner shows
    assert f"{mission.share_seen:.0%} of its floor seen" in mission.reason


def test_a_spin_leaves_it_at_the_turn_and_says_what_it_saw() -> None:
    world = World(eyes=SightParams(look_around="spin"))
    mission = world.mission()
    assert len(world.goals) == 2
    assert 0.7 < mission.share_seen < 0.95


def test_viewpoints_are_bounded_in_number_and_time() -> None:
    for bound in (ViewpointParams(viewpoints_most=0), ViewpointParams(viewpoints_time=0.0, viewpoints_most=9)):
        world = World(eyes=SightParams(viewpoints=bound))
        assert len(world.mission().views_done) <= 2
        assert len(world.goals) <= 3


def test_at_a_further_viewpoint_only_what_is_unseen_is_turned_over() -> None:
    world = World()
    world.triggers = (1,)
    world.until(lambda w: len(w.goals) == 2)  # on its way to the second
    turned, last = 0.0, None
    while len(world.goals) == 2:
        world.step()
        if world.link.state is GoalState.SUCCEEDED:
            turned += 0.0 if last is None else abs(wrap_angle(world.pose.yaw - last))
            last = world.pose.yaw
    assert turned < 1.25 * math.pi  # of 2 pi


@pytest.mark.parametrize(("looks", "verdict"), [(True, "confirmed"), (False, "clear")])
def test_who_comes_in_behind_the_robot_and_is_told_by_the_sensor_is_found(looks: bool, verdict: str) -> None:
    world = World(eyes=SightParams(viewpoints=ViewpointParams(look_again=looks)))
    world.triggers = (1,)
    world.until(lambda w: len(w.goals) == 2)  # the turn is over, and the robot on its way to the corner
    world.people = lambda now: [(9.9, 1.0)]
    world.triggers = (1,)
    mission = world.until(lambda w: bool(w.ended)).ended[-1]
    assert mission.verdict.value == verdict
    assert mission.triggers == 2


@pytest.mark.parametrize("looks", [True, False])
def test_who_comes_in_behind_the_robot_is_found_as_the_lidar_sees_them_move(looks: bool) -> None:
    world = World(eyes=SightParams(viewpoints=ViewpointParams(look_again=looks)))
    world.triggers = (1,)
    world.until(lambda w: len(w.goals) == 2)
    came = world.now
    world.people = lambda now: [(9.9, 2.0 - min(0.5 * (now - came), 1.0))]
    mission = world.until(lambda w: bool(w.ended)).ended[-1]
    assert mission.verdict.value == "confirmed"
    assert mission.triggers == 1


def test_a_sensor_that_goes_on_calling_has_the_robot_look_again_once() -> None:
    world = World()
    world.triggers = (1,)
    while not world.ended:
        world.step()
        world.triggers = (1,) if world.count % 25 == 0 else ()
        assert world.now < 400.0
    mission = world.ended[-1]
    assert mission.verdict.value == "clear"
    assert mission.share_seen >= 0.95  # once it was, and nobody came
    assert len(mission.views_done) <= 5


def test_too_little_seen_is_unverified() -> None:
    world = World(eyes=SightParams(look_around="spin", clear_share=0.97))
    mission = world.mission()
    assert mission.verdict.value == "unverified"
    assert "of its floor could be seen" in mission.reason


def test_a_viewpoint_that_cannot_be_reached_is_given_up_for_another() -> None:
    world = World(refused=lambda goal: 2.6 < goal.x < 4.2 and goal.y < 3.2)
    mission = world.mission()
    assert mission.verdict.value == "clear"


def test_a_room_whose_point_cannot_be_reached_is_looked_at_from_elsewhere() -> None:
    world = World(refused=lambda goal: goal[:2] == (9.5, 2.0))
    mission = world.mission()
    assert mission.verdict.value == "clear"
    assert mission.share_seen > 0.9


def walks(now: float) -> list[Place]:
    return [(7.0, 0.8 + abs((0.5 * (now - 100.0)) % 3.0 - 1.5))]


def test_a_dead_camera_is_unverified_and_the_lidar_tells_that_something_moved() -> None:
    world = World(walks, camera=False)
    mission = world.mission()
    assert mission.verdict.value == "unverified"
    assert "the camera" in mission.reason
    assert "something moved by" in mission.reason


def test_a_dead_camera_in_an_empty_room_is_unverified_without_that() -> None:
    assert "moved" not in World(camera=False).mission().reason


def test_somebody_in_the_room_is_confirmed_with_their_place() -> None:
    world = World(lambda now: [(7.0, 1.0)])
    mission = world.mission()
    assert mission.verdict.value == "confirmed"
    assert mission.place == pytest.approx((7.0, 1.0))
    assert "at (7.0, 1.0)" in mission.reason
    assert len(world.notices) == 1


def test_two_at_once_are_two_incidents_and_nobody_twice() -> None:
    world = World(lambda now: [(8.0, 2.0), (11.0, 3.0)])
    mission = world.mission()
    assert [notice.mission.id for notice in world.notices] == [mission.id, f"{mission.id}-2"]
    assert sorted(mission.people) == [(8.0, 2.0), (11.0, 3.0)]
    assert mission.sightings > 10


def test_one_who_was_met_before_a_restart_makes_no_second_notice() -> None:
    world = World(lambda now: [(7.0, 1.0)])
    world.triggers = (1,)
    world.until(lambda w: bool(w.notices))
    again = World(lambda now: [(7.0, 1.0)], memory=world.manager.snapshot())
    again.pose = world.pose
    again.until(lambda w: bool(w.ended))
    assert again.notices == []
    assert again.ended[-1].verdict.value == "confirmed"


def test_the_robot_stops_for_whom_it_sees_on_its_way_and_goes_on() -> None:
    world = World(lambda now: [(6.5, 4.5)])  # in the first room, beside the way
    world.triggers = (1,)
    world.until(lambda w: w.cancels == 1)
    assert world.phase is Phase.DRIVING
    stopped = world.pose
    for _ in range(50):
        world.step()
    assert math.dist(world.pose[:2], stopped[:2]) == 0.0
    assert abs(wrap_angle(math.atan2(4.5 - stopped.y, 6.5 - stopped.x) - world.pose.yaw)) < 0.15
    mission = world.until(lambda w: bool(w.ended)).ended[-1]
    assert mission.arrived is not None
    assert mission.verdict.value == "confirmed"


def test_one_who_walks_in_the_room_is_kept_in_view() -> None:
    world = World(walks)
    world.triggers = (1,)
    world.until(lambda w: bool(w.notices) and w.manager.is_following)
    kept = []
    for _ in range(75):
        world.step()
        x, y = world.people(world.now)[0]
        kept.append(abs(wrap_angle(math.atan2(y - world.pose.y, x - world.pose.x) - world.pose.yaw)))
    assert max(kept) < WIDTH / 2
    (told,) = [notice.mission.place for notice in world.notices]
    world.until(lambda w: bool(w.ended))
    assert world.ended[0].place == told  # the record says what the mail says, however far they walk


class Unlocalised:
    """A manager whose robot's place in the map is not known from a step on, nor what stands where in its pictures."""

    def __init__(self, manager) -> None:
        self._manager, self.is_lost = manager, False

    def __getattr__(self, name):
        return getattr(self._manager, name)

    def step(self, now, inputs):
        if self.is_lost:
            frames = tuple(dataclasses.replace(frame, eye=None) for frame in inputs.frames)
            inputs = dataclasses.replace(inputs, pose=None, scan=None, frames=frames)
        return self._manager.step(now, inputs)


def test_a_turn_towards_somebody_ends_where_the_pose_in_the_map_is_lost(caplog: pytest.LogCaptureFixture) -> None:
    world = World(walks)
    world.manager = lost = Unlocalised(world.manager)
    world.triggers = (1,)
    world.until(lambda w: w.manager.is_following)
    lost.is_lost = True
    world.step()
    assert not world.manager.is_following
    assert "no longer follows whom it sees: the robot does not know its pose in the map" in caplog.text
    world.until(lambda w: bool(w.ended))
    assert world.ended[0].verdict.value == "confirmed"


def test_whom_the_robot_turns_to_is_found_by_odometry_alone() -> None:
    """A correction of the map's heading by the localisation in mid turn does not lead the camera astray."""
    world = World(walks, params=ManagerParams(track=CameraTrackingParams(track_time=30.0)))
    step, off = world.manager.step, [0.0]

    def turned(now, inputs):
        pose = inputs.pose._replace(yaw=wrap_angle(inputs.pose.yaw + off[0]))
        frames = tuple(
            dataclasses.replace(f, eye=dataclasses.replace(f.eye, pose=f.eye.pose._replace(yaw=pose.yaw)))
            for f in inputs.frames
        )
        return step(now, dataclasses.replace(inputs, pose=pose, frames=frames, scan=None))

    world.manager.step = turned
    world.triggers = (1,)
    world.until(lambda w: w.manager.is_following)
    off[0] = 0.6
    for _ in range(60):
        world.step()
        x, y = world.people(world.now)[0]
        bearing = wrap_angle(math.atan2(y - world.pose.y, x - world.pose.x) - world.pose.yaw)
        assert abs(bearing) < WIDTH / 2


@pytest.mark.parametrize("distance", [2.0, 0.0])
def test_no_viewpoint_and_no_way_to_one_leads_close_by_whom_it_has_met(distance: float) -> None:
    world = World(lambda now: [(3.4, 1.0)], eyes=SightParams(person_distance=distance))  # before the corner
    mission = world.mission()
    assert mission.verdict.value == "confirmed"
    nearest = min(math.dist(goal[:2], (3.4, 1.0)) for goal in world.goals)
    assert (nearest >= 2.0 - 0.1) == (distance > 0.0)  # a cell of the floor is 0.1 m wide


def test_a_poster_and_a_known_object_are_told_and_do_not_alarm() -> None:
    world = World(lambda now: [(7.0, 1.0)])
    world.flat = True
    mission = world.mission()
    assert mission.verdict.value == "clear"
    assert "it is flat" in mission.reason
    known = (KnownObject(x=7.0, y=1.0, name="the coat stand"),)
    assert "the coat stand" in World(lambda now: [(7.0, 1.0)], known=known).mission().reason


def test_without_a_map_a_turn_is_all_and_no_share_is_told() -> None:
    views = RoomSearch()
    assert views.share() is None
    assert views.blind() == ""
    assert views.fallback_viewpoints(ROOMS.base, Inputs()) == []


@pytest.mark.parametrize(("flat", "verdict"), [(True, "clear"), (False, "confirmed")])
def test_what_is_too_far_off_to_be_measured_is_looked_at_from_near(flat: bool, verdict: str) -> None:
    world = World(lambda now: [(3.2, 0.8)])
    world.flat, world.measures_to = flat, 4.0
    mission = world.mission()
    assert mission.verdict.value == verdict
    assert any(math.dist(view[:2], (3.2, 0.8)) < 3.6 for view in mission.views_done)


def test_what_nobody_could_look_at_from_near_is_unverified() -> None:
    world = World(lambda now: [(3.2, 0.8)], eyes=SightParams(look_around="spin"))
    world.measures_to = 4.0
    mission = world.mission()
    assert mission.verdict.value == "unverified"
    assert "could not be verified: a person at about" in mission.reason


def side(pose: Pose2D) -> float:
    """Where the eye is from (7, 1)."""
    return math.atan2(pose.y - 1.0, pose.x - 7.0)


def is_aside(pose: Pose2D) -> bool:
    """Whether the eye sees (7, 1) from another side than the room's point."""
    return abs(wrap_angle(side(pose) - side(POINT))) > 0.6


def now_and_then(world: World, every: int = 7) -> float:
    """The score of somebody half hidden, whom one picture in seven shows."""
    return 0.3 if world.count // 2 % every == 0 else 0.0


def test_one_who_is_half_hidden_is_looked_at_from_another_side_and_confirmed() -> None:
    world = World(lambda now: [(7.0, 1.0)])
    world.score = lambda pose: 0.9 if is_aside(pose) else now_and_then(world)
    mission = world.mission()
    assert mission.verdict.value == "confirmed"
    assert any(is_aside(Pose2D(*view)) for view in mission.views_done)
    assert len(world.notices) == 1


def test_what_looks_like_somebody_from_one_side_only_is_nobody() -> None:
    world = World(lambda now: [(7.0, 1.0)])
    world.score = lambda pose: 0.0 if is_aside(pose) else now_and_then(world)
    mission = world.mission()
    assert mission.verdict.value == "clear"
    assert any(is_aside(Pose2D(*view)) for view in mission.views_done)
    assert world.notices == []


@pytest.mark.parametrize(("every", "verdict"), [(7, "unverified"), (30, "clear")])
def test_what_could_be_looked_at_from_one_side_only_is_unverified(every: int, verdict: str) -> None:
    world = World(lambda now: [(7.0, 1.0)], eyes=SightParams(look_around="spin"))
    world.score = lambda pose: now_and_then(world, every) if math.dist(pose[:2], POINT[:2]) < 0.3 else 0.0
    mission = world.mission()
    assert mission.verdict.value == verdict
    assert ("could not be verified: a person at about (7.0, 1.0)" in mission.reason) == (verdict == "unverified")


def test_what_is_measured_beyond_the_rooms_wall_is_of_the_room() -> None:
    world = World(lambda now: [(8.6, 0.55)], eyes=SightParams(look_around="spin"))
    world.score = lambda pose: now_and_then(world)
    world.sees_to = 2.0
    world.beyond = 0.75  # right behind them is the wall
    assert world.mission().verdict.value == "unverified"


@pytest.mark.parametrize("way", ["none", "one of them"])
def test_a_second_look_that_no_way_leads_to_proves_nothing_and_another_is_tried(way: str) -> None:
    asked: list[Pose2D] = []

    def refused(goal: Pose2D) -> bool:
        is_elsewhere = math.dist(goal[:2], POINT[:2]) > 0.3 and goal != ROOMS.base.pose
        asked.extend([goal] if is_elsewhere else [])
        return is_elsewhere and (way == "none" or len(asked) == 1)

    world = World(lambda now: [(7.0, 1.0)], refused=refused)
    world.score = lambda pose: now_and_then(world) if math.dist(pose[:2], POINT[:2]) < 0.3 else 0.0
    mission = world.mission()
    assert mission.verdict.value == ("unverified" if way == "none" else "clear")
    assert math.dist(asked[0][:2], asked[1][:2]) > 0.3


@pytest.mark.parametrize(("top", "verdict"), [(1.7, "confirmed"), (0.5, "clear")])
def test_what_is_too_near_to_be_told_from_a_pet_is_looked_at_from_farther_off(top: float, verdict: str) -> None:
    world = World()
    world.top = top
    world.triggers = (1,)
    world.until(lambda w: w.phase is Phase.LOOKING)
    world.people = lambda now: [(10.5, 2.2)]  # a metre from where the robot turns
    mission = world.until(lambda w: bool(w.ended)).ended[-1]
    assert mission.verdict.value == verdict
    assert any(math.dist(view[:2], (10.5, 2.2)) > 1.9 for view in mission.views_done)


def test_what_was_too_near_is_looked_at_for_some_seconds() -> None:
    world = World()
    world.triggers = (1,)
    world.until(lambda w: w.phase is Phase.LOOKING)
    world.people = lambda now: [(10.5, 2.2)] if not world.goals[1:] else []
    world.until(lambda w: any("at a further viewpoint" in r.why for r in w.reports))
    began = world.now
    world.until(lambda w: w.phase is not Phase.LOOKING)
    assert world.now - began > 4.0


def to_and_fro(now: float) -> list[Place]:
    """From right before the room's point to 3 m off and back, at 0.5 m/s."""
    return [(6.5 + abs(now % 10.0 - 5.0) * 0.4, 1.6)]


@pytest.mark.parametrize(("sees_to", "verdict"), [(1.3, "clear"), (7.0, "confirmed")])
def test_what_moves_and_is_shown_whole_without_a_person_is_a_pet(sees_to: float, verdict: str) -> None:
    world = World()
    world.sees_to = sees_to
    world.triggers = (1,)
    world.until(lambda w: w.phase is Phase.LOOKING)
    world.people = to_and_fro
    mission = world.until(lambda w: bool(w.ended)).ended[-1]
    assert mission.verdict.value == verdict, mission.reason


def test_what_is_too_near_and_seen_from_nowhere_else_is_unverified() -> None:
    world = World(eyes=SightParams(look_around="spin"))
    world.triggers = (1,)
    world.until(lambda w: w.phase is Phase.LOOKING)
    world.people = lambda now: [(10.5, 2.2)] if world.phase is Phase.LOOKING else []
    mission = world.until(lambda w: bool(w.ended)).ended[-1]
    assert mission.verdict.value == "unverified"
    assert "it was too near to be told from a pet" in mission.reason
