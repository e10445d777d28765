from __future__ import annotations

import cv2
import numpy as np
import pytest

from rosbot_patrol.detection.darknet.letterbox import Letterbox
from rosbot_patrol.simulation.actors.looks import Look
from rosbot_patrol.simulation.actors.people import person_body, person_pose_parts
from rosbot_patrol.simulation.actors.pets import draw_pet, pet_body, pet_pose_parts
from rosbot_patrol.simulation.render.egl import EglRenderer
from rosbot_patrol.simulation.render.lights import Light
from training.learning.mixing import FURNITURE
from training.pictures import overlay, patterns, render, scenes, visibility
from training.pictures.furniture import box, build, placed
from training.pictures.labels import COLUMNS, column
from training.pictures.scenes import Actor, Scene


@pytest.fixture(scope="module")
def studio() -> render.Studio:
    made = render.Studio(None)
    made.furnish(np.random.default_rng(0))
    return made


def look_at(studio: render.Studio, monkeypatch: pytest.MonkeyPatch, distance: float, *others) -> np.ndarray:
    """The label of a person that far before the camera, with other things in the way."""
    look = Look()
    person = Actor(person_body("actor0", look), placed(distance, 0), person_pose_parts(look), [])
    monkeypatch.setattr(render.scenes, "draw_actors", lambda *a, **k: [person])
    scene = Scene(list(others), Light(), (-9, 9, -9, 9))
    studio.renderer.clear()
    for body in scene.bodies:
        studio.renderer.add(body)
    _, labels, _ = studio._view(scene, (0.0, 0.0, 0.0), np.random.default_rng(0), test=False)
    return np.array([[0, *label] for label in labels]).reshape(-1, len(COLUMNS))


