"""Furniture that a scenario moves."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import ParamError, WorldError
from rosbot_patrol.simulation.scenario.file import read_scenario
from rosbot_patrol.simulation.scenario.furniture import MovedFurniture, model_of, move_furniture
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Body


def body(name: str, x: float, y: float, z: float = 0.0) -> Body:
    return Body(name=name, pose=from_xyz_rpy((x, y, z)))


BODIES = (
    body("table/leg", 2.0, 1.0),
    body("table/top", 2.5, 1.0, 0.7),
    body("chair", 0.0, 0.0),
    body("set::lamp", 1, 1),
)


def test_a_model_moves_with_all_its_links_and_turns_about_the_first() -> None:
    leg, top, chair, _ = move_furniture(BODIES, [MovedFurniture(name="table", by=[1.0, -1.0, math.pi / 2.0])])
    assert leg.pose[:3, 3] == pytest.approx([3.0, 0.0, 0.0])
    assert top.pose[:3, 3] == pytest.approx([3.0, 0.5, 0.7])
    assert leg.pose[:3, :3] == pytest.approx(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert chair is BODIES[2]


def test_a_shift_needs_no_turn() -> None:
    chair = move_furniture(BODIES, [MovedFurniture(name="chair", by=[0.4, 0.2])])[2]
    assert chair.pose == pytest.approx(from_xyz_rpy((0.4, 0.2, 0.0)))
    assert [model_of(each) for each in BODIES] == ["table", "table", "chair", "set"]


def test_what_the_world_lacks_is_named_with_the_file() -> None:
    with pytest.raises(WorldError, match=r"night.yaml: furniture 'piano'.*no model of the world"):
        move_furniture(BODIES, [MovedFurniture(name="piano", by=[1.0, 0.0])], "night.yaml")


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ("{name: chair, by: [1.0]}", r"furniture\[0\]/by.*expected \[x, y\] or \[x, y, yaw\]"),
        ("{by: [1.0, 0.0]}", r"furniture\[0\]/name"),
        ("{name: chair, by: [1.0, 0.0], to: 3}", r"furniture\[0\]/to"),
    ],
)
def test_a_wrong_entry_is_refused(tmp_path: Path, entry: str, told: str) -> None:
    file = tmp_path / "scenario.yaml"
    file.write_text(f"furniture:\n  - {entry}\n")
    with pytest.raises(ParamError, match=told):
        read_scenario(file)
