from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.simulation.actors.looks import draw_look, is_reserved
from rosbot_patrol.simulation.scene.shapes import mesh_of
from rosbot_patrol.simulation.sdf.world import load_world
from training.pictures import scenes
from training.pictures.furniture import MAKERS, SHAPELESS, build, placed

HOUSE = Path(__file__).parents[2] / "worlds" / "house.world"


@pytest.mark.parametrize("seed", range(4))
def test_a_room_repeats_with_its_seed_and_holds_a_camera(seed: int) -> None:
    room, again = (scenes.draw_room(np.random.default_rng(seed)) for _ in range(2))
    assert [b.name for b in room.bodies] == [b.name for b in again.bodies]
    assert len({b.name for b in room.bodies}) == len(room.bodies)
    assert room.light == again.light
    camera = scenes.draw_camera(room, np.random.default_rng(seed))
    assert camera is not None
    assert room.is_free(camera[0], camera[1], 0.29)


def test_actors_stand_free_and_before_the_camera() -> None:
    rng = np.random.default_rng(1)
    kinds = []
    for _ in range(30):
        room = scenes.draw_room(rng)
        camera = scenes.draw_camera(room, rng)
        if camera is None:
            continue
        before = len(room.places)
        for actor in scenes.draw_actors(room, camera, rng):
            x, y = actor.pose[:2, 3]
            assert room.is_free(x, y, 0.2)
            distance = np.hypot(x - camera[0], y - camera[1])
            assert 0.69 < distance < 8.6
            bearing = np.arctan2(y - camera[1], x - camera[0]) - camera[2]
            assert abs(np.arctan2(np.sin(bearing), np.cos(bearing))) < 0.61
            kinds.append(actor.body.kind)
        assert len(room.places) == before
    assert kinds.count("person") > 10
    assert kinds.count("fire_hydrant") > 2


def test_hard_ones_hide_behind_things_and_pets_come_near() -> None:
    def draw(hard: float) -> tuple[list[float], list[float]]:
        rng, pets, free = np.random.default_rng(4), [], []
        for _ in range(60):
            room = scenes.draw_room(rng)
            scenes.furnish(room, rng, 12)
            camera = scenes.draw_camera(room, rng)
            if camera is None:
                continue
            for actor in scenes.draw_actors(room, camera, rng, pets=0.5, hard=hard):
                x, y = actor.pose[:2, 3]
                if actor.body.kind == "pet":
                    pets.append(float(np.hypot(x - camera[0], y - camera[1])))
                elif actor.body.kind == "person":
                    way = [
                        (camera[0] + t * (x - camera[0]), camera[1] + t * (y - camera[1])) for t in (0.6, 0.7, 0.8, 0.9)
                    ]
                    free.append(all(room.is_free(*point, 0.0) for point in way))
        return pets, free

    (far, open_), (near, hidden) = draw(0.0), draw(1.0)
    assert np.median(near) < 2.0 < np.median(far)
    assert np.mean(hidden) < np.mean(open_) - 0.2


def test_the_house_keeps_its_walls_where_they_are() -> None:
    world = load_world(HOUSE)
    house = scenes.draw_house(np.random.default_rng(3), world)
    walls = {b.name: b.pose for b in house.bodies}
    assert all(np.array_equal(walls[b.name], b.pose) for b in world.bodies)
    assert not house.is_free(5.465, 6.25, 0.0)


def test_test_people_are_reserved_and_training_people_are_not() -> None:
    rng = np.random.default_rng(0)
    assert all(is_reserved(scenes.draw_reserved(rng)) for _ in range(300))
    assert not any(is_reserved(look) for look in scenes.poster_looks(rng))
    assert not any(is_reserved(draw_look(rng)) for _ in range(300))


@pytest.mark.parametrize("maker", sorted({*MAKERS, *SHAPELESS}, key=lambda m: m.__name__), ids=lambda m: m.__name__)
def test_each_thing_can_be_drawn_and_stands_on_the_floor(maker) -> None:
    for seed in range(5):
        body = build("it", maker(np.random.default_rng(seed)), placed(0, 0))
        lowest = min(
            float((mesh_of(v.shape).positions @ v.pose[:3, :3].T + v.pose[:3, 3])[:, 2].min()) for v in body.visuals
        )
        assert -0.1 < lowest < 0.15
        assert all(0 <= c <= 1 for v in body.visuals for c in v.material.rgba)


def test_many_points_are_free_as_each_of_them_is() -> None:
    rng = np.random.default_rng(4)
    room = scenes.draw_room(rng)
    x, y = rng.uniform(-3, 8, (2, 300))
    taken = scenes._taken(room.places, x, y, 0.1)
    assert taken.tolist() == [not room.is_free(px, py, 0.1) for px, py in zip(x, y, strict=True)]
    assert 0 < taken.sum() < len(taken)
    assert not scenes._taken([], x, y, 0.1).any()
    assert scenes._view(room, 0.0, 0.0, 0.3) == next(
        (d for d in np.arange(0.5, 9, 0.5) if not room.is_free(d * np.cos(0.3), d * np.sin(0.3), 0.05)), 9.0
    )
