from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.detection.training import empty_views
from rosbot_patrol.simulation.world import load_world

REPO = Path(__file__).parents[4]
CFG, WEIGHTS = REPO / "models/house.cfg", REPO / "models/house.weights"


@pytest.mark.parametrize("kind", list(empty_views.KINDS))
def test_views_are_of_the_house_and_the_same_again(kind: str) -> None:
    world = load_world(REPO / "worlds/office.world")
    one, again = (list(empty_views.views(world, kind, 4, 5)) for _ in range(2))
    assert 2 <= len(one) <= 4
    assert all(picture.shape == (288, 384, 3) and picture.std() > 5 for picture in one)
    assert (np.array(one) == np.array(again)).all()


def test_a_world_without_plants_has_no_view_of_one() -> None:
    world = load_world(REPO / "worlds/flat.world")
    assert list(empty_views.views(world, "plant", 3, 5)) == []


def test_the_surest_person_of_each_network_is_told() -> None:
    sheet = np.zeros((2, 288, 384, 3), np.uint8)
    forward = empty_views.load_forward(CFG, WEIGHTS, threads=1)

    def sure(_: np.ndarray) -> list[np.ndarray]:
        values = [np.full((1, 21, 9, 12), -9.0, np.float32), np.full((1, 21, 18, 24), -9.0, np.float32)]
        values[0][0, 4:6, 3, 3] = 9.0  # the first anchor's objectness, and a person's
        return values

    rows = empty_views.surest(iter(sheet), CFG, [forward, sure])
    assert rows.shape == (2, 2)
    assert rows[:, 0].max() < 0.3
    assert rows[:, 1].min() > 0.99


def test_a_network_of_two_says_how_often_it_is_wrong(capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch):
    files = ["--weights", str(WEIGHTS), str(WEIGHTS)]
    more = ["--worlds", str(REPO / "worlds"), "--views", "2", "--kinds", "plant", "--processes", "1"]
    monkeypatch.setattr("sys.argv", ["empty_views", "--cfg", str(CFG), *files, *more])
    empty_views.main()
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2
    assert lines[0] == lines[1]
    assert " views of which the edge cuts a plant, " in lines[0]
