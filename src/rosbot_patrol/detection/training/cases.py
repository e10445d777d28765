"""Views in which a network errs most, drawn on purpose: who and what is put before a camera, one before the other."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.detection.training.furniture import draw_thing, placed
from rosbot_patrol.detection.training.scenes import (
    Actor,
    Place,
    Rng,
    Scene,
    draw_animal,
    draw_hydrant,
    draw_person,
    find_spot,
    reach,
    sees,
)

CASES = {"pair": 0.22, "legs": 0.22, "screen": 0.24, "decoys": 0.17, "far": 0.07, "hydrants": 0.08}


def draw_case(
    scene: Scene, camera: tuple[float, float, float], rng: Rng, reserved: bool = False, shapeless: float = 0.0
) -> list[Actor]:
    """One of `CASES`, by its share: two people one before the other, legs right before the camera, somebody behind a
    thing or a pet, things one before the other and nobody, people far off, hydrants partly hidden.

    Args:
        scene: where; what stands in the way is kept clear of.
        camera: x, y, yaw.
        rng: chance.
        reserved: draw people that training never sees.
        shapeless: share of the things that are of no kind that has a name (`furniture.draw_thing`).

    Returns:
        Who and what is there, of four attempts the one that found room for most; things and pets are nothing to find.
    """
    case = str(rng.choice(list(CASES), p=list(CASES.values())))
    return max((_draw(case, scene, camera, rng, reserved, shapeless) for _ in range(4)), key=len)


def _draw(
    case: str, scene: Scene, camera: tuple[float, float, float], rng: Rng, reserved: bool, shapeless: float
) -> list[Actor]:
    actors: list[Actor] = []
    first, view = len(scene.places), reach(scene, *camera)

    def away(least: float, most: float) -> float:
        return float(rng.uniform(least, max(least, min(most, view - 0.5))))

    def put(kind: str, spot: tuple[float, float] | None) -> None:
        if spot is None:
            return
        name, pose = f"actor{len(actors)}", placed(*spot, 0.0, float(rng.uniform(-np.pi, np.pi)))
        if kind == "any":
            kind = str(rng.choice(["thing", "pet", "hydrant"], p=[0.55, 0.3, 0.15]))
        if kind == "person":
            actors.append(draw_person(rng, name, pose, reserved, low=bool(rng.random() < 0.5)))
        elif kind == "hydrant":
            actors.append(draw_hydrant(rng, name, pose, reserved))
        elif kind == "pet":
            actors.append(draw_animal(rng, name, spot))
        else:
            actors.append(Actor(draw_thing(rng, name, pose, shapeless=shapeless), pose, None, []))
        scene.places.append(Place(*spot, 0.1, 0.1, 0.0))

    def row(kinds: list[str], distance: float, behind: tuple[float, float], aside: float) -> None:
        """One behind the other, each at most `aside` [m] out of line."""
        bearing = float(rng.uniform(-0.5, 0.5))
        for kind in kinds:
            turn = float(rng.uniform(-aside, aside)) / distance
            put(kind, _place(scene, camera, distance, bearing + turn))
            distance += float(rng.uniform(*behind))

    if case == "pair":
        row(["person"] * (2 if rng.random() < 0.8 else 3), away(0.9, 4.5), (0.4, 1.8), 0.35)
    elif case == "legs":
        for _ in range(1 if rng.random() < 0.75 else 2):
            put("person", _place(scene, camera, away(0.6, 1.4), float(rng.uniform(-0.75, 0.75))))
        if rng.random() < 0.5:
            put("person" if rng.random() < 0.3 else "any", find_spot(scene, camera, rng, most=4.0))
    elif case == "screen":
        screens = ["any"] * (1 if rng.random() < 0.7 else 2)
        row([*screens, "person"], away(0.6, 4.5), (0.35, 1.2), 0.3)
    elif case == "decoys":
        row(["any"] * int(rng.integers(2, 5)), away(0.6, 4.0), (0.3, 1.2), 0.35)
    elif case == "far":
        for _ in range(int(rng.integers(1, 4))):
            put("person", _place(scene, camera, away(min(4.5, 0.7 * view), 8.5), float(rng.uniform(-0.5, 0.5))))
    else:
        screen = str(rng.choice(["hydrant", "pet", "thing", "person"]))
        row([screen, "hydrant"], away(0.6, 4.0), (0.3, 1.0), 0.25)
    del scene.places[first:]
    return actors


def _place(
    scene: Scene, camera: tuple[float, float, float], distance: float, bearing: float
) -> tuple[float, float] | None:
    """The spot at that distance and bearing [rad] before a camera, if it is free and no wall hides it."""
    x, y, yaw = camera
    px, py = x + distance * np.cos(yaw + bearing), y + distance * np.sin(yaw + bearing)
    x0, x1, y0, y1 = scene.extent
    if x0 < px < x1 and y0 < py < y1 and scene.is_free(px, py, 0.2) and sees(scene, (x, y), (px, py)):
        return float(px), float(py)
    return None
