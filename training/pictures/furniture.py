"""Furniture, plants, pets and other things of a house by chance: what stands about and is no person and no hydrant."""

from __future__ import annotations

import colorsys
from collections.abc import Callable

import numpy as np

from rosbot_patrol.simulation.actors.people_meshes import ellipsoid, loft
from rosbot_patrol.simulation.scene.scene import Body, Material, Matrix, Shape, Visual

Rng = np.random.Generator
Colour = tuple[float, float, float]
Piece = tuple[Shape, tuple[float, float, float], Colour, str]

CLOTHS = ("", "", "carpet", "stripes", "checks", "denim")
WOODS = ("wood", "wood", "", "plaster", "marble")


def placed(x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> Matrix:
    """A pose upright on the floor."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1.0]])


def any_colour(rng: Rng) -> Colour:
    """A colour by chance, dull ones more often."""
    return colorsys.hsv_to_rgb(float(rng.random()), float(rng.random() ** 1.5), float(rng.uniform(0.08, 1.0)))


def wood_colour(rng: Rng) -> Colour:
    """A colour of wood, or of painted wood."""
    if rng.random() < 0.3:
        return any_colour(rng)
    level = float(rng.uniform(0.2, 0.95))
    return (level, level * float(rng.uniform(0.6, 0.9)), level * float(rng.uniform(0.35, 0.75)))


def build(name: str, pieces: list[Piece], pose: Matrix) -> Body:
    """A body of pieces."""
    visuals = tuple(
        Visual(shape=shape, pose=placed(*at), material=Material(rgba=(*colour, 1.0), texture=texture))
        for shape, at, colour, texture in pieces
    )
    return Body(name=name, kind="furniture", pose=pose, visuals=visuals)


def box(x: float, y: float, z: float) -> Shape:
    """A box."""
    return Shape(kind="box", size=(x, y, z))


def tube(radius: float, length: float) -> Shape:
    """An upright cylinder."""
    return Shape(kind="cylinder", size=(radius, length))


def _legs(x: float, y: float, z: float, thick: float, colour: Colour) -> list[Piece]:
    corners = [(sx * (x - thick) / 2, sy * (y - thick) / 2, z / 2) for sx in (-1, 1) for sy in (-1, 1)]
    return [(box(thick, thick, z), at, colour, "") for at in corners]


def table(rng: Rng) -> list[Piece]:
    """A table of any size."""
    x, y, z = rng.uniform(0.5, 1.8), rng.uniform(0.5, 1.0), rng.uniform(0.35, 0.95)
    wood, texture = wood_colour(rng), str(rng.choice(WOODS))
    top: Piece = (box(x, y, 0.04), (0, 0, z), wood, texture)
    if rng.random() < 0.2:
        return [top, (tube(0.05, z), (0, 0, z / 2), wood, texture), (tube(0.28, 0.03), (0, 0, 0.015), wood, "")]
    return [top, *_legs(x, y, z, float(rng.uniform(0.03, 0.1)), wood)]


def chair(rng: Rng, seat: float = 0.0) -> list[Piece]:
    """A chair; its back is towards -x."""
    z = seat or float(rng.uniform(0.40, 0.52))
    wood, cloth = wood_colour(rng), any_colour(rng)
    pieces: list[Piece] = [(box(0.42, 0.42, 0.05), (0, 0, z - 0.025), cloth, str(rng.choice(CLOTHS)))]
    high = float(rng.uniform(0.35, 0.6))
    if rng.random() < 0.25:
        pieces += [(tube(0.03, z), (0, 0, z / 2), wood, ""), (tube(0.25, 0.05), (0, 0, 0.03), wood, "")]
    else:
        pieces += _legs(0.42, 0.42, z, 0.04, wood)
    if rng.random() < 0.8:
        pieces.append((box(0.04, 0.42, high), (-0.2, 0, z + high / 2), wood, str(rng.choice(WOODS))))
    return pieces


def sofa(rng: Rng) -> list[Piece]:
    """A sofa or an armchair."""
    y, cloth, texture = rng.uniform(0.8, 2.2), any_colour(rng), str(rng.choice(CLOTHS))
    return [
        (box(0.85, y, 0.4), (0, 0, 0.24), cloth, texture),
        (box(0.22, y, 0.8), (-0.4, 0, 0.44), cloth, texture),
        (box(0.85, 0.18, 0.6), (0, y / 2, 0.34), cloth, texture),
        (box(0.85, 0.18, 0.6), (0, -y / 2, 0.34), cloth, texture),
    ]


def bed(rng: Rng) -> list[Piece]:
    """A bed."""
    y, wood = rng.uniform(0.9, 1.9), wood_colour(rng)
    return [
        (box(2.0, y, 0.25), (0, 0, 0.22), wood, "wood"),
        (box(1.95, y - 0.05, 0.2), (0, 0, 0.44), any_colour(rng), str(rng.choice(CLOTHS))),
        (box(0.06, y, 0.9), (-1.0, 0, 0.45), wood, "wood"),
        (box(0.4, 0.6, 0.12), (-0.7, 0, 0.6), any_colour(rng), ""),
    ]


def cupboard(rng: Rng) -> list[Piece]:
    """A wardrobe, sideboard, fridge or box."""
    x, y, z = rng.uniform(0.3, 0.7), rng.uniform(0.4, 2.0), rng.uniform(0.3, 2.2)
    wood = wood_colour(rng)
    pieces: list[Piece] = [(box(x, y, z), (0, 0, z / 2), wood, str(rng.choice(WOODS)))]
    dark = (wood[0] * 0.5, wood[1] * 0.5, wood[2] * 0.5)
    for i in range(int(rng.integers(0, 4))):
        pieces.append((box(0.02, 0.02, z * 0.95), (x / 2, -y / 2 + (i + 0.5) * y / 4, z / 2), dark, ""))
    return pieces


def shelf(rng: Rng) -> list[Piece]:
    """A shelf with books and things."""
    x, y, z = 0.32, rng.uniform(0.5, 1.4), rng.uniform(0.6, 2.2)
    wood = wood_colour(rng)
    pieces: list[Piece] = [(box(x, 0.03, z), (0, s * y / 2, z / 2), wood, "wood") for s in (-1, 1)]
    pieces.append((box(0.02, y, z), (-x / 2, 0, z / 2), wood, ""))
    for i in range(int(z / 0.38) + 1):
        pieces.append((box(x, y, 0.03), (0, 0, 0.05 + i * 0.38), wood, "wood"))
        if rng.random() < 0.6:
            wide = rng.uniform(0.2, y)
            texture = "books" if rng.random() < 0.6 else ""
            colour = (0.9, 0.9, 0.9) if texture else any_colour(rng)
            pieces.append(
                (box(0.2, wide, 0.28), (0, rng.uniform(-1, 1) * (y - wide) / 2, 0.21 + i * 0.38), colour, texture)
            )
    return pieces


def floor_lamp(rng: Rng) -> list[Piece]:
    """A tall lamp."""
    z, metal = rng.uniform(1.2, 1.9), any_colour(rng)
    wide = rng.uniform(0.1, 0.28)
    shade = loft([(z + 0.3, 0.6 * wide, 0.6 * wide, 0), (z, wide, wide, 0)])
    return [
        (tube(0.15, 0.04), (0, 0, 0.02), metal, ""),
        (tube(float(rng.uniform(0.01, 0.03)), z), (0, 0, z / 2), metal, ""),
        (shade, (0, 0, 0), any_colour(rng), ""),
    ]


def coat_stand(rng: Rng) -> list[Piece]:
    """A stand with coats, bags and hats: as tall and wide as a person, but on a pole."""
    z, wood = rng.uniform(1.5, 1.95), wood_colour(rng)
    pieces: list[Piece] = [(tube(0.025, z), (0, 0, z / 2), wood, ""), (tube(0.2, 0.03), (0, 0, 0.015), wood, "")]
    for _ in range(int(rng.integers(0, 4))):
        turn, long = rng.uniform(0, 6.28), rng.uniform(0.4, 1.05)
        coat = loft([(0, 0.05, 0.07, 0), (-0.1, 0.08, 0.2, 0), (-0.6 * long, 0.10, 0.2, 0), (-long, 0.12, 0.24, 0)])
        at = (0.12 * np.cos(turn), 0.12 * np.sin(turn), z - 0.1)
        pieces.append((coat, at, any_colour(rng), str(rng.choice(CLOTHS))))
    if rng.random() < 0.3:
        pieces.append((ellipsoid(0.14, 0.14, 0.07, at=(0, 0, z)), (0, 0, 0), any_colour(rng), ""))
    return pieces


def plant(rng: Rng) -> list[Piece]:
    """A plant in its pot."""
    pot, stem, wide = rng.uniform(0.15, 0.4), rng.uniform(0.1, 0.9), rng.uniform(0.15, 0.45)
    green = (0.1 + 0.2 * rng.random(), 0.3 + 0.4 * rng.random(), 0.1 + 0.1 * rng.random())
    pieces: list[Piece] = [
        (loft([(pot, 0.18, 0.18, 0), (0, 0.12, 0.12, 0)]), (0, 0, 0), any_colour(rng), ""),
        (tube(0.02, stem), (0, 0, pot + stem / 2), (0.35, 0.22, 0.1), ""),
    ]
    for _ in range(int(rng.integers(1, 6))):
        dx, dy, dz = rng.uniform(-0.2, 0.2, 3)
        leaf = ellipsoid(wide, wide, wide * rng.uniform(0.5, 1.4))
        pieces.append((leaf, (dx, dy, pot + stem + wide / 2 + dz), green, "leaves"))
    return pieces


def post(rng: Rng) -> list[Piece]:
    """Columns, barrels, bins, bottles, cones and rolled carpets: upright round things of any size and colour."""
    radius, z = rng.uniform(0.05, 0.35), rng.uniform(0.15, 2.0)
    top = radius * rng.uniform(0.1, 1.2)
    body = loft(
        [(z, top, top, 0), (z * rng.uniform(0.3, 0.9), radius, radius, 0), (0, radius * rng.uniform(0.7, 1), radius, 0)]
    )
    pieces: list[Piece] = [(body, (0, 0, 0), any_colour(rng), str(rng.choice(["", "", "stripes", "plaster", "wood"])))]
    if rng.random() < 0.3:
        pieces.append((ellipsoid(top, top, top), (0, 0, z + 0.5 * top), any_colour(rng), ""))
    return pieces


def poles(rng: Rng) -> list[Piece]:
    """Two or more poles or pipes beside each other: like legs, but straight and bare."""
    count, radius, z = int(rng.integers(1, 5)), rng.uniform(0.02, 0.09), rng.uniform(0.3, 2.4)
    colour = any_colour(rng)
    return [(tube(radius, z), (0.0, (i - count / 2) * rng.uniform(0.15, 0.3), z / 2), colour, "") for i in range(count)]


def boxes(rng: Rng) -> list[Piece]:
    """A heap of boxes, suitcases, cushions."""
    pieces: list[Piece] = []
    z = 0.0
    for _ in range(int(rng.integers(1, 5))):
        a, b, c = rng.uniform(0.15, 0.7, 3)
        pieces.append((box(a, b, c), (*rng.uniform(-0.1, 0.1, 2), z + c / 2), any_colour(rng), str(rng.choice(CLOTHS))))
        z += c
    return pieces


def curtain(rng: Rng) -> list[Piece]:
    """A curtain in folds."""
    z, count, colour = rng.uniform(1.8, 2.5), int(rng.integers(3, 12)), any_colour(rng)
    return [
        (tube(0.06, z), (0.03 * (i % 2), 0.09 * (i - count / 2), z / 2), colour, str(rng.choice(["", "stripes"])))
        for i in range(count)
    ]


def ball(rng: Rng) -> list[Piece]:
    """A ball or balloon."""
    radius = float(rng.uniform(0.06, 0.4))
    return [(Shape(kind="sphere", size=(radius,)), (0, 0, radius), any_colour(rng), str(rng.choice(["", "checks"])))]


def robot(rng: Rng) -> list[Piece]:
    """Another small robot, or a toy car."""
    x, y, z = rng.uniform(0.15, 0.6), rng.uniform(0.15, 0.5), rng.uniform(0.04, 0.4)
    wheel = ellipsoid(0.05, 0.02, 0.05)
    wheels: list[Piece] = [
        (wheel, (sx * x / 3, sy * y / 2, 0.05), (0.05, 0.05, 0.05), "") for sx in (-1, 1) for sy in (-1, 1)
    ]
    mast: list[Piece] = [(tube(0.03, 0.15), (0, 0, 0.1 + z), any_colour(rng), "")]
    return [(box(x, y, z), (0, 0, 0.06 + z / 2), any_colour(rng), ""), *wheels, *mast]


def pet(rng: Rng) -> list[Piece]:
    """A cat or a dog."""
    s, fur = rng.uniform(0.5, 1.3), any_colour(rng) if rng.random() < 0.2 else wood_colour(rng)
    leg = float(0.3 * s)
    pieces: list[Piece] = [
        (ellipsoid(0.32 * s, 0.11 * s, 0.13 * s), (0, 0, leg + 0.06), fur, ""),
        (ellipsoid(0.13 * s, 0.085 * s, 0.09 * s), (0.36 * s, 0, leg + 0.25 * s), fur, ""),
        (ellipsoid(0.15 * s, 0.02, 0.025), (-0.4 * s, 0, leg + 0.16 * s), fur, ""),
    ]
    pieces += [
        (tube(0.03 * s, leg), (sx * 0.2 * s, sy * 0.06 * s, leg / 2), fur, "") for sx in (-1, 1) for sy in (-1, 1)
    ]
    return pieces


def machine(rng: Rng) -> list[Piece]:
    """A television, a washing machine, a heater, a fan: a box on a stand."""
    z, y = rng.uniform(0.3, 1.2), rng.uniform(0.3, 1.2)
    return [
        (box(0.35, y, 0.06), (0, 0, 0.03), any_colour(rng), ""),
        (tube(0.04, z), (0, 0, z / 2), any_colour(rng), ""),
        (
            box(0.06, y, rng.uniform(0.3, 0.7)),
            (0, 0, z + 0.2),
            (0.03, 0.03, 0.04) if rng.random() < 0.6 else any_colour(rng),
            "",
        ),
    ]


def turned(rng: Rng) -> list[Piece]:
    """One thing turned of any profile: vases, bags, figures, bollards, bottles."""
    z, wide = float(rng.uniform(0.2, 1.9)), float(rng.uniform(0.06, 0.35))
    heights = np.sort(rng.uniform(0, z, int(rng.integers(2, 7))))[::-1]
    rings = []
    for height in (z, *heights, 0.0):
        across, deep = rng.uniform(0.2, 1.0, 2)
        rings.append((float(height), float(wide * across), float(wide * deep), 0.0))
    colour = (float(rng.uniform(0.5, 0.95)), 0.1, 0.08) if rng.random() < 0.12 else any_colour(rng)
    return [(loft(rings), (0, 0, 0), colour, str(rng.choice(CLOTHS)))]


def junk(rng: Rng) -> list[Piece]:
    """A heap or a tower of any shapes in any colours."""
    pieces: list[Piece] = []
    z, reach = 0.0, float(rng.uniform(0.02, 0.3))
    for _ in range(int(rng.integers(2, 9))):
        a, b, c = (float(v) for v in rng.uniform(0.03, 0.5, 3))
        x, y = (float(v) for v in rng.uniform(-reach, reach, 2))
        colour, texture, kind = any_colour(rng), str(rng.choice([*CLOTHS, *WOODS])), rng.random()
        if kind < 0.35:
            pieces.append((box(a, b, 1.5 * c), (x, y, z + 0.75 * c), colour, texture))
        elif kind < 0.6:
            pieces.append((tube(0.4 * a, 2 * c), (x, y, z + c), colour, texture))
        elif kind < 0.8:
            pieces.append((ellipsoid(0.6 * a, 0.6 * b, 0.6 * c, at=(x, y, z + 0.6 * c)), (0, 0, 0), colour, texture))
        else:
            rings = [(1.5 * c, 0.5 * a, 0.5 * b, 0.0), (0.0, 0.5 * b, 0.5 * a, 0.0)]
            pieces.append((loft(rings), (x, y, z), colour, texture))
        z += c * float(rng.choice([0.0, 0.6, 1.2]))
        if z > 1.9:
            break
    return pieces


def dressed(rng: Rng) -> list[Piece]:
    """Clothes and hats on what is nobody: valets, dummies on one foot, tall sacks. Nothing like legs."""
    high = float(rng.uniform(0.9, 1.9))  # where the shoulders would be
    wood, cloth = wood_colour(rng), any_colour(rng)
    foot = high * float(rng.uniform(0.15, 0.75))  # where the clothes end
    wide, deep = float(rng.uniform(0.12, 0.3)), float(rng.uniform(0.05, 0.2))
    pieces: list[Piece] = []
    if rng.random() < 0.75:  # a pole on a plate or a plinth
        pieces.append((tube(float(rng.uniform(0.015, 0.06)), high), (0, 0, high / 2), wood, ""))
        if rng.random() < 0.3:
            side = float(rng.uniform(0.2, 0.45))
            pieces.append((box(side, side, 0.6 * foot), (0, 0, 0.3 * foot), any_colour(rng), str(rng.choice(WOODS))))
        else:
            pieces.append((tube(float(rng.uniform(0.1, 0.28)), 0.04), (0, 0, 0.02), wood, ""))
    else:  # a sack, which stands by itself
        foot = 0.0
    waist = float(rng.uniform(0.5, 1.1))
    middle = foot + (high - foot) * float(rng.uniform(0.3, 0.7))
    hem = float(rng.uniform(0.6, 1.4))
    slope = float(rng.uniform(0.02, 0.15))
    rings = [
        (high, 0.4 * deep, 0.3 * wide, 0.0),
        (high - slope, deep, wide, 0.0),
        (middle, waist * deep, waist * wide, 0.0),
        (foot, hem * deep, hem * wide, 0.0),
    ]
    pieces.append((loft(rings), (0, 0, 0), cloth, str(rng.choice(CLOTHS))))
    if rng.random() < 0.4:  # empty sleeves, or bags at its sides
        drop, thick = float(rng.uniform(0.3, 0.7)), float(rng.uniform(0.03, 0.07))
        colour = cloth if rng.random() < 0.7 else any_colour(rng)
        sleeve = loft([(0, thick, thick, 0), (-drop, 0.8 * thick, 1.1 * thick, 0)])
        pieces += [(sleeve, (0, s * (wide + thick), high - slope), colour, "") for s in (-1, 1)]
    top = high
    if rng.random() < 0.5:  # the pole's end, a knob, something round
        size = float(rng.uniform(0.02, 0.12))
        top += float(rng.uniform(0.0, 0.15)) + size
        pieces.append((ellipsoid(size, size, size * rng.uniform(0.6, 1.5), at=(0, 0, top)), (0, 0, 0), wood, ""))
    if rng.random() < 0.5:  # a hat: crown and brim
        brim, crown = float(rng.uniform(0.1, 0.25)), float(rng.uniform(0.06, 0.2))
        hat, at = any_colour(rng), top + float(rng.uniform(0.0, 0.1))
        pieces.append((tube(brim, 0.02), (0, 0, at), hat, ""))
        pieces.append((tube(0.5 * brim + 0.02, crown), (0, 0, at + crown / 2), hat, ""))
    return pieces


def topiary(rng: Rng) -> list[Piece]:
    """A plant grown as one smooth crown on a bare stem, in a wide pot."""
    pot, stem = float(rng.uniform(0.15, 0.45)), float(rng.uniform(0.05, 0.8))
    wide, high = float(rng.uniform(0.15, 0.4)), float(rng.uniform(0.15, 0.4))
    foot, rim = (float(v) for v in rng.uniform(0.1, 0.25, 2))
    level = float(rng.uniform(0.15, 0.7))
    green = (level * float(rng.uniform(0.1, 0.8)), level, level * float(rng.uniform(0.1, 0.7)))
    clay = (0.62, 0.34, 0.22) if rng.random() < 0.4 else any_colour(rng)
    crown = ellipsoid(wide, wide, wide if rng.random() < 0.6 else high)
    return [
        (loft([(pot, rim, rim, 0), (0, foot, foot, 0)]), (0, 0, 0), clay, ""),
        (tube(float(rng.uniform(0.01, 0.04)), pot + stem), (0, 0, (pot + stem) / 2), wood_colour(rng), ""),
        (crown, (0, 0, pot + stem + 0.7 * high), green, "" if rng.random() < 0.7 else "leaves"),
    ]


MAKERS: tuple[Callable[[Rng], list[Piece]], ...] = (
    table, chair, chair, sofa, bed, cupboard, cupboard, shelf, floor_lamp, floor_lamp, coat_stand, coat_stand,
    coat_stand, plant, plant, post, post, post, poles, poles, boxes, boxes, curtain, ball, robot, pet, machine,
)  # fmt: skip


SHAPELESS = (turned, turned, junk, dressed, topiary)


def draw_thing(rng: Rng, name: str, pose: Matrix, *, shapeless: float = 0.0) -> Body:
    """A thing by chance at that place; with a chance of `shapeless` one of `SHAPELESS`, most of which have no name."""
    makers = SHAPELESS if shapeless and rng.random() < shapeless else MAKERS
    return build(name, makers[int(rng.integers(len(makers)))](rng), pose)
