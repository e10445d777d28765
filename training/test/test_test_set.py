from __future__ import annotations

from pathlib import Path

import numpy as np

from rosbot_patrol.simulation.actors.looks import is_reserved
from rosbot_patrol.simulation.scene.textures import standard_textures
from rosbot_patrol.simulation.sdf.world import load_world
from training.judging.test_set import FRESH, SETS, TEST, WORLD, unseen_picture, unseen_textures
from training.pictures import scenes

ROOT = Path(__file__).parents[2]


def test_no_texture_of_the_tests_is_one_of_training() -> None:
    unseen, seen = unseen_textures(), standard_textures()
    assert list(unseen) == list(seen)
    for name, texture in unseen.items():
        assert texture.pixels.shape == (128, 128, 3)
        for other in seen.values():
            # far apart at every shift along the rows: not the same pattern moved
            gaps = [np.abs(np.roll(texture.pixels, s, 1).astype(int) - other.pixels).mean() for s in range(0, 128, 8)]
            assert min(gaps) > 5.0, name


def test_pictures_on_the_walls_differ_by_chance() -> None:
    rng = np.random.default_rng(0)
    assert (unseen_picture(rng).pixels != unseen_picture(rng).pixels).any()


def test_the_posters_of_the_tests_show_reserved_looks() -> None:
    rng = np.random.default_rng(0)
    assert all(is_reserved(look) for look in scenes.poster_looks(rng, reserved=True))
    assert not any(is_reserved(look) for look in scenes.poster_looks(rng) if look.height < 1.8 or look.height > 1.84)


def test_the_villa_has_room_for_cameras_and_people() -> None:
    rng = np.random.default_rng(1)
    scene = scenes.draw_house(rng, load_world(ROOT / WORLD))
    cameras = [scenes.draw_camera(scene, rng) for _ in range(20)]
    assert all(c is not None for c in cameras)
    people = [a for c in cameras if c for a in scenes.draw_actors(scene, c, rng, reserved=True)]
    assert len(people) > 5


def test_the_sets_have_seeds_of_their_own() -> None:
    assert SETS == {"test": TEST, "fresh": FRESH}
    assert TEST.seed != FRESH.seed
    assert (TEST.pictures, FRESH.pictures) == (2000, 500)
