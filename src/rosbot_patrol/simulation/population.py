"""Population of a world: all moving or removable things except the robot, in step with the physics."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Iterator, Sequence

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.actors.doors import SPEED, Door, DoorPlace
from rosbot_patrol.simulation.actors.walkers import Walker
from rosbot_patrol.simulation.noise import noise_of
from rosbot_patrol.simulation.physics.world import Physics
from rosbot_patrol.simulation.scene.boxes import box_body
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.scene.slices import Slice
from rosbot_patrol.simulation.scene.ways import LEVELS, Ways, together
from rosbot_patrol.simulation.sdf.world import ActorPlace

log = logging.getLogger(__name__)


class Population:
    """Actors, doors and boxes.

    Args:
        ways: static bodies, and the free paths of actors.
        physics: physics world that contains their bodies.
        seed: seed of looks and of wandering.
        detailed: draw people with detailed figures.
    """

    def __init__(self, ways: Ways, physics: Physics, seed: int, *, detailed: bool = False) -> None:
        self._ways = ways
        self._physics = physics
        self._seed = seed
        self._detailed = detailed
        self._walkers: dict[str, Walker] = {}
        self._doors: dict[str, Door] = {}
        self.boxes: dict[str, Body] = {}

    @property
    def walkers(self) -> tuple[Walker, ...]:
        """The actors in the order of their arrival."""
        return tuple(self._walkers.values())

    @property
    def doors(self) -> tuple[Door, ...]:
        """The movable doors."""
        return tuple(self._doors.values())

    def __iter__(self) -> Iterator[Walker | Door]:
        yield from self._walkers.values()
        yield from self._doors.values()

    def __contains__(self, name: object) -> bool:
        return name in self._walkers or name in self._doors

    def begin(self, actors: Iterable[ActorPlace], doors: Iterable[DoorPlace]) -> None:
        """Place a world file's actors and doors; a path through a wall is walked, with a warning."""
        for door in doors:
            self.spawn_door(door)
        for actor in actors:
            self.spawn_actor(actor.name, actor.model, "", actor.pose)
            if actor.path:
                try:
                    self.move_actor(actor.name, actor.path, actor.speed, actor.loop)
                except WorldError as err:
                    log.warning("%s; it walks there all the same, as in Gazebo", err)
                    self._walkers[actor.name].walk(actor.path, actor.speed, actor.loop)

    def step(self, dt: float, robot: Pose2D | None, robot_radius: float = 0.0) -> None:
        """Advance all by `dt` [s]."""
        if self._doors:
            self._step_doors(dt, robot, robot_radius)
        doors = self.doors
        for walker in self._walkers.values():
            others = [w for w in self._walkers.values() if w is not walker] if walker.is_roaming else ()
            if walker.step(dt, robot, (*doors, *others)):
                self._physics.move(walker.name, walker.matrix)

    def cut(self, height: float) -> Slice:
        """Horizontal section of all of them at a height [m]."""
        return together([mover.cut(height) for mover in self])

    def sight(self, eye: Sequence[float], points: Sequence[Sequence[float]]) -> float:
        """Share of the points visible from an eye, 0 none to 1 all; each x, y, z [m]. Actors hide nothing."""
        return self._ways.sight.share(eye, points, self._doors.values())

    def cut_of_doors(self, height: float) -> Slice:
        """Horizontal section of the doors at a height [m]."""
        return together([door.cut(height) for door in self._doors.values()])

    def spawn_actor(self, name: str, model: str, look: str, pose: Pose2D, *, posture: str = "") -> str:
        """Place an actor; returns its name, a generated one for "".

        Raises:
            WorldError: the name is taken, the model, look or posture unknown, or the robot stands there.
        """
        name = name or self._new_name(model)
        self._check(f"actor '{name}'", name, pose)
        rng = noise_of(self._seed, f"look of {name}")
        walker = Walker(name, model, look, pose, rng, posture=posture, detailed=self._detailed)
        self._physics.add(walker.body)
        self._physics.move(name, walker.matrix)
        if self._physics.blocker() == name:
            self._physics.remove(name)
            raise _robot_is_there(f"actor '{name}'")
        self._walkers[name] = walker
        return name

    def move_actor(
        self,
        name: str,
        path: Sequence[Pose2D],
        speed: float,
        loop: bool = False,
        *,
        pause: float = 0.0,
        yields: bool = True,
    ) -> None:
        """Make an actor walk along points, or put it somewhere (one point, speed 0).

        Raises:
            WorldError: the name is unknown, a number is invalid, a wall crosses the path, or the robot stands at the
            target of
                a placement.
        """
        walker = self._actor(name)
        before = walker.pose
        finite = all(math.isfinite(v) for p in path for v in p)
        if speed > 0.0 and finite and path:
            self._ways.check(name, [walker.pose, *path, *(path[:1] if loop else ())])
        walker.walk(path, speed, loop, pause=pause, yields=yields)
        self._physics.let_step_over(name, not yields)
        if walker.pose == before:
            return
        self._physics.move(name, walker.matrix)
        if self._physics.blocker() == name:
            walker.walk([before], 0.0)
            self._physics.move(name, walker.matrix)
            raise _robot_is_there(f"actor '{name}'")

    def roam_actor(self, name: str, radius: float, speed: float, *, pause: float = 2.0) -> None:
        """Make an actor wander within a radius [m] of its position, by name and seed; raises WorldError."""
        walker = self._actor(name)

        def is_free(start: Pose2D, goal: Pose2D) -> bool:
            doors = [self.cut_of_doors(level) for level in LEVELS] if self._doors else ()
            return self._ways.is_free(start, goal, walker.radius, doors)

        self._physics.let_step_over(name, False)
        walker.roam(radius, speed, noise_of(self._seed, f"ways of {name}"), is_free, pause=pause)

    def remove(self, name: str) -> None:
        """Remove an actor or a door; raises WorldError if the name is unknown."""
        if self._doors.pop(name, None) is None:
            self._actor(name)
            del self._walkers[name]
        self._physics.remove(name)

    def spawn_door(self, place: DoorPlace) -> None:
        """Add a door, closed.

        Raises:
            WorldError: the name is taken, the leaf is invalid, or the robot stands there.
        """
        name = place.body.name
        self._check(f"door '{name}'", name, Pose2D())
        door = Door(place)
        self._physics.add(door.body)
        if self._physics.blocker() == name:
            self._physics.remove(name)
            raise _robot_is_there(f"door '{name}'")
        self._doors[name] = door

    def set_door(self, name: str, opening: float, speed: float = SPEED) -> None:
        """Start to open (1) or close (0) a door at a speed [rad/s], 0 at once; raises WorldError."""
        if name not in self._doors:
            raise WorldError(f"door '{name}'", f"is not there (there: {', '.join(self._doors) or 'none'})")
        door = self._doors[name]
        before = door.opening
        door.set(opening, speed)
        if door.opening == before:
            return
        self._physics.move(name, door.matrix)
        if self._physics.blocker() == name:
            door.set(before, 0.0)
            self._physics.move(name, door.matrix)
            raise _robot_is_there(f"door '{name}'")

    def place_box(self, name: str, pose: Pose2D, size: tuple[float, float, float]) -> None:
        """Put a box on the floor: `place_thing` of that size.

        Args:
            name: unique in the world.
            pose: its middle and direction.
            size: length, depth and height [m].

        Raises:
            WorldError: the name is taken, or the robot stands there.
        """
        self.place_thing(box_body(name, pose, size), "box")

    def place_thing(self, body: Body, what: str = "thing") -> None:
        """Put a static body where it says.

        Args:
            body: with a name that is unique in the world.
            what: it is, for messages.

        Raises:
            WorldError: the name is taken, or the robot stands there.
        """
        name = body.name
        if not name or name in self or name in self._ways.names:
            raise WorldError(f"{what} '{name}'", "the name is taken" if name else "has no name")
        was_free = self._physics.blocker() is None
        self._physics.add(body)
        if was_free and self._physics.blocker() == name:
            self._physics.remove(name)
            x, y = body.pose[:2, 3]
            raise WorldError(f"{what} '{name}'", f"cannot stand at ({x:.2f}, {y:.2f}), the robot is there")
        self.boxes[name] = body
        self._ways.add(body)

    def remove_box(self, name: str) -> None:
        """Remove a box; raises WorldError if the name is unknown."""
        if name not in self.boxes:
            raise WorldError(f"box '{name}'", f"is not there (there: {', '.join(self.boxes) or 'none'})")
        del self.boxes[name]
        self._physics.remove(name)
        self._ways.remove(name)

    def _step_doors(self, dt: float, robot: Pose2D | None, robot_radius: float) -> None:
        solid = [(w.pose, w.radius) for w in self._walkers.values()]
        if robot is not None:
            solid.append((robot, robot_radius))
        for door in self._doors.values():
            if door.step(dt, solid):
                self._physics.move(door.name, door.matrix)

    def _new_name(self, model: str) -> str:
        number = 1
        taken = self._ways.names
        while f"{model}_{number}" in self or f"{model}_{number}" in taken:
            number += 1
        return f"{model}_{number}"

    def _check(self, what: str, name: str, pose: Pose2D) -> None:
        if not name or name in self or name in self._ways.names:
            raise WorldError(what, "the name is taken" if name else "has no name")
        if not all(map(math.isfinite, pose)):
            raise WorldError(what, f"{tuple(pose)} is no pose")

    def _actor(self, name: str) -> Walker:
        if name not in self._walkers:
            there = ", ".join(self._walkers) or "none"
            raise WorldError(f"actor '{name}'", f"is not there (there: {there})")
        return self._walkers[name]


def _robot_is_there(what: str) -> WorldError:
    return WorldError(what, "cannot stand where the robot is")
