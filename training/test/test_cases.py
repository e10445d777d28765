from __future__ import annotations

import numpy as np

from training.pictures import scenes
from training.pictures.cases import CASES, HALF_VIEW, case_camera, draw_case, pick_case


def test_cases_put_people_and_things_one_before_the_other() -> None:
    rng = np.random.default_rng(6)
    kinds, gaps, empty = [], [], 0
    for _ in range(60):
        room = scenes.draw_room(rng)
        case = str(rng.choice([name for name in CASES if name != "edge"]))
        camera = case_camera(case, room, rng)
        if camera is None:
            continue
        before = list(room.places)
        actors = draw_case(case, room, camera, rng)
        assert room.places == before
        assert len({actor.body.name for actor in actors}) == len(actors)
        empty += not actors
        away = np.array([actor.pose[:2, 3] for actor in actors]).reshape(-1, 2) - camera[:2]
        turns = np.arctan2(away[:, 1], away[:, 0]) - camera[2]
        turns = np.arctan2(np.sin(turns), np.cos(turns))
        assert (np.hypot(*away.T) > 0.59).all()
        assert (np.abs(turns) < 1.1).all()
        gaps += list(np.abs(np.diff(turns)))
        kinds += [actor.body.kind for actor in actors]
    assert empty < 12
    assert np.median(gaps) < 0.15
    assert {"person", "fire_hydrant", "pet", "furniture"} == set(kinds)
    assert kinds.count("person") > len(kinds) / 3


def test_the_edge_of_the_picture_cuts_a_thing_and_often_nobody_is_there() -> None:
    rng = np.random.default_rng(4)
    views = cut = nobody = at_edge = 0
    for _ in range(60):
        room = scenes.draw_room(rng)
        camera = case_camera("edge", room, rng)
        if camera is None:
            continue
        views += 1
        halves = [(p, max(p.half_x, p.half_y)) for p in room.places]
        cut += any(_from_edge(camera, p.x, p.y) < half for p, half in halves if half < 0.6)
        people = [actor for actor in draw_case("edge", room, camera, rng) if actor.body.kind == "person"]
        nobody += not people
        at_edge += any(_from_edge(camera, *actor.pose[:2, 3]) < 0.4 for actor in people)
    assert views > 50
    assert cut > 0.8 * views
    assert 0.4 * views < nobody < 0.9 * views
    assert at_edge > 0.1 * views


def test_each_case_has_its_share() -> None:
    rng = np.random.default_rng(1)
    picked = [pick_case(rng) for _ in range(2000)]
    for case, share in CASES.items():
        assert abs(picked.count(case) / 2000 - share) < 0.03


def _from_edge(camera: tuple[float, float, float], x: float, y: float) -> float:
    """How far [m] a point is beside the line of sight at the left or right edge of the picture."""
    turn = np.arctan2(y - camera[1], x - camera[0]) - camera[2]
    turn = abs(np.arctan2(np.sin(turn), np.cos(turn)))
    return float(abs(turn - HALF_VIEW) * np.hypot(x - camera[0], y - camera[1]))
