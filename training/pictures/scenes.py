"""Scenes by chance: a room, or the house of a world file, with furniture and light; and where people could stand in it.

Test sets alone draw the looks and postures that `simulation/actors` reserves for tests.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.simulation.actors.looks import HEIGHTS, LOOKS, RESERVED_HEIGHTS, Look, draw_look
from rosbot_patrol.simulation.actors.people import (
    POSTURES,
    Posture,
    hip_height,
    hydrant_body,
    person_body,
    person_pose_parts,
)
from rosbot_patrol.simulation.actors.pets import PETS, draw_pet, pet_body, pet_pose_parts
from rosbot_patrol.simulation.render.lights import Light
from rosbot_patrol.simulation.scene.scene import Body, Material, Matrix, Shape, Visual
from rosbot_patrol.simulation.scene.shapes import mesh_of
from rosbot_patrol.simulation.sdf.world import World
from training.pictures.furniture import (
    any_colour,
    box,
    build,
    chair,
    draw_thing,
    placed,
    tube,
    wood_colour,
)

Rng = np.random.Generator
FLOORS = ("wood", "tiles", "carpet", "marble", "plaster", "checks", "")
WALLS = ("plaster", "plaster", "", "bricks", "stripes", "tiles", "wood", "marble", "checks")
POSTERS = 8


@dataclass(frozen=True)
class Place:
    """An upright box that stands in the way: middle, half sizes and yaw on the floor."""

    x: float
    y: float
    half_x: float
    half_y: float
    yaw: float

    @functools.cached_property
    def frame(self) -> tuple[float, ...]:
        """Middle, half sizes, cosine and sine of the yaw, as Python's own numbers: one by one faster than numpy's."""
        own = self.x, self.y, self.half_x, self.half_y, np.cos(self.yaw), np.sin(self.yaw)
        return tuple(float(value) for value in own)


@dataclass
class Scene:
    """Bodies that stand still, what is in the way, light, and the extent in which cameras are put."""

    bodies: list[Body]
    light: Light
    extent: tuple[float, float, float, float]
    places: list[Place] = field(default_factory=list)

    def is_free(self, x: float, y: float, margin: float) -> bool:
        """Whether nothing stands within `margin` of a point."""
        x, y = float(x), float(y)
        return all(not _near(p, x, y, margin) for p in self.places)


@dataclass
class Actor:
    """A person, pet or hydrant in a picture; `posture` is a person's."""

    body: Body
    pose: Matrix
    parts: Matrix | None
    extra: list[Body]
    posture: str = ""


def draw_room(rng: Rng, *, shapeless: float = 0.0) -> Scene:
    """A room by chance; that share of its furniture is of no kind that has a name."""
    x, y, z = float(rng.uniform(3.5, 16.0)), float(rng.uniform(3.5, 12.0)), float(rng.uniform(2.1, 3.2))
    bodies = [_floor(rng)]
    places: list[Place] = []
    plain = rng.random() < 0.45
    colour, texture = _wall_paint(rng), str(rng.choice(WALLS))
    sides = [(x / 2, 0, 0.15, y), (-x / 2, 0, 0.15, y), (0, y / 2, x, 0.15), (0, -y / 2, x, 0.15)]
    for i, (wx, wy, sx, sy) in enumerate(sides):
        if not plain:
            colour, texture = _wall_paint(rng), str(rng.choice(WALLS))
        if rng.random() < 0.93:
            bodies.append(build(f"wall{i}", [(box(sx, sy, z), (0, 0, z / 2), colour, texture)], placed(wx, wy)))
        places.append(Place(wx, wy, sx / 2, sy / 2, 0.0))
    for i in range(int(rng.integers(0, 4))):
        long, yaw = float(rng.uniform(0.6, 4.0)), float(rng.choice([0, np.pi / 2, rng.uniform(0, 3)]))
        wx, wy = float(rng.uniform(-x, x) / 2), float(rng.uniform(-y, y) / 2)
        high = z if rng.random() < 0.8 else float(rng.uniform(0.4, 1.5))
        bodies.append(
            build(f"part{i}", [(box(long, 0.15, high), (0, 0, high / 2), colour, texture)], placed(wx, wy, 0, yaw))
        )
        places.append(Place(wx, wy, long / 2, 0.08, yaw))
    if rng.random() < 0.5:
        ceiling = Shape(kind="plane", size=(x, y))
        level = float(rng.uniform(0.5, 1.0))
        bodies.append(build("ceiling", [(ceiling, (0, 0, z), (level, level, level), "")], placed(0, 0)))
    bodies += _wall_things(rng, x, y, z)
    scene = Scene(bodies, _draw_light(rng, x, y, z), (-x / 2, x / 2, -y / 2, y / 2), places)
    furnish(scene, rng, int(rng.integers(0, 16)), shapeless=shapeless)
    return scene


