"""Who moves in a world: names, walls, wandering, and that it repeats."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.engine import STEP, Engine, EngineParams
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Body, Collision, Shape
from rosbot_patrol.simulation.scene.ways import Ways
from rosbot_patrol.simulation.sdf.world import ActorPlace, World

ROOT = Path(__file__).parents[3]


def block(x: float, y: float, size: tuple[float, float, float] = (0.1, 4.0, 2.5), name: str = "wall") -> Body:
    shape = Shape(kind="box", size=size)
    pose = from_xyz_rpy((x, y, size[2] / 2.0))
    return Body(name=name, kind="wall", pose=pose, collisions=(Collision(shape=shape),))


@pytest.fixture
def build() -> Iterator[object]:
    engines: list[Engine] = []

    def make(*bodies: Body, actors: tuple[ActorPlace, ...] = (), seed: int = 0) -> Engine:
        engines.append(Engine(World(bodies=bodies, actors=actors), EngineParams(seed=seed)))
        return engines[-1]

    yield make
    for engine in engines:
        engine.close()


def run(engine: Engine, seconds: float) -> None:
    for _ in range(round(seconds / STEP)):
        engine.step()


def test_a_path_through_a_wall_is_refused_and_names_it(build) -> None:
    engine = build(block(2.0, 0.0), block(0.0, 3.0, (1.0, 1.0, 0.7), "table"))
    engine.population.spawn_actor("joe", "person", "", Pose2D())
    with pytest.raises(WorldError, match=r"'joe': cannot walk from \(1\.00, 0\.00\) to \(3\.00, 0\.00\): 'wall' is th"):
        engine.population.move_actor("joe", [Pose2D(1.0, 0.0), Pose2D(3.0, 0.0)], 1.0)
    assert engine.population.walkers[0].pose == Pose2D()
    engine.population.move_actor("joe", [Pose2D(0.0, 4.0)], 1.0)  # over the table: no wall
    engine.population.move_actor("joe", [Pose2D(3.0, 0.0)], 0.0)  # put there
    with pytest.raises(WorldError, match="'wall' is there"):
        engine.population.move_actor(
            "joe", [Pose2D(3.0, 1.0), Pose2D(3.0, 3.0), Pose2D(0.0, 3.0), Pose2D(0.0, 1.0)], 1.0, True
        )


def test_an_actor_whom_a_world_sends_through_a_wall_goes_with_a_warning(build, caplog) -> None:
    walker = ActorPlace(name="ann", model="person", pose=Pose2D(), path=(Pose2D(4.0, 0.0),), speed=1.0)
    with caplog.at_level(logging.WARNING):
        engine = build(block(2.0, 0.0), actors=(walker,))
    assert "'wall' is there; it walks there all the same" in caplog.text
    run(engine, 6.0)
    assert engine.population.walkers[0].pose.x > 3.9


def test_one_who_wanders_meets_neither_walls_nor_furniture(build) -> None:
    table = block(0.0, 1.5, (1.0, 0.8, 0.7), "table")
    engine = build(block(1.5, 0.0), table, block(-1.0, -1.0, (0.6, 0.6, 0.1), "box"))
    engine.population.spawn_actor("tom", "cat", "tabby", Pose2D())
    engine.population.roam_actor("tom", 2.5, 0.8, pause=0.2)
    seen = []
    for _ in range(120):
        run(engine, 0.5)
        seen.append(engine.population.walkers[0].pose)
    assert max(math.hypot(p.x, p.y) for p in seen) > 1.2
    assert all(p.x < 1.45 for p in seen)
    assert not any(abs(p.x) < 0.5 and 1.1 < p.y < 1.9 for p in seen)


def test_one_who_wanders_goes_round_who_stands_there(build) -> None:
    engine = build()
    engine.population.spawn_actor("joe", "person", "visitor", Pose2D(0.8, 0.0))
    engine.population.spawn_actor("ann", "person", "woman", Pose2D(-0.8, 0.0))
    engine.population.spawn_actor("rex", "dog", "terrier", Pose2D())
    engine.population.roam_actor("rex", 1.6, 0.8, pause=0.1)
    rex, gaps, xs = engine.population.walkers[2], [], []
    for _ in range(600):
        run(engine, 0.1)
        gaps += [math.hypot(rex.pose.x - x, rex.pose.y) for x in (0.8, -0.8)]
        xs.append(rex.pose.x)
    assert min(gaps) > 0.25 + rex.radius - 0.01
    assert max(xs) - min(xs) > 1.5


def test_who_wanders_depends_on_seed_and_name_alone(build) -> None:
    def track(seed: int, *others: str) -> list[Pose2D]:
        engine = build(seed=seed)
        for name in others:
            engine.population.spawn_actor(name, "person", "", Pose2D(9.0, 9.0))
            engine.population.roam_actor(name, 1.0, 1.0)
        engine.population.spawn_actor("rex", "dog", "", Pose2D())
        engine.population.roam_actor("rex", 2.0, 1.0)
        if others:
            engine.population.remove(others[0])
        poses = []
        for _ in range(40):
            run(engine, 0.25)
            poses.append(engine.population.walkers[-1].pose)
        return poses

    assert track(1) == track(1, "ann", "bob")
    assert track(1) != track(2)


def test_looks_depend_on_seed_and_name_alone(build) -> None:
    first, second = build(), build()
    second.population.spawn_actor("", "person", "", Pose2D(3.0, 0.0))
    second.population.remove("person_1")
    for engine in (first, second):
        engine.population.spawn_actor("joe", "person", "", Pose2D())
    assert first.population.walkers[0].body.visuals[0].material == second.population.walkers[0].body.visuals[0].material


def test_names_are_made_up_and_unique(build) -> None:
    engine = build(block(5.0, 0.0, name="cat_2"))
    assert [engine.population.spawn_actor("", "cat", "", Pose2D()) for _ in range(2)] == ["cat_1", "cat_3"]
    engine.population.remove("cat_1")
    assert engine.population.spawn_actor("", "cat", "", Pose2D()) == "cat_1"


def test_ways_are_as_wide_as_who_goes() -> None:
    gap = (block(1.0, 2.3), block(1.0, -2.3))  # 0.6 m between them
    ways = Ways(gap)
    assert ways.is_free(Pose2D(), Pose2D(2.0, 0.0), 0.25)
    assert not ways.is_free(Pose2D(), Pose2D(2.0, 0.0), 0.35)
    assert not ways.is_free(Pose2D(0.0, 0.5), Pose2D(0.8, 0.5), 0.2)  # ends too near the wall
    assert ways.is_free(Pose2D(0.0, 0.5), Pose2D(0.0, 0.5), 0.2)
