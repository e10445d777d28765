"""Drawn houses: the same for a seed, rooms with doors between them, furniture that leaves ways, and a world of it."""

from __future__ import annotations

from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import ParamError
from rosbot_patrol.simulation.plans.catalogue import Catalogue, extent, load_catalogue, varied
from rosbot_patrol.simulation.plans.drawn_house import SEEDS, draw_house
from rosbot_patrol.simulation.plans.layout import ROOMS, Rect, draw_layout, plan_walls
from rosbot_patrol.simulation.plans.world_file import wall_boxes, write_world
from rosbot_patrol.simulation.sdf.world import load_world

CONFIG = Path(__file__).parents[4] / "config"
SEED = SEEDS["tests"][0]


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return load_catalogue(CONFIG)


@pytest.mark.parametrize("seed", range(SEED, SEED + 40))
def test_a_layout_has_rooms_side_by_side_and_doors_to_all_of_them(seed: int) -> None:
    layout = draw_layout(np.random.default_rng(seed))
    assert ROOMS[0] <= len(layout.rooms) - 1 <= ROOMS[1]
    assert not any(a.grown(-0.01).meets(b.grown(-0.01)) for a, b in combinations(layout.rooms, 2))
    assert sum(room.area for room in layout.rooms) == pytest.approx(layout.bounds.area, rel=0.01)
    reached, before = {0}, 0
    while len(reached) > before:
        before = len(reached)
        reached |= {k for o in layout.openings if reached & set(o.rooms) for k in o.rooms}
    assert reached == set(range(len(layout.rooms)))
    for opening in layout.openings:
        a, b = (layout.rooms[k].grown(0.05) for k in opening.rooms)
        x, y = opening.place
        assert a.x0 < x < a.x1
        assert a.y0 < y < a.y1
        assert b.x0 < x < b.x1
        assert b.y0 < y < b.y1
    doors = sum("sill" not in o for wall in plan_walls(layout) for o in wall["openings"])
    assert doors == len(layout.openings)


def test_a_seed_is_a_house_and_another_seed_another_one(catalogue: Catalogue) -> None:
    house = draw_house(SEED, catalogue)
    assert draw_house(SEED, catalogue) == house
    assert draw_house(SEED + 1, catalogue).plan["walls"] != house.plan["walls"]
    assert draw_house(SEED, catalogue, attempt=1).plan["walls"] != house.plan["walls"]
    assert house.names[0] == "hall"
    assert len(set(house.names)) == len(house.rooms)


def test_uses_of_seeds_do_not_overlap() -> None:
    ranges = sorted(SEEDS.values())
    assert all(high <= low for (_, high), (low, _) in pairwise(ranges))
    assert ranges[-1][1] <= 9_000_000


@pytest.mark.parametrize("seed", [SEED + 2, SEED + 3, SEED + 4])
def test_the_world_holds_what_the_plan_lists(catalogue: Catalogue, seed: int, tmp_path: Path) -> None:
    house = draw_house(seed, catalogue)
    boxes, pieces = write_world(house.plan, tmp_path / "house.world", head="A test.")
    assert boxes == sum(map(len, wall_boxes(house.plan).values()))
    world = load_world(tmp_path / "house.world")
    assert world.lost == ()
    names = {body.name for body in world.bodies}
    assert {item["name"] for item in house.plan["furniture"]} <= names
    assert len(house.plan["furniture"]) == pieces > 5
    there = {item["name"]: item["pose"] for item in house.plan_now["furniture"]}
    moved = [item["name"] for item in house.plan["furniture"] if there[item["name"]] != item["pose"]]
    assert len(moved) <= 4
    assert all(item["stands"] != "wall" for item in house.plan["furniture"] if item["name"] in moved)


def test_no_two_pieces_stand_in_one_place(catalogue: Catalogue) -> None:
    house = draw_house(SEED + 5, catalogue)
    rects = []
    for item in house.plan["furniture"]:
        x, y, yaw = item["pose"]
        low_x, high_x, low_y, high_y = extent(house.plan["pieces"][item["piece"]])
        c, s = np.cos(yaw), np.sin(yaw)
        corners = np.array([(x + c * p - s * q, y + s * p + c * q) for p in (low_x, high_x) for q in (low_y, high_y)])
        rects.append(Rect(*corners.min(axis=0), *corners.max(axis=0)).grown(-0.01))
    assert not any(a.meets(b) for a, b in combinations(rects, 2))
    assert not any(rect.meets(Rect(-0.3, -0.3, 0.3, 0.3)) for rect in rects)


def test_a_piece_varies_in_size_and_colour_and_stays_what_it_is(catalogue: Catalogue) -> None:
    piece = catalogue.pieces["weight_bench"]
    made = varied(piece, np.random.default_rng(3))
    assert [part["shape"] for part in made["parts"]] == [part["shape"] for part in piece["parts"]]
    factors = {round(a["size"][0] / b["size"][0], 2) for a, b in zip(made["parts"], piece["parts"], strict=True)}
    assert len(factors) == 1
    assert made != varied(piece, np.random.default_rng(4))


def test_what_is_wrong_with_a_catalogue_is_told(tmp_path: Path) -> None:
    for name in ("house_furniture.yaml", "flat_plan.yaml", "office_plan.yaml"):
        (tmp_path / name).write_text("pieces: {chair: {parts: []}}")
    text = "pieces: {{}}\nrooms: {{hall: [{}]}}\nhomes: [hall]\noffices: [hall]\n"
    for wish, problem in (
        ("[throne, 1, 1, wall]", "'throne' is no piece of the catalogue"),
        ("[chair, 1, 1, ceiling]", "'ceiling' is not one of wall, free, seat"),
        ("[chair, often, 1, wall]", r"expected \[piece, share, most, stands\]"),
    ):
        (tmp_path / "furniture_catalogue.yaml").write_text(text.format(wish))
        with pytest.raises(ParamError, match=problem):
            load_catalogue(tmp_path)