def draw_house(rng: Rng, world: World, *, plain: bool = False, shapeless: float = 0.0) -> Scene:
    """The house of a world, in its own colours or painted by chance, with some more furniture; `plain`: as it is."""
    bodies = list(world.bodies)
    places = [p for b in bodies for p in footprints(b)]
    if not plain and rng.random() < 0.6:
        bodies = [_repaint(b, rng) for b in bodies]
    walls = np.array([(p.x, p.y) for p in places])
    low, high = walls.min(axis=0), walls.max(axis=0)
    wide, deep = high - low
    light = _draw_light(rng, wide, deep, 2.5) if not plain and rng.random() < 0.6 else Light()
    scene = Scene(bodies, light, (low[0], high[0], low[1], high[1]), places)
    furnish(scene, rng, 0 if plain else int(rng.integers(0, 25)), shapeless=shapeless)
    return scene


def furnish(scene: Scene, rng: Rng, count: int, *, shapeless: float = 0.0) -> None:
    """Put things by chance where there is room."""
    x0, x1, y0, y1 = scene.extent
    for i in range(count):
        x, y = float(rng.uniform(x0, x1)), float(rng.uniform(y0, y1))
        if scene.is_free(x, y, 0.35):
            pose = placed(x, y, 0, float(rng.uniform(0, 2 * np.pi)))
            body = draw_thing(rng, f"thing{i}", pose, shapeless=shapeless)
            scene.bodies.append(body)
            scene.places += footprints(body)


def draw_camera(scene: Scene, rng: Rng, *, open_view: bool = False) -> tuple[float, float, float] | None:
    """x, y, yaw of a robot with room about it, or None where none was found; `open_view`: looks where there is room."""
    x0, x1, y0, y1 = scene.extent
    for _ in range(60):
        x, y = float(rng.uniform(x0, x1)), float(rng.uniform(y0, y1))
        if scene.is_free(x, y, 0.3):
            yaws = [float(rng.uniform(-np.pi, np.pi)) for _ in range(6)]
            if open_view:
                return x, y, max(yaws, key=lambda yaw: reach(scene, x, y, yaw) * rng.uniform(0.5, 1.0))
            return x, y, max(yaws, key=lambda yaw: _view(scene, x, y, yaw)) if rng.random() < 0.65 else yaws[0]
    return None


