"""Views in which a network errs most, drawn on purpose: where the camera is, who and what is put before it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rosbot_patrol.simulation.scene.scene import Intrinsics
from training.pictures.furniture import draw_thing, placed
from training.pictures.scenes import (
    Actor,
    Place,
    Rng,
    Scene,
    draw_animal,
    draw_camera,
    draw_hydrant,
    draw_person,
    find_spot,
    reach,
    sees,
)

CASES = {"pair": 0.17, "legs": 0.17, "screen": 0.19, "decoys": 0.14, "far": 0.06, "hydrants": 0.07, "edge": 0.20}
_CAMERA = Intrinsics()
HALF_VIEW = float(np.arctan2(_CAMERA.width / 2, _CAMERA.fx))  # [rad], from the middle of the picture to its side


def pick_case(rng: Rng) -> str:
    """One of `CASES`, by its share."""
    return str(rng.choice(list(CASES), p=list(CASES.values())))


def case_camera(
    case: str, scene: Scene, rng: Rng, things: list[Place] | None = None
) -> tuple[float, float, float] | None:
    """x, y, yaw of a camera for that case, or None where there is no room for one.

    For "edge" one of which the left or right edge cuts a thing that stands there, more often than not a narrow one:
    of a plant its crown is left, of a chair its back. `things`: one of these, not of all that stand there.
    """
    if case == "edge":
        things = [p for p in scene.places if 0.1 < max(p.half_x, p.half_y) < 0.6] if things is None else things
        narrow = [p for p in things if max(p.half_x, p.half_y) < 0.3]
        if narrow and rng.random() < 0.7:
            things = narrow
        x0, x1, y0, y1 = scene.extent
        for _ in range(40 if things else 0):
            thing = things[int(rng.integers(len(things)))]
            away, bearing = float(rng.uniform(0.7, 4.0)), float(rng.uniform(-np.pi, np.pi))
            x, y = thing.x - away * float(np.cos(bearing)), thing.y - away * float(np.sin(bearing))
            if x0 < x < x1 and y0 < y < y1 and scene.is_free(x, y, 0.3) and sees(scene, (x, y), (thing.x, thing.y)):
                half = max(thing.half_x, thing.half_y)
                return x, y, bearing + _to_edge(rng, half / away)
    return draw_camera(scene, rng, open_view=True)


def draw_case(
    case: str,
    scene: Scene,
    camera: tuple[float, float, float],
    rng: Rng,
    *,
    reserved: bool = False,
    shapeless: float = 0.0,
    detailed: float = 0.0,
) -> list[Actor]:
    """One of `CASES`: two people one before the other, legs right before the camera, somebody behind a thing or a pet,
    things one before the other and nobody, people far off, hydrants partly hidden, things cut by the picture's edge.

    Args:
        case: its name.
        scene: where; what stands in the way is kept clear of.
        camera: x, y, yaw.
        rng: chance.
        reserved: draw people that training never sees.
        shapeless: share of the things that are of no kind that has a name (`furniture.draw_thing`).
        detailed: share of people with detailed figures.

    Returns:
        Who and what is there, of four attempts the one that found room for most; things and pets are nothing to find.
        Of the case "edge" the first: often nobody is to be there.
    """
    attempts = range(1 if case == "edge" else 4)
    made = (_Drawing(scene, camera, rng, reserved=reserved, shapeless=shapeless, detailed=detailed) for _ in attempts)
    return max((drawing.draw(case) for drawing in made), key=len)


def _to_edge(rng: Rng, half: float) -> float:
    """The bearing of the left or the right edge of the picture, give or take `half` [rad]."""
    return float(rng.choice([-1.0, 1.0])) * (HALF_VIEW + float(rng.uniform(-half, half)))


class _Drawing:
    """One attempt at a case: puts actors into a scene, and afterwards leaves the scene as it was."""

    def __init__(
        self,
        scene: Scene,
        camera: tuple[float, float, float],
        rng: Rng,
        *,
        reserved: bool,
        shapeless: float,
        detailed: float,
    ) -> None:
        self._scene, self._camera, self._rng = scene, camera, rng
        self._reserved, self._shapeless, self._detailed = reserved, shapeless, detailed
        self._view = reach(scene, *camera)
        self._actors: list[Actor] = []

    def draw(self, case: str) -> list[Actor]:
        """Actors of a case."""
        first = len(self._scene.places)
        draw: dict[str, Callable[[], None]] = {
            "pair": self._pair,
            "legs": self._legs,
            "screen": self._screen,
            "decoys": self._decoys,
            "far": self._far,
            "hydrants": self._hydrants,
            "edge": self._edge,
        }
        draw[case]()
        del self._scene.places[first:]
        return self._actors

    def _pair(self) -> None:
        self._row(["person"] * (2 if self._rng.random() < 0.8 else 3), self._away(0.9, 4.5), (0.4, 1.8), 0.35)

    def _legs(self) -> None:
        rng = self._rng
        for _ in range(1 if rng.random() < 0.75 else 2):
            self._put("person", self._place(self._away(0.6, 1.4), float(rng.uniform(-0.75, 0.75))))
        if rng.random() < 0.5:
            kind = "person" if rng.random() < 0.3 else "any"
            self._put(kind, find_spot(self._scene, self._camera, rng, most=4.0))

    def _screen(self) -> None:
        screens = ["any"] * (1 if self._rng.random() < 0.7 else 2)
        self._row([*screens, "person"], self._away(0.6, 4.5), (0.35, 1.2), 0.3)

    def _decoys(self) -> None:
        self._row(["any"] * int(self._rng.integers(2, 5)), self._away(0.6, 4.0), (0.3, 1.2), 0.35)

    def _far(self) -> None:
        for _ in range(int(self._rng.integers(1, 4))):
            distance = self._away(min(4.5, 0.7 * self._view), 8.5)
            self._put("person", self._place(distance, float(self._rng.uniform(-0.5, 0.5))))

    def _edge(self) -> None:
        rng = self._rng
        for kind, share in (("thing", 0.35), ("person", 0.3), ("any", 0.1)):
            if rng.random() < share:
                distance = float(rng.uniform(0.7, 3.0))
                self._put(kind, self._place(distance, _to_edge(rng, 0.25 / distance)))
        if rng.random() < 0.2:
            self._put("person", find_spot(self._scene, self._camera, rng))

    def _hydrants(self) -> None:
        screen = str(self._rng.choice(["hydrant", "pet", "thing", "person"]))
        self._row([screen, "hydrant"], self._away(0.6, 4.0), (0.3, 1.0), 0.25)

    def _place(self, distance: float, bearing: float) -> tuple[float, float] | None:
        return _place(self._scene, self._camera, distance, bearing)

    def _away(self, least: float, most: float) -> float:
        return float(self._rng.uniform(least, max(least, min(most, self._view - 0.5))))

    def _row(self, kinds: list[str], distance: float, behind: tuple[float, float], aside: float) -> None:
        """One behind the other, each at most `aside` [m] out of line."""
        bearing = float(self._rng.uniform(-0.5, 0.5))
        for kind in kinds:
            turn = float(self._rng.uniform(-aside, aside)) / distance
            self._put(kind, self._place(distance, bearing + turn))
            distance += float(self._rng.uniform(*behind))

    def _put(self, kind: str, spot: tuple[float, float] | None) -> None:
        if spot is None:
            return
        rng, actors = self._rng, self._actors
        name, pose = f"actor{len(actors)}", placed(*spot, 0.0, float(rng.uniform(-np.pi, np.pi)))
        if kind == "any":
            kind = str(rng.choice(["thing", "pet", "hydrant"], p=[0.55, 0.3, 0.15]))
        if kind == "person":
            low = bool(rng.random() < 0.5)
            actors.append(draw_person(rng, name, pose, self._reserved, low=low, detailed=self._detailed))
        elif kind == "hydrant":
            actors.append(draw_hydrant(rng, name, pose, self._reserved))
        elif kind == "pet":
            actors.append(draw_animal(rng, name, spot))
        else:
            actors.append(Actor(draw_thing(rng, name, pose, shapeless=self._shapeless), pose, None, []))
        self._scene.places.append(Place(*spot, 0.1, 0.1, 0.0))


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
