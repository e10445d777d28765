from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.simulation.sdf.world import load_world
from training.pictures import empty_views

REPO = Path(__file__).parents[2]
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


def test_the_surest_person_of_each_picture_is_told() -> None:
    sheet = np.zeros((2, 288, 384, 3), np.uint8)
    seen = []

    def one_in_the_second(images: np.ndarray) -> list[np.ndarray]:
        seen.append(len(images))
        values = [
            np.full((len(images), 21, 9, 12), -9.0, np.float32),
            np.full((len(images), 21, 18, 24), -9.0, np.float32),
        ]
        values[0][-1, 4:6, 3, 3] = 9.0  # the first anchor's objectness, and a person's
        values[0][-1, 11, 6, 6], values[0][-1, 13, 6, 6] = 9.0, 9.0  # the second's, and a hydrant's
        return values

    assert empty_views.surest(sheet, CFG, one_in_the_second) == pytest.approx([0.0, 1.0], abs=0.01)
    assert seen == [2]
    assert empty_views.surest(sheet, CFG, empty_views.load_forward(CFG, WEIGHTS, threads=1)).max() < 0.3


def test_a_network_of_two_says_how_often_it_is_wrong(capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch):
    files = ["--weights", str(WEIGHTS), str(WEIGHTS)]
    more = ["--worlds", str(REPO / "worlds"), "--views", "2", "--kinds", "plant", "--processes", "1"]
    monkeypatch.setattr("sys.argv", ["empty_views", "--cfg", str(CFG), *files, *more])
    empty_views.main()
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2
    assert lines[0] == lines[1]
    assert " views of which the edge cuts a plant, " in lines[0]