def draw_actors(
    scene: Scene,
    camera: tuple[float, float, float],
    rng: Rng,
    *,
    reserved: bool = False,
    pets: float = 0.0,
    hard: float = 0.0,
    detailed: float = 0.0,
) -> list[Actor]:
    """People and hydrants before a camera, where there is room for them; often none at all.

    Args:
        scene: where; what stands in the way is kept clear of.
        camera: x, y, yaw.
        rng: chance.
        reserved: draw people that training never sees.
        pets: share of the views with a cat or a dog, or two, as well; they come last and are nothing to be found.
        hard: that share of people stands behind furniture, sits or crouches, and of pets right before the camera.
        detailed: share of people with detailed figures.
    """
    people = int(rng.choice([0, 1, 2, 3, 4], p=[0.30, 0.47, 0.14, 0.06, 0.03]))
    hydrants = int(rng.choice([0, 1, 2], p=[0.76, 0.20, 0.04]))
    actors: list[Actor] = []
    for i in range(people + hydrants):
        is_hard = bool(hard) and i < people and bool(rng.random() < hard)
        spot = _hidden_spot(scene, camera, rng) if is_hard else find_spot(scene, camera, rng)
        if spot is None:
            continue
        pose = placed(*spot, 0.0, float(rng.uniform(-np.pi, np.pi)))
        if i < people:
            actors.append(draw_person(rng, f"actor{i}", pose, reserved, low=is_hard, detailed=detailed))
        else:
            actors.append(draw_hydrant(rng, f"actor{i}", pose, reserved))
        if not (i < people and rng.random() < 0.25):
            scene_margin = Place(spot[0], spot[1], 0.15, 0.15, 0.0)
            scene.places.append(scene_margin)
    for _ in actors:
        if scene.places and scene.places[-1].half_x == 0.15:
            scene.places.pop()
    if pets and rng.random() < pets:
        near = 2.5 if hard and rng.random() < hard else 0.0
        spots = [find_spot(scene, camera, rng, most=near) for _ in range(int(rng.integers(1, 3)))]
        actors += [draw_animal(rng, f"pet{i}", spot) for i, spot in enumerate(spots) if spot is not None]
    return actors


def draw_person(
    rng: Rng, name: str, pose: Matrix, reserved: bool, *, low: bool = False, detailed: float = 0.0
) -> Actor:
    """A person by chance; a reserved one has a height, colour, mask or posture that training never draws.

    Args:
        rng: chance.
        name: of the body.
        pose: on the floor, in the world.
        reserved: such a one.
        low: sits or crouches more often.
        detailed: probability of a detailed figure, instead of a plain one.
    """
    look = draw_look(rng) if rng.random() < 0.9 else _named(rng)
    posture: Posture = rng.choice(POSTURES, p=[0.45, 0.30, 0.25] if low else [0.80, 0.12, 0.08]).item()
    if reserved:
        look = draw_reserved(rng)
        posture = rng.choice(["standing", "creeping", "sitting", "crouching"], p=[0.55, 0.25, 0.1, 0.1]).item()
    walking = posture == "creeping" or bool(rng.random() < 0.55)
    look = replace(look, detailed=detailed >= 1.0 or (detailed > 0.0 and bool(rng.random() < detailed)))
    phase = float(rng.random())
    parts = person_pose_parts(look, phase, walking, posture)
    extra: list[Body] = []
    if posture == "sitting" and rng.random() < 0.85:
        seat = hip_height(look, phase, walking, posture) - 0.09
        extra.append(build(name + "_chair", chair(rng, seat), pose @ placed(-0.05, 0.0)))
    return Actor(person_body(name, look), pose, parts, extra, posture)


def draw_reserved(rng: Rng) -> Look:
    """A look that training never draws."""
    tests = [look for look in LOOKS.values() if look.name.startswith("intruder_test_")]
    if rng.random() < 0.4:
        return tests[int(rng.integers(len(tests)))]
    look = replace(draw_look(rng), height=float(rng.uniform(*RESERVED_HEIGHTS)))
    if rng.random() < 0.5:
        return replace(look, mask=any_colour(rng), hair_style="bald")
    return replace(look, top=tests[1].top, hair_style="hood")


def poster_looks(rng: Rng, *, reserved: bool = False) -> list[Look]:
    """Who is on the posters on the walls: people as flat pictures, which are no people."""
    if reserved:
        return [draw_reserved(rng) for _ in range(POSTERS)]
    return [replace(draw_look(rng), height=float(rng.uniform(*HEIGHTS))) for _ in range(POSTERS)]


def _named(rng: Rng) -> Look:
    plain = [look for look in LOOKS.values() if not look.name.startswith("intruder_test_")]
    return plain[int(rng.integers(len(plain)))]


