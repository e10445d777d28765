"""A detailed person: visuals of a look, each with its joint, and their poses."""

from __future__ import annotations

import functools

import numpy as np

from rosbot_patrol.simulation.actors.figure import hands_feet, limbs, trunk
from rosbot_patrol.simulation.actors.figure import head as heads
from rosbot_patrol.simulation.actors.figure.assembly import Part, assemble
from rosbot_patrol.simulation.actors.figure.skeleton import HIP, SIDES, angles_of, body_from_rest
from rosbot_patrol.simulation.actors.figure.surface import Skin
from rosbot_patrol.simulation.actors.figure.wardrobe import WHITE, outfit_of
from rosbot_patrol.simulation.actors.looks import Colour, Look
from rosbot_patrol.simulation.scene.scene import Material, Matrix, Visual

_SOCKS: tuple[Colour, ...] = ((0.9, 0.9, 0.9), (0.15, 0.15, 0.17), (0.45, 0.45, 0.48))


def visuals(look: Look) -> tuple[Visual, ...]:
    """Visuals at rest; `pose_parts` gives their poses in the same order."""
    return tuple(Visual(shape=part.shape, material=part.material) for part in _parts(look))


def pose_parts(look: Look, phase: float, walking: bool, posture: str) -> Matrix:
    """Poses of the visuals, body_from_visuals, shape (number of visuals, 4, 4).

    Args:
        look: of the person.
        phase: share of a cycle of two steps.
        walking: whether the legs walk.
        posture: as in `people.py`.
    """
    moved = body_from_rest(look.height, look.build, angles_of(outfit_of(look).seed, phase, walking, posture))
    return np.array([moved[part.joint] for part in _parts(look)])


def hip_height(look: Look, phase: float, walking: bool, posture: str) -> float:
    """Height of the hip joints above the floor [m]."""
    moved = body_from_rest(look.height, look.build, angles_of(outfit_of(look).seed, phase, walking, posture))
    return float(moved["pelvis"][2, 2] * HIP * look.height + moved["pelvis"][2, 3])


@functools.lru_cache(maxsize=64)
def _parts(look: Look) -> tuple[Part, ...]:
    return assemble([(s, Material(rgba=(*colour, 1.0), texture=texture)) for s, colour, texture in _dressed(look)])


def _dressed(look: Look) -> list[tuple[Skin, Colour, str]]:
    """Skins with their colours and textures."""
    outfit = outfit_of(look)
    cloth = {"top": (look.top, look.top_texture), "bottom": (look.bottom, look.bottom_texture), "skin": (look.skin, "")}
    found = [(s, *cloth["top"]) for s in trunk.top(look, outfit)]
    below = trunk.skirt if look.legs == "skirt" else trunk.hips
    found.append((below(look, outfit), *cloth["bottom"]))
    if look.backpack is not None:
        found += [(s, look.backpack, "") for s in trunk.backpack(look)]
    for side, sign in SIDES:
        found += [(s, *cloth[kind]) for s, kind in limbs.leg(look, outfit, side, sign)]
        found += [(s, *cloth[kind]) for s, kind in limbs.arm(look, outfit, side, sign)]
        found += [(s, look.skin, "") for s in hands_feet.hand(look, side, sign)]
        shoes, socks = hands_feet.shoe(look, outfit, side, sign)
        found += [(s, WHITE, "") for s in shoes] + [(s, _SOCKS[outfit.seed % 3], "") for s in socks]
    found += [(s, WHITE, "") for s in heads.head(look, outfit)]
    hair = heads.hair(look, outfit)
    if hair is not None:
        found += [(s, hair[1], look.top_texture if look.hair_style == "hood" else "") for s in hair[0]]
    return found
