"""What is told first is where the person is, then where the robot was sent."""

import dataclasses

import pytest
from belief_pictures import good_network
from patrol_world import PERSON, ROOMS, World, phase

from rosbot_patrol.alerts.records.incident import NO_ROOM, Incident
from rosbot_patrol.patrol.house.regions import NOBODYS
from rosbot_patrol.patrol.mission.manager import PatrolManager
from rosbot_patrol.patrol.records.inputs import Measured
from rosbot_patrol.patrol.records.mission import Phase, mission_from_plain, mission_to_plain
from rosbot_patrol.patrol.story.mission_log import MissionLog


class House:
    """Four rooms ten metres apart in a row, with nothing of a map between them."""

    floor = None
    lost = frozenset()

    def refusal(self, room):
        return ""

    def room_at(self, x, y, within=0.5):
        room = round(x / 10.0)
        return room if abs(x - 10.0 * room) < 4.0 and abs(y) < 4.0 and 0 <= room < 4 else NOBODYS


def person_at(x, y=0.5):
    measured = Measured(x=x, y=y, error=0.1, away=3.0, top=1.7, height=1.6, width=0.5)
    return dataclasses.replace(PERSON, measured=measured)


def met(x, when=Phase.LOOKING, house=True, room=3, **given):
    world = World(person_when=lambda w: phase(w) is when, boxes=lambda w: (person_at(x),), **given)
    world.house = House() if house else None
    world.triggers = [room]
    world.run(lambda w: w.notices)
    return world


@pytest.mark.parametrize(("when", "robot"), [(Phase.LOOKING, "from"), (Phase.DRIVING, "on the way to")])
def test_somebody_in_another_room_is_told_there(when, robot):
    (notice,) = met(11.0, when).notices
    mission = notice.mission
    assert (mission.room.id, mission.place_room.id, mission.is_outside) == (3, 1, False)
    assert mission.reason.startswith(f"person seen in room 1 (name1), at (11.0, 0.5), {robot} room 3 (name3), prob")


def test_somebody_met_on_the_way_home(tmp_path):
    world = met(11.0, Phase.RETURNING)
    assert world.notices[0].mission.reason.startswith(
        "person seen in room 1 (name1), at (11.0, 0.5), on the way back from room 3 (name3)"
    )


@pytest.mark.parametrize(
    ("x", "house", "when", "said"),
    [
        (30.5, True, Phase.LOOKING, "person seen in room 3 (name3), at (30.5, 0.5), probability"),
        (30.5, False, Phase.LOOKING, "person seen in room 3 (name3), at (30.5, 0.5), probability"),
        (30.5, True, Phase.DRIVING, "person seen on the way to room 3 (name3), at (30.5, 0.5), probability"),
        (25.0, True, Phase.LOOKING, "person seen in no room of the map, at (25.0, 0.5), from room 3 (name3)"),
        (25.0, True, Phase.DRIVING, "person seen in no room of the map, at (25.0, 0.5), on the way to room 3 (name3)"),
    ],
)
def test_the_room_of_the_call_no_room_and_no_map(x, house, when, said):
    (notice,) = met(x, when, house).notices
    assert notice.mission.reason.startswith(said)
    assert notice.mission.is_outside == ("no room" in said)


def test_two_people_in_two_rooms_are_told_each_in_theirs():
    def boxes(world):
        return (person_at(11.0 if world.manager.mission.sightings == 0 else 21.0),)

    world = World(person_when=lambda w: phase(w) is Phase.LOOKING, boxes=boxes, house=House())
    world.triggers = [3]
    world.run(lambda w: len(w.notices) == 2)
    first, second = (notice.mission for notice in world.notices)
    assert [m.place_room.id for m in (first, second)] == [1, 2]
    assert first.reason.startswith("person seen in room 1 (name1)")
    assert second.reason.startswith("person seen in room 2 (name2)")
    assert second.id == f"{first.id}-2"


def records(world):
    """The records of a world's mission, as the keeper would have them."""
    chronicle, kept = MissionLog(), {}
    for out in world.all:
        mission = world.manager.mission or (out.ended[0] if out.ended else None)
        for entry in chronicle.step(now=0.0, wall=1.0, mission=mission, commands=out, pose=None):
            kept.setdefault(entry.incident, Incident(id=entry.incident, wall=1.0, room_id=3, room_name="name3"))
            kept[entry.incident] = dataclasses.replace(kept[entry.incident], **entry.changes)
    return kept


@pytest.mark.parametrize(("x", "expected"), [(11.0, (1, "name1")), (30.5, (3, "name3")), (25.0, (NO_ROOM, ""))])
def test_the_record_says_it_too(x, expected):
    (record,) = records(met(x)).values()
    assert (record.person_room_id, record.person_room) == expected
    assert record.person == (x, 0.5)


def test_the_records_of_two_people_keep_their_own_place_and_reason_to_the_end():
    def boxes(world):
        return (person_at(11.0 if world.manager.mission.sightings == 0 else 21.0),)

    world = World(person_when=lambda w: phase(w) is Phase.LOOKING, boxes=boxes, house=House())
    world.mission(3)
    first, second = (record for record in records(world).values())
    assert [(r.person_room_id, r.reason[:25]) for r in (first, second)] == [
        (1, "person seen in room 1 (na"),
        (2, "person seen in room 2 (na"),
    ]


@pytest.mark.parametrize("x", [11.0, 25.0, 30.5])
def test_it_outlives_the_program(x):
    world = met(x)
    mission = world.manager.mission
    assert mission_from_plain(mission_to_plain(mission), ROOMS) == dataclasses.replace(
        mission, best=None, arrived=None, started=0.0
    )
    plain = mission_to_plain(mission)
    for name in ("place_room", "is_outside"):  # a file of an earlier version
        del plain[name]
    assert mission_from_plain(plain, ROOMS).place_room is None
    assert (
        PatrolManager(ROOMS, network=good_network, memory=world.manager.snapshot()).mission.place_room
        == mission.place_room
    )