def test_who_stands_free_is_wholly_seen(studio: render.Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = look_at(studio, monkeypatch, 5.0)
    assert column(rows, "seen_of_whole")[0] > 0.85
    assert column(rows, "seen_of_part")[0] > 0.85
    height = column(rows, "y1")[0] - column(rows, "y0")[0]
    assert height * 480 == pytest.approx(554 * 1.75 / 5.0, rel=0.08)
    assert (column(rows, "x0")[0] + column(rows, "x1")[0]) / 2 == pytest.approx(0.5, abs=0.04)


def test_a_near_person_is_seen_in_part_only_for_the_picture_s_edge(
    studio: render.Studio, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = look_at(studio, monkeypatch, 1.2)
    assert 0.1 < column(rows, "seen_of_whole")[0] < 0.6
    assert column(rows, "seen_of_part")[0] > 0.85


def test_who_is_half_hidden_is_said_to_be(studio: render.Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    chest = build("chest", [(box(0.3, 2.0, 0.8), (0, 0, 0.4), (1, 1, 1), "")], placed(4.0, 0))
    rows = look_at(studio, monkeypatch, 5.0, chest)
    assert 0.3 < column(rows, "seen_of_whole")[0] < 0.65


def test_who_is_behind_a_wall_is_not_labelled(studio: render.Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    wall = build("wall", [(box(0.2, 9.0, 9.0), (0, 0, 1), (1, 1, 1), "")], placed(4.0, 0))
    assert len(look_at(studio, monkeypatch, 5.0, wall)) == 0


def test_a_pet_is_seen_and_is_nothing_to_be_found(studio: render.Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    look = draw_pet("dog", rng)
    dog = Actor(pet_body("pet0", look), placed(2.0, 0), pet_pose_parts(look), [])
    seen = {}
    for there in (True, False):
        monkeypatch.setattr(render.scenes, "draw_actors", lambda *a, there=there, **k: [dog] if there else [])
        studio.renderer.clear()
        scene = Scene([], Light(), (-9, 9, -9, 9))
        seen[there] = studio._view(scene, (0.0, 0.0, 0.0), np.random.default_rng(0), test=False, pets=1.0)
    assert seen[True][1] == []
    assert (seen[True][0] != seen[False][0]).any()


def test_of_a_case_only_people_and_hydrants_are_labelled(studio: render.Studio) -> None:
    _, rows, masks = studio.shard([9, 0], 40, test=False, cases=1.0)
    assert set(column(rows, "kind")) == {0, 1}
    labelled = {(row[0], column(row[None], "mask")[0]) for row in rows}
    actors = {(n, value) for n, mask in enumerate(masks) for value in np.unique(mask) if 0 < value < FURNITURE}
    assert labelled <= actors
    assert len(actors - labelled) > 5, "things and pets that were put there are in the mask, with no label"


def test_a_shard_repeats_with_its_seed(studio: render.Studio) -> None:
    pictures, rows, masks = studio.shard([7, 0], 3, test=False)
    again, rows_again, masks_again = studio.shard([7, 0], 3, test=False)
    assert pictures.shape == (3, 288, 384, 3)
    assert np.array_equal(pictures, again)
    assert np.array_equal(rows, rows_again)
    assert np.array_equal(masks, masks_again)


def test_a_mask_shows_where_each_label_is(studio: render.Studio) -> None:
    _, rows, masks = studio.shard([8, 0], 12, test=False)
    assert len(rows) > 3
    for row in rows:
        y, x = np.nonzero(masks[int(row[0])] == column(row[None], "mask")[0])
        seen = [x.min() / 384, y.min() / 288, (x.max() + 1) / 384, (y.max() + 1) / 288]
        assert seen == pytest.approx(row[2:6], abs=0.0065)


def test_reduction_is_darknet_s_letterbox() -> None:
    picture = np.random.default_rng(0).integers(0, 255, (480, 640, 3), dtype=np.uint8)
    picture = cv2.GaussianBlur(picture, (0, 0), 2)
    exact = Letterbox(640, 480, 384, 288).draw(picture).transpose(1, 2, 0) * 255
    assert np.abs(render.reduce(picture) - exact)[:-1].max() < 4.0  # darknet's last row comes out black


def test_degrading_keeps_size_and_kind() -> None:
    rng = np.random.default_rng(0)
    for _ in range(10):
        out = render.degrade(np.full((480, 640, 3), 128, np.uint8), rng)
        assert out.shape == (288, 384, 3)
        assert out.dtype == np.uint8
    assert render._noise(rng, 5.0).std() == pytest.approx(5.0, rel=0.1)


def test_contrast_is_the_step_at_the_outline() -> None:
    picture = np.full((288, 384, 3), 60, np.uint8)
    mask = np.zeros((480, 640), bool)
    mask[100:300, 200:400] = True
    picture[60:180, 120:240] = 100
    assert visibility.contrast(picture, mask) == pytest.approx(40, abs=4)
    assert visibility.contrast(np.full((288, 384, 3), 60, np.uint8), mask) == pytest.approx(0, abs=0.1)


def test_training_and_tests_have_other_textures() -> None:
    drawn = patterns.draw_textures(np.random.default_rng(1))
    again = patterns.draw_textures(np.random.default_rng(1))
    other = patterns.draw_textures(np.random.default_rng(2))
    assert list(drawn) == list(other)
    assert all((drawn[k].pixels == again[k].pixels).all() for k in drawn)
    assert all((drawn[k].pixels != other[k].pixels).any() for k in drawn)


def test_patterns_are_laid_only_beside_people() -> None:
    picture = np.random.default_rng(0).integers(0, 255, (288, 384, 3), dtype=np.uint8)
    box = np.array([[100.0, 40.0, 180.0, 239.0]])
    changed = np.zeros((288, 384), bool)
    for seed in range(30):
        out = overlay.lay_patterns(picture, box, np.random.default_rng(seed))
        changed |= (out != picture).any(axis=2)
    assert not changed[40:239, 100:180].any()
    assert changed.mean() > 0.2


def test_labels_tell_bodies_apart() -> None:
    renderer = EglRenderer()
    renderer.add(build("a", [(box(0.2, 0.2, 0.2), (0, 0, 0), (1, 0, 0), "")], placed(2, 0.5, 0.2)), label=3)
    renderer.add(build("b", [(box(0.2, 0.2, 0.2), (0, 0, 0), (0, 1, 0), "")], placed(2, -0.5, 0.2)), label=200)
    optical, intrinsics = render.eye((0.0, 0.0, 0.0), np.random.default_rng(0))
    colour, _ = renderer.render(optical, intrinsics)
    assert set(np.unique(renderer.labels())) == {0, 3, 200}
    both = renderer.render_labelled(optical, intrinsics)
    assert np.array_equal(both, np.dstack([colour, renderer.labels()]))
    renderer.close()


@pytest.mark.parametrize("place", [(0, 0, 40, 90), (600, 300, 40, 180), (200, 100, 60, 200), (0, 0, 640, 480)])
def test_contrast_needs_only_what_lies_around_the_figure(place, monkeypatch: pytest.MonkeyPatch) -> None:
    x, y, wide, high = place
    picture = np.random.default_rng(2).integers(0, 255, (288, 384, 3), dtype=np.uint8)
    mask = np.zeros((480, 640), bool)
    mask[y : y + high, x : x + wide] = True
    there = visibility.contrast(picture, mask)
    monkeypatch.setattr(visibility, "_around", lambda *_: (slice(None), slice(None)))
    assert there == pytest.approx(visibility.contrast(picture, mask), abs=1e-4)


def test_nobody_stands_out_of_nothing() -> None:
    assert visibility.contrast(np.zeros((288, 384, 3), np.uint8), np.zeros((480, 640), bool)) == 0.0


@pytest.mark.parametrize(("share", "fewest", "most"), [(0.0, 0, 0), (0.5, 5, 15), (1.0, 20, 20)])
def test_a_share_of_the_people_has_detailed_figures(share: float, fewest: int, most: int) -> None:
    drawn = [
        scenes.draw_person(np.random.default_rng(seed), "p", placed(0, 0), False, detailed=share) for seed in range(20)
    ]
    detailed = sum(any(v.shape.detail is not None for v in actor.body.visuals) for actor in drawn)
    assert fewest <= detailed <= most