def draw_hydrant(rng: Rng, name: str, pose: Matrix, reserved: bool) -> Actor:
    """A fire hydrant by chance, red or yellow more often than not."""
    red = (float(rng.uniform(0.5, 0.95)), float(rng.uniform(0.03, 0.2)), float(rng.uniform(0.02, 0.15)))
    yellow = (float(rng.uniform(0.7, 1.0)), float(rng.uniform(0.55, 0.8)), float(rng.uniform(0.02, 0.2)))
    colour = red if rng.random() < 0.6 else yellow if rng.random() < 0.6 else any_colour(rng)
    caps = any_colour(rng) if rng.random() < 0.5 else None
    return Actor(hydrant_body(name, colour, caps=caps, height=float(rng.uniform(0.6, 0.95))), pose, None, [])


def draw_animal(rng: Rng, name: str, spot: tuple[float, float]) -> Actor:
    """A cat or a dog by chance, at a spot [m] on the floor; nothing to be found."""
    look = draw_pet(str(rng.choice(sorted(PETS))), rng)
    if rng.random() < 0.4:
        look = replace(look, fur=wood_colour(rng), height=look.height * float(rng.uniform(0.8, 1.25)))
    parts = pet_pose_parts(look, float(rng.random()), float(rng.integers(2)))
    return Actor(pet_body(name, look), placed(*spot, 0.0, float(rng.uniform(-np.pi, np.pi))), parts, [])


def _hidden_spot(scene: Scene, camera: tuple[float, float, float], rng: Rng) -> tuple[float, float] | None:
    """A free spot behind something that is in view, as near to it as somebody hides; else any."""
    x, y, yaw = camera
    x0, x1, y0, y1 = scene.extent
    for k in rng.permutation(len(scene.places)):
        place = scene.places[int(k)]
        away, bearing = np.hypot(place.x - x, place.y - y), np.arctan2(place.y - y, place.x - x)
        aside = abs(np.remainder(bearing - yaw + np.pi, 2 * np.pi) - np.pi)
        if max(place.half_x, place.half_y) > 1.3 or not 0.7 < away < 6.0 or aside > 0.5:
            continue
        bearing += float(rng.normal(0.0, 0.5 * max(place.half_x, place.half_y) / away))
        for behind in np.arange(0.25, 1.6, 0.15):
            px, py = x + (away + behind) * np.cos(bearing), y + (away + behind) * np.sin(bearing)
            if x0 < px < x1 and y0 < py < y1 and scene.is_free(px, py, 0.22):
                if sees(scene, (x, y), (px, py)):
                    return float(px), float(py)
                break
    return find_spot(scene, camera, rng)


def find_spot(
    scene: Scene, camera: tuple[float, float, float], rng: Rng, *, most: float = 0.0
) -> tuple[float, float] | None:
    """A free spot [m] before a camera, hardly ever behind a wall, or None; `most`: no farther than that [m]."""
    x, y, yaw = camera
    near = float(np.exp(rng.uniform(np.log(0.7), np.log(8.5))))
    distance = near if rng.random() < 0.35 else float(rng.uniform(1.2, 8.5))
    if most:
        distance = float(rng.uniform(0.6, most))
    for attempt in range(30):
        if attempt >= 12:
            distance = max(0.7, distance * 0.93)
        bearing = yaw + float(rng.uniform(-0.6, 0.6))
        px, py = x + distance * np.cos(bearing), y + distance * np.sin(bearing)
        x0, x1, y0, y1 = scene.extent
        inside = x0 < px < x1 and y0 < py < y1
        if inside and scene.is_free(px, py, 0.22) and (rng.random() < 0.05 or sees(scene, (x, y), (px, py))):
            return float(px), float(py)
    return None


def reach(scene: Scene, x: float, y: float, yaw: float) -> float:
    """How far that way is free, up to 9 m."""
    ways = np.arange(0.4, 9.0, 0.15)[:, None]
    px, py, hx, hy, turn = np.array([(p.x, p.y, p.half_x, p.half_y, p.yaw) for p in scene.places]).reshape(-1, 5).T
    dx, dy = x + ways * np.cos(yaw) - px, y + ways * np.sin(yaw) - py
    along, across = np.cos(turn) * dx + np.sin(turn) * dy, -np.sin(turn) * dx + np.cos(turn) * dy
    hit = ((np.abs(along) < hx + 0.05) & (np.abs(across) < hy + 0.05)).any(axis=1)
    return float(ways[hit.argmax(), 0]) if hit.any() else 9.0


