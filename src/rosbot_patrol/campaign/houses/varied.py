"""A strange world as a patrol finds it: some furniture moved since the map was made, doors in its doorways."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.campaign.floor import CELL, PERSON_HEIGHTS, ROBOT_HEIGHTS, Floor
from rosbot_patrol.campaign.houses.doorways import find_doorways, leaf_cells
from rosbot_patrol.campaign.houses.files import House, changed_house
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.maps.raster import grown
from rosbot_patrol.simulation.scenario.furniture import MovedFurniture, model_of, move_furniture
from rosbot_patrol.simulation.scene.floor_plan import filled_cells
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.scene.ways import EYE_LEVEL

Mask = NDArray[np.bool_]

_MOST_MOVED = 4  # pieces
_LARGEST = 1.2  # width of what somebody moves [m]
_WHOLE = 0.8  # least footprint at the new place, as a share of the old one: no part of it in a wall
_FARTHEST = 1.2  # shift [m]
_DOORS = 0.35  # share of the doorways with a door, which stands open
_DETOUR = 1.2  # longest way to a room, as a share of the one before
_TRIES = 12  # shifts of one piece
_ATTEMPTS = 4  # of everything
_HOME = 0.6  # kept free around the robot's place [m]


def vary(house: House, floor: Floor, rng: np.random.Generator) -> tuple[House, Floor]:
    """Move up to four pieces of furniture, and hang open doors; the robot still gets into every room.

    Args:
        house: as the map shows it.
        floor: of it.
        rng: chance.

    Returns:
        The house, with the changes as entries of every scenario in it, and its floor as it is then.
    """
    ways = {room.id: len(floor.drive_to(room.id)) for room in floor.rooms}
    models: dict[str, list[Body]] = defaultdict(list)
    for body in house.bodies:
        if body.kind not in ("floor", "wall", "door"):
            models[model_of(body)].append(body)
    cells = {name: _footprint(bodies, floor) for name, bodies in models.items()}
    for _ in range(_ATTEMPTS):
        taken = np.logical_or.reduce([~floor.open, *cells.values()])
        doors = _doors(floor, taken, rng)
        moved = _moved(models, cells, taken, floor, rng)
        entries: dict[str, Any] = dict(house.files.scenario)
        if moved:
            entries["furniture"] = [{"name": each.name, "by": list(each.by)} for each in moved]
        if doors:
            entries["doors"] = [*entries.get("doors", ()), *doors]
        files = replace(house.files, scenario=entries)
        changed = changed_house(house, files)
        found = Floor(changed.bodies, changed.rooms)
        if all(not way or 0 < len(found.drive_to(room)) <= _DETOUR * way for room, way in ways.items()):
            return changed, found
    return house, floor


def _moved(
    models: dict[str, list[Body]], cells: dict[str, Mask], taken: Mask, floor: Floor, rng: np.random.Generator
) -> list[MovedFurniture]:
    """Pieces of furniture and their shifts, each to where nothing else stands.

    Args:
        models: links by the name of the model.
        cells: where each stands.
        taken: cells where anything stands; receives those of moved pieces.
        floor: of the house.
        rng: chance.
    """
    count = int(rng.integers(_MOST_MOVED + 1))
    moved: list[MovedFurniture] = []
    for name in rng.permutation(sorted(models)).tolist():
        if len(moved) == count:
            break
        own = cells[name]
        if not _is_moved_by_hand(models[name], own, floor) or any(
            (own & other).any() for each, other in cells.items() if each != name
        ):
            continue
        for _ in range(_TRIES):
            each = MovedFurniture(name=name, by=_shift(rng))
            there = _footprint(move_furniture(models[name], [each]), floor)
            if there.sum() >= _WHOLE * own.sum() and not (there & taken & ~own).any() and _is_off_home(there, floor):
                moved.append(each)
                taken |= there
                break
    return moved


def _is_moved_by_hand(bodies: Sequence[Body], cells: Mask, floor: Floor) -> bool:
    """Whether a model stands on the floor, and is neither wide nor as high as the eyes."""
    if not cells.any() or max(np.ptp(axis) for axis in np.nonzero(cells)) * CELL > _LARGEST:
        return False
    stands = any(filled_cells(bodies, floor.info, height).any() for height in ROBOT_HEIGHTS)
    return stands and not filled_cells(bodies, floor.info, EYE_LEVEL).any()


def _shift(rng: np.random.Generator) -> list[float]:
    away, bearing = float(rng.uniform(0.3, _FARTHEST)), float(rng.uniform(-math.pi, math.pi))
    turn = float(rng.uniform(-math.pi, math.pi))
    return [round(away * math.cos(bearing), 2), round(away * math.sin(bearing), 2), round(turn, 2)]


def _footprint(bodies: Sequence[Body], floor: Floor) -> Mask:
    """Cells in which bodies stand at any height of the robot or of a person."""
    heights = (*ROBOT_HEIGHTS, *PERSON_HEIGHTS)
    found: Mask = np.logical_or.reduce([filled_cells(bodies, floor.info, height) for height in heights])
    return found


def _is_off_home(cells: Mask, floor: Floor) -> bool:
    iy, ix = np.nonzero(cells)
    base = floor.rooms.base.pose
    x, y = floor.info.origin_x + (ix + 0.5) * CELL, floor.info.origin_y + (iy + 0.5) * CELL
    return bool(np.hypot(x - base.x, y - base.y).min() > _HOME)


def _doors(floor: Floor, taken: Mask, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Open doors in some doorways, each hinged and opened where nothing stands; `taken` receives their leaves."""
    doors = []
    for number, doorway in enumerate(find_doorways(floor)):
        drawn, sides = rng.random(), rng.permutation(4)
        if drawn >= _DOORS:
            continue
        for side in sides.tolist():
            door = doorway.door(f"hung_door_{number}", at_second=side >= 2, turns_left=side % 2 == 0)
            leaf = leaf_cells(door, floor)
            if leaf.any() and not (leaf & taken).any() and _is_off(door, floor.rooms.base.pose):
                doors.append(door)
                taken |= grown(leaf, 1)
                break
    return doors


def _is_off(door: dict[str, Any], base: Pose2D) -> bool:
    """Whether the leaf keeps off the robot's place."""
    x, y, _ = door["hinge"]
    return math.hypot(x - base.x, y - base.y) > float(door["width"]) + _HOME
