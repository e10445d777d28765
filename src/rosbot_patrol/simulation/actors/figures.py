"""Figures of actors: the body, the pose of its limbs while it walks, and its horizontal sections."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

import numpy as np

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.actors.people import (
    POSTURES,
    RESERVED_POSTURES,
    Look,
    Posture,
    draw_look,
    hydrant_body,
    look_named,
    person_body,
    person_pose_parts,
)
from rosbot_patrol.simulation.actors.pets import PETS, PetLook, draw_pet, legs_at, pet_body, pet_named, pet_pose_parts
from rosbot_patrol.simulation.actors.posters import PosterFigure
from rosbot_patrol.simulation.scene.matrices import Matrix
from rosbot_patrol.simulation.scene.raycast_kernels import NO_SEGMENTS
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.scene.slices import Slice, slice_bodies

MODELS = ("person", "fire_hydrant", *PETS, "poster")

_PACE_OF_FULL_STEPS = 0.25  # a slower pet takes smaller steps [m/s]
_CYCLE = 1.3  # length of two steps of a person [m]
_SWING = 0.22  # amplitude of a person's foot before and behind the body [m]
_HEAD_AND_TAIL = 0.65  # reach of a pet's head and tail from its middle, in lengths of the trunk
_WARM_SHARES = (0.2, 0.5, 0.75, 0.92)  # shins, hips, chest, head of a person, in heights
_KNEE = 0.8  # a section below cuts through swinging legs [m]


class Figure(Protocol):
    """The body of an actor in its own frame: on the floor, x forward.

    Attributes:
        body: shapes and looks; the owner places it.
        look: name of the look, "" if it has none.
        warmth: distance at which a motion sensor notices it: 1 as for a person, 0 never.
        warm_heights: heights above the floor of the points that represent its warm surface [m].
        radius: radius of its vertical bounding cylinder, without limbs [m].
        cycle: distance walked while each leg takes one step [m].
        turn_rate: turning rate while it walks [rad/s].
    """

    body: Body
    look: str
    warmth: float
    warm_heights: tuple[float, ...]
    radius: float
    cycle: float
    turn_rate: float

    def pose_parts(self, phase: float, speed: float) -> Matrix | None:
        """body_from_visuals, shape (number of visuals, 4, 4), after `phase` cycles at a speed; None if rigid."""

    def cut(self, height: float, phase: float, speed: float) -> Slice:
        """Horizontal section at a height [m]."""


class PersonFigure:
    """A person with a look and a posture."""

    warmth = 1.0
    radius = 0.25
    cycle = _CYCLE
    turn_rate = 2.5

    def __init__(self, name: str, look: Look, posture: Posture) -> None:
        self.body = person_body(name, look)
        self.look = look.name
        self.warm_heights: tuple[float, ...] = tuple(share * look.height for share in _WARM_SHARES)
        self._look = look
        self._posture = posture
        self._cuts = _Cuts(self.body)

    def pose_parts(self, phase: float, speed: float) -> Matrix | None:
        """Poses of the swinging limbs."""
        return person_pose_parts(self._look, phase, speed > 0.0, self._posture)

    def cut(self, height: float, phase: float, speed: float) -> Slice:
        """Section of the two swinging legs, or of the trunk."""
        still = self._cuts.at(height)
        if speed <= 0.0 or height >= _KNEE:
            return still
        circles = still.circles.copy()
        circles[:, 0] += _SWING * math.sin(math.tau * phase) * np.sign(circles[:, 1])
        return Slice(still.segments, circles)


class HydrantFigure:
    """A fire hydrant."""

    warmth = 0.0
    warm_heights: tuple[float, ...] = ()
    radius = 0.15
    cycle = 1.0
    turn_rate = 2.5
    look = ""

    def __init__(self, name: str) -> None:
        self.body = hydrant_body(name)
        self._cuts = _Cuts(self.body)

    def pose_parts(self, phase: float, speed: float) -> Matrix | None:
        """None: no moving parts."""

    def cut(self, height: float, phase: float, speed: float) -> Slice:
        """Section of the pillar."""
        return self._cuts.at(height)


class PetFigure:
    """A cat or a dog."""

    turn_rate = 3.5

    def __init__(self, name: str, look: PetLook) -> None:
        self.body = pet_body(name, look)
        self.look = look.name
        self.warmth = 0.5 if look.model == "cat" else 0.8
        self.warm_heights: tuple[float, ...] = (0.75 * look.height,)
        self.radius = _HEAD_AND_TAIL * look.length * look.height
        self.cycle = look.cycle
        self._look = look
        self._cuts = _Cuts(Body(name=name, kind="pet", collisions=self.body.collisions[:2]))  # trunk and head

    def pose_parts(self, phase: float, speed: float) -> Matrix | None:
        """Poses of the moving legs, head and tail."""
        return pet_pose_parts(self._look, phase, _gait(speed))

    def cut(self, height: float, phase: float, speed: float) -> Slice:
        """Section of trunk and head, and of the legs in their present position."""
        still = self._cuts.at(height)
        legs = legs_at(self._look, height, phase, _gait(speed))
        return still.plus(Slice(NO_SEGMENTS, legs))


class _Cuts:
    """Cached sections of a body at its own origin."""

    def __init__(self, body: Body) -> None:
        self._body = Body(name=body.name, kind=body.kind, collisions=body.collisions)
        self._made: dict[float, Slice] = {}

    def at(self, height: float) -> Slice:
        if height not in self._made:
            self._made[height] = slice_bodies([self._body], height)
        return self._made[height]


def make_figure(
    name: str, model: str, look: str, posture: str, rng: np.random.Generator, *, detailed: bool = False
) -> Figure:
    """Make the figure of an actor.

    Args:
        name: name of the actor.
        model: one of MODELS.
        look: name of a person's or pet's look, "" for a random one.
        posture: posture of a person, "" for standing; other models only stand.
        rng: random generator of the look.
        detailed: draw people, and those on posters, with detailed figures.

    Raises:
        WorldError: the model, look or posture is unknown.
    """
    held = _posture_named(name, posture)
    if model == "person":
        return PersonFigure(name, _look(look, rng, detailed), held)
    if model not in MODELS:
        raise WorldError(f"actor '{name}'", f"is of the model '{model}', expected one of {', '.join(MODELS)}")
    if held != "standing":
        raise WorldError(f"actor '{name}'", f"cannot be '{posture}', a {model} only stands and walks")
    if model == "poster":
        return PosterFigure(name, _look(look, rng, detailed))
    if model == "fire_hydrant":
        return HydrantFigure(name)
    return PetFigure(name, pet_named(model, look) if look else draw_pet(model, rng))


def _look(name: str, rng: np.random.Generator, detailed: bool) -> Look:
    return replace(look_named(name) if name else draw_look(rng), detailed=detailed)


def _posture_named(actor: str, posture: str) -> Posture:
    for known in (*POSTURES, *RESERVED_POSTURES):
        if known == (posture or "standing"):
            return known
    known_ones = ", ".join((*POSTURES, *RESERVED_POSTURES))
    raise WorldError(f"actor '{actor}'", f"cannot be '{posture}', expected one of {known_ones}")


def _gait(speed: float) -> float:
    return min(speed / _PACE_OF_FULL_STEPS, 1.0)
