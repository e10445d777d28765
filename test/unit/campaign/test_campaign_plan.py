"""Plans: the same again by the seed, nobody in a wall, and who hides can be found."""

from __future__ import annotations

import json
import math
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest

from rosbot_patrol.campaign.cast import HIDDEN, PLAIN
from rosbot_patrol.campaign.floor import EYE_LEVEL, Floor
from rosbot_patrol.campaign.houses.files import HOUSES, House, house_files
from rosbot_patrol.campaign.mishaps import MISHAPS
from rosbot_patrol.campaign.plan import (
    KINDS,
    Patrol,
    house_of,
    kind_of,
    patrol_from_plain,
    plan_patrol,
    scenario_text,
)
from rosbot_patrol.errors import ParamError, WorldError
from rosbot_patrol.simulation.scenario.file import read_scenario

SEED = 3


@pytest.fixture(scope="module")
def patrols(flat: House, flat_floor: Floor) -> list[Patrol]:
    return [plan_patrol(SEED, number, flat.files, flat_floor) for number in range(2 * len(KINDS))]


def test_each_block_has_every_kind_and_every_house_its_turn() -> None:
    for block in range(5):
        numbers = range(block * len(KINDS), (block + 1) * len(KINDS))
        assert Counter(kind_of(SEED, n) for n in numbers) == Counter(KINDS)
    pairs = {(kind_of(SEED, n), house_of(SEED, n, HOUSES)) for n in range(60)}
    assert len(pairs) >= 20
    assert Counter(house_of(SEED, n, HOUSES) for n in range(60)) == {"house": 20, "flat": 20, "office": 20}


def test_a_patrol_is_the_same_whenever_it_is_planned(flat: House, flat_floor: Floor, patrols: list[Patrol]) -> None:
    assert plan_patrol(SEED, 7, flat.files, flat_floor) == patrols[7]
    assert plan_patrol(SEED + 1, 7, flat.files, flat_floor) != patrols[7]
    assert patrol_from_plain(json.loads(json.dumps(patrols[7].to_plain()))).scenario == json.loads(
        json.dumps(patrols[7].scenario)
    )


def test_with_faults_something_breaks_in_every_other_patrol_and_each_kind_of_it(
    flat: House, flat_floor: Floor, tmp_path: Path
) -> None:
    kinds = set()
    for number in range(20):
        whole = plan_patrol(SEED, number, flat.files, flat_floor)
        patrol = plan_patrol(SEED, number, flat.files, flat_floor, faults=2)
        assert bool(patrol.mishap) == ((number + SEED) % 2 == 0)
        assert patrol.scenario["actors"] == whole.scenario["actors"]
        if not patrol.mishap:
            assert patrol == whole
            continue
        kept = patrol_from_plain(json.loads(json.dumps(patrol.to_plain())))
        assert kept.allowed == patrol.allowed
        file = tmp_path / f"{number}.yaml"
        file.write_text(scenario_text(kept))
        scenario = read_scenario(file)
        kinds.add(scenario.faults[0].kind)
        assert scenario.expect is not None
        assert bool(scenario.expect.verdicts) == (not patrol.allowed)
    assert len(kinds) == len(MISHAPS)


def test_every_scenario_can_be_played(patrols: list[Patrol], tmp_path: Path) -> None:
    assert Counter(patrol.kind for patrol in patrols) == Counter(2 * KINDS)
    for patrol in patrols:
        kept = patrol_from_plain(json.loads(json.dumps(patrol.to_plain())))
        file = tmp_path / f"{patrol.number}.yaml"
        file.write_text(scenario_text(kept))
        scenario = read_scenario(file)
        assert scenario.expect is not None
        assert scenario.expect.verdicts == {patrol.room: patrol.expected}
        assert [trigger.sensor for trigger in scenario.triggers] == [patrol.room]


def test_who_is_there_has_room_to_stand_and_is_in_the_room(patrols: list[Patrol], flat_floor: Floor) -> None:
    actors = [(patrol, actor) for patrol in patrols for actor in patrol.scenario["actors"]]
    people = [(patrol, actor) for patrol, actor in actors if actor.get("model") != "poster"]
    assert len(people) >= len(patrols) // 2
    for patrol, actor in people:
        x, y = actor["start"][:2]
        assert flat_floor.can_stand(x, y), patrol.title
        end = actor.get("path", [[x, y]])[-1]
        assert flat_floor.room_at(*end[:2]) == patrol.room, patrol.title


def test_the_robot_can_pass_whoever_stands_in_the_room(patrols: list[Patrol], flat_floor: Floor) -> None:
    for kind, people in (("standing", 4), ("hidden", 2), ("two", 4)):
        actors = [(p.room, actor) for p in patrols if p.kind == kind for actor in p.scenario["actors"]]
        assert len(actors) == people
        assert all(flat_floor.leaves_way(room, *actor["start"][:2]) for room, actor in actors)


def test_who_hides_is_not_seen_from_the_rooms_point_but_from_another_place(
    patrols: list[Patrol], flat_floor: Floor
) -> None:
    hidden = [patrol for patrol in patrols if patrol.kind == "hidden"]
    assert len(hidden) == 2
    for patrol in hidden:
        point = flat_floor.rooms.find(patrol.room)
        place, posture = patrol.scenario["actors"][0]["start"][:2], patrol.people[0].posture
        assert point is not None
        assert patrol.viewpoint is not None
        assert flat_floor.share_seen(point.pose[:2], place, posture) <= HIDDEN
        assert flat_floor.share_seen(patrol.viewpoint, place, posture) >= PLAIN
        assert flat_floor.room_at(*patrol.viewpoint) == patrol.room


def test_a_poster_hangs_on_a_wall_and_faces_the_room(patrols: list[Patrol], flat_floor: Floor) -> None:
    posters = [patrol for patrol in patrols if patrol.kind == "poster"]
    assert len(posters) == 2
    for patrol in posters:
        x, y, yaw = patrol.scenario["actors"][0]["start"]
        cut = flat_floor.ways.cut(EYE_LEVEL)
        before, behind = (cut.cast(x, y, yaw + turn, 1.0, 1, longest=9.0)[0] for turn in (0.0, math.pi))
        assert behind < 0.05
        assert before > 0.5
        assert not patrol.people


def test_a_way_on_foot_goes_round_walls(flat_floor: Floor) -> None:
    base, bedroom = flat_floor.rooms.base.pose[:2], flat_floor.rooms.find(2)
    assert bedroom is not None
    way = flat_floor.way(base, bedroom.pose[:2])
    assert way[0] == tuple(base)
    assert way[-1] == bedroom.pose[:2]
    assert len(way) > 2
    assert all(flat_floor.is_straight(a, b) for a, b in pairwise(way[1:-1]))


def test_what_cannot_be_planned_is_a_sentence(flat: House, flat_floor: Floor) -> None:
    with pytest.raises(ParamError, match="'villa' is no house, expected of house, flat, office"):
        house_files("villa", Path())
    bare = Floor(flat.bodies, type(flat.rooms)((flat.rooms.base,)))
    with pytest.raises(WorldError, match="has no room with a place for a patrol of the kind"):
        plan_patrol(SEED, 0, flat.files, bare)


def test_a_kind_that_has_a_place_is_found_one_however_the_draw_begins(flat: House, flat_floor: Floor) -> None:
    """Seed 22: the first draw of patrol 41 in the flat found nowhere to hide."""
    patrol = plan_patrol(22, 41, flat.files, flat_floor)
    assert (patrol.kind, patrol.house) == ("hidden", "flat")