def _view(scene: Scene, x: float, y: float, yaw: float) -> float:
    """How far one sees that way, up to 9 m; by half metres, as the test pictures are drawn: some walls are missed."""
    ways = np.arange(0.5, 9.0, 0.5)
    hit = _taken(scene.places, x + ways * np.cos(yaw), y + ways * np.sin(yaw), 0.05)
    return float(ways[hit.argmax()]) if hit.any() else 9.0


def sees(scene: Scene, start: tuple[float, float], end: tuple[float, float]) -> bool:
    """Whether no wall stands between two points."""
    ways = np.linspace(0.05, 0.95, 24)
    points = np.array(start) + ways[:, None] * (np.array(end) - np.array(start))
    walls = [p for p in scene.places if max(p.half_x, p.half_y) > 0.5 and min(p.half_x, p.half_y) < 0.1]
    return not _taken(walls, points[:, 0], points[:, 1], 0.0).any()


def _near(place: Place, x: float, y: float, margin: float) -> bool:
    place_x, place_y, half_x, half_y, c, s = place.frame
    dx, dy = x - place_x, y - place_y
    return abs(c * dx + s * dy) < half_x + margin and abs(-s * dx + c * dy) < half_y + margin


def _taken(places: list[Place], x: NDArray[Any], y: NDArray[Any], margin: float) -> NDArray[Any]:
    """Of many points, shape (N,), whether one of the places is as near as that: `_near` for all of them at once."""
    frames = np.array([place.frame for place in places]).reshape(-1, 6, 1)
    place_x, place_y, half_x, half_y, c, s = frames.transpose(1, 0, 2)
    dx, dy = x - place_x, y - place_y
    near = (np.abs(c * dx + s * dy) < half_x + margin) & (np.abs(-s * dx + c * dy) < half_y + margin)
    return np.asarray(near.any(axis=0))


def footprints(body: Body) -> list[Place]:
    """What of a body stands in the way on the floor; nothing of what is higher than 1.6 m."""
    places: list[Place] = []
    if body.kind == "floor":
        return places
    for visual in body.visuals:
        shape, size = visual.shape, visual.shape.size
        if shape.kind == "plane":
            continue
        matrix = body.pose @ visual.pose
        if matrix[2, 3] > 1.6:
            continue
        if shape.kind == "box":
            half = (size[0] / 2, size[1] / 2)
        elif shape.kind == "mesh":
            half = _half_sizes(mesh_of(shape).positions)
        elif shape.vertices is not None:
            half = _half_sizes(shape.vertices)
        else:
            half = (size[0], size[0]) if size else (0.3, 0.3)
        yaw = float(np.arctan2(matrix[1, 0], matrix[0, 0]))
        places.append(Place(float(matrix[0, 3]), float(matrix[1, 3]), *half, yaw))
    return places


def _half_sizes(vertices: Matrix) -> tuple[float, float]:
    """Of the upright box about the origin that holds vertices, shape (V, 3)."""
    x, y = np.abs(vertices[:, :2]).max(axis=0)
    return x, y


def _floor(rng: Rng) -> Body:
    shape = Shape(kind="plane", size=(60, 60))
    colour = wood_colour(rng) if rng.random() < 0.6 else any_colour(rng)
    return build("floor", [(shape, (0, 0, 0), colour, str(rng.choice(FLOORS)))], placed(0, 0))


def _wall_paint(rng: Rng) -> tuple[float, float, float]:
    if rng.random() < 0.3:
        return any_colour(rng)
    level = float(rng.uniform(0.45, 1.0))
    r, g, b = np.clip(level + rng.uniform(-0.08, 0.08, 3), 0, 1)
    return (float(r), float(g), float(b))


