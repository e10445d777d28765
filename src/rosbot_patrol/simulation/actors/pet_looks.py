"""Looks of cats and dogs: named ones, and their proportions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.actors.looks import Colour


@dataclass(frozen=True, kw_only=True)
class PetLook:
    """The appearance of a pet.

    Attributes:
        height: at the shoulder [m]; length: of the trunk, in heights; depth, width: of the trunk, in heights.
        fur, belly: colours of back and legs, and of chest, muzzle, paws and the tail's tip.
        ears: pricked or hanging; muzzle: length, in heights.
    """

    name: str
    model: str
    height: float
    length: float = 1.0
    depth: float = 0.46
    width: float = 0.36
    fur: Colour = (0.4, 0.3, 0.2)
    belly: Colour = (0.8, 0.75, 0.7)
    ears: str = "hanging"
    muzzle: float = 0.20

    @property
    def leg_radius(self) -> float:
        """Radius of a leg at the lidar's height [m]."""
        return 0.062 * self.height

    @property
    def cycle(self) -> float:
        """Distance walked while each leg takes one step [m]."""
        return 0.75 * self.height


def _cat(name: str, fur: Colour, belly: Colour) -> PetLook:
    return PetLook(
        name=name, model="cat", height=0.25, length=1.30, depth=0.54, width=0.46, fur=fur, belly=belly,
        ears="pricked", muzzle=0.08,
    )  # fmt: skip


PETS: dict[str, dict[str, PetLook]] = {
    "cat": {
        pet.name: pet
        for pet in (
            _cat("tabby", (0.55, 0.47, 0.38), (0.80, 0.74, 0.65)),
            _cat("black", (0.07, 0.07, 0.08), (0.09, 0.09, 0.10)),
            _cat("ginger", (0.80, 0.45, 0.18), (0.92, 0.80, 0.66)),
            _cat("white", (0.90, 0.89, 0.86), (0.95, 0.94, 0.92)),
        )
    },
    "dog": {
        pet.name: pet
        for pet in (
            PetLook(name="labrador", model="dog", height=0.56, fur=(0.83, 0.68, 0.44), belly=(0.88, 0.77, 0.58)),
            PetLook(
                name="shepherd", model="dog", height=0.62, length=1.1, fur=(0.26, 0.18, 0.12), belly=(0.62, 0.43, 0.25),
                ears="pricked", muzzle=0.24,
            ),
            PetLook(name="terrier", model="dog", height=0.34, fur=(0.93, 0.91, 0.87), belly=(0.50, 0.30, 0.16)),
            PetLook(name="spaniel", model="dog", height=0.40, fur=(0.38, 0.16, 0.08), belly=(0.45, 0.22, 0.12)),
        )
    },
}  # fmt: skip


def pet_named(model: str, name: str) -> PetLook:
    """Find a pet's look by its name.

    Raises:
        WorldError: there is no such look; the text lists the existing ones.
    """
    if name not in PETS[model]:
        raise WorldError(name, f"is no look of a {model}; known are {', '.join(PETS[model])}")
    return PETS[model][name]


def draw_pet(model: str, rng: np.random.Generator) -> PetLook:
    """Draw a random look of a cat or a dog."""
    known = list(PETS[model].values())
    return known[int(rng.integers(len(known)))]
