from __future__ import annotations

import numpy as np

from rosbot_patrol.detection.training import scenes
from rosbot_patrol.detection.training.cases import draw_case


def test_cases_put_people_and_things_one_before_the_other() -> None:
    rng = np.random.default_rng(6)
    kinds, gaps, empty = [], [], 0
    for _ in range(60):
        room = scenes.draw_room(rng)
        camera = scenes.draw_camera(room, rng, open_view=True)
        if camera is None:
            continue
        before = list(room.places)
        actors = draw_case(room, camera, rng)
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