def _wall_things(rng: Rng, x: float, y: float, z: float) -> list[Body]:
    """Posters, pictures, windows, doors and skirtings on the walls."""
    things = []
    for i in range(int(rng.integers(0, 7))):
        wide, high = float(rng.uniform(0.3, 1.4)), float(rng.uniform(0.3, 1.3))
        middle = float(rng.uniform(0.9, max(z - 0.4, 1.0)))
        kind = rng.random()
        colour, texture = (0.95, 0.95, 0.95), "picture"
        if kind < 0.3:
            texture, wide, high = f"poster{int(rng.integers(POSTERS))}", 0.55 * high + 0.2, high
        elif kind < 0.6:
            colour, texture = any_colour(rng), ""
            if rng.random() < 0.5:
                wide, high, middle = 0.9, 2.0, 1.0
        side, along = int(rng.integers(4)), float(rng.uniform(-0.4, 0.4))
        yaw = side * np.pi / 2
        reach = (x / 2, y / 2, x / 2, y / 2)[side] - 0.085
        off = along * (y, x, y, x)[side]
        px, py = reach * np.cos(yaw) - off * np.sin(yaw), reach * np.sin(yaw) + off * np.cos(yaw)
        thing = box(0.03, wide, high)
        things.append(build(f"on_wall{i}", [(thing, (0, 0, middle), colour, texture)], placed(px, py, 0, yaw)))
    if rng.random() < 0.2:
        pipe = tube(float(rng.uniform(0.02, 0.1)), z)
        things.append(build("pipe", [(pipe, (x / 2 - 0.2, y / 2 - 0.3, z / 2), any_colour(rng), "")], placed(0, 0)))
    return things


def _draw_light(rng: Rng, x: float, y: float, z: float) -> Light:
    if rng.random() < 0.2:
        return Light()
    level = 1.35 * float(np.exp(rng.uniform(np.log(0.25), 0.0))) if rng.random() < 0.3 else float(rng.uniform(0.8, 1.5))
    warm = np.array([1.0, 1.0, 1.0]) + rng.uniform(-0.15, 0.15, 3)
    sun, lamp = rng.dirichlet([1.2, 1.0]) * rng.uniform(0.1, 0.9)
    soft = max(1.0 - sun, 0.35)
    tilt = rng.uniform(-1, 1, 3)
    return Light(
        sun_direction=(float(tilt[0]), float(tilt[1]), float(rng.uniform(0.1, 1.0))),
        sun=_rgb(warm * level * sun),
        above=_rgb(level * soft * rng.uniform(0.5, 0.95) * (2 - warm)),
        below=_rgb(level * soft * rng.uniform(0.2, 0.7)),
        lamp_place=(float(rng.uniform(-x, x) / 2), float(rng.uniform(-y, y) / 2), float(z * rng.uniform(0.4, 0.95))),
        lamp=_rgb(warm * level * lamp * 1.5),
        lamp_reach=float(rng.uniform(1.5, 6.0)),
        sky=_rgb(rng.uniform(0, 1, 3) * 0.5 + rng.uniform(0, 0.5)),
    )


def _rgb(values: NDArray[Any] | float) -> tuple[float, float, float]:
    r, g, b = np.broadcast_to(np.clip(values, 0.0, 1.5), 3)
    return (float(r), float(g), float(b))


def _repaint(body: Body, rng: Rng) -> Body:
    texture = str(rng.choice(FLOORS if body.kind == "floor" else WALLS if body.kind == "wall" else ("", "wood", "")))
    colour = _wall_paint(rng) if body.kind == "wall" else wood_colour(rng)
    keep = body.kind == "furniture"
    visuals = tuple(_painted(v, (*(any_colour(rng) if keep else colour), 1.0), texture) for v in body.visuals)
    return replace(body, visuals=visuals)


def _painted(visual: Visual, rgba: tuple[float, float, float, float], texture: str) -> Visual:
    return replace(visual, material=Material(rgba=rgba, texture=texture))
