"""Pictures made of others by their masks: who is seen where, and by how much, is told as it then is."""

from __future__ import annotations

import numpy as np
import pytest
from oblongs import BLUE, RED, make_view

from training.learning import mixing
from training.learning.dataset import asked
from training.learning.mixing import FURNITURE, View
from training.pictures.labels import HEIGHT, WIDTH, column


def boxes(view: View) -> np.ndarray:
    """x0, y0, x1, y1 [px] of each row."""
    return view.rows[:, mixing._BOX] * [WIDTH, HEIGHT, WIDTH, HEIGHT]


def check_rows(view: View) -> None:
    """Each row's box holds just the pixels of its value in the mask, and no two rows have one value."""
    values = column(view.rows, "mask").astype(int)
    assert len(set(values)) == len(values)
    for value, box in zip(values, boxes(view), strict=True):
        y, x = np.nonzero(view.mask == value)
        assert box == pytest.approx([x.min(), y.min(), x.max() + 1, y.max() + 1], abs=0.01)


def seeds(count: int = 40) -> list[np.random.Generator]:
    return [np.random.default_rng(seed) for seed in range(count)]


def test_who_comes_from_another_picture_has_his_box_there_and_his_pixels() -> None:
    view = make_view(colour=BLUE)
    donor = make_view((0, 1, (40, 60, 90, 220)), (1, 2, (200, 150, 240, 210)), colour=RED)
    came = 0
    for rng in seeds():
        mixed = mixing.mix(view, donor, rng)
        check_rows(mixed)
        came += len(mixed.rows)
        outside = mixed.picture[mixed.mask == 0]
        assert (outside[:, 0] < 200).all()  # nothing of the donor's room
        assert set(column(mixed.rows, "kind")) <= {0.0, 1.0}
    assert came > 40
    assert (view.picture == BLUE).all()


def test_who_is_covered_is_told_as_less_seen_and_who_is_gone_not_at_all() -> None:
    view = make_view((0, 1, (100, 40, 160, 200)), (0, 2, (165, 150, 168, 155)))
    donor = make_view((9, FURNITURE + 3, (60, 120, 260, 240)))  # no larger than a piece of furniture may be
    shares = []
    for rng in seeds(80):
        mixed = mixing.mix(view, donor, rng, furniture=1.0)
        check_rows(mixed)
        first = mixed.rows[column(mixed.rows, "mask") == 1][0]
        still = (mixed.mask == 1).sum() / (60 * 160)
        assert column(first[None], "seen_of_part")[0] == pytest.approx(still, abs=0.01)
        assert column(first[None], "pixels")[0] == pytest.approx(4 * 60 * 160 * still, rel=0.01)
        shares.append(still)
        assert 2 in column(mixed.rows, "mask") or (mixed.mask[150:155, 165:168] != 2).any()
    assert min(shares) == pytest.approx(0.5, abs=0.02)
    assert max(shares) == 1.0


def test_a_pet_covers_and_is_no_row() -> None:
    dog = make_view((9, 4, (100, 100, 220, 239)))  # an actor's number, and no row
    for rng in seeds(10):
        mixed = mixing.mix(make_view((0, 1, (100, 40, 160, 200))), dog, rng)
        check_rows(mixed)
        assert len(mixed.rows) <= 1


def test_numbers_of_both_pictures_are_kept_apart() -> None:
    both = make_view((0, 1, (20, 40, 60, 200)), (0, 2, (220, 40, 260, 200)))
    most = 0
    for rng in seeds():
        mixed = mixing.mix(both, both, rng)
        check_rows(mixed)
        most = max(most, len(mixed.rows))
    assert most == 4


def test_zooming_moves_boxes_with_their_pixels() -> None:
    view = make_view((0, 1, (100, 60, 160, 200)), (1, 2, (0, 180, 20, 239)))
    widths = []
    for rng in seeds():
        nearer = mixing.zoom(view, rng)
        check_rows(nearer)
        assert nearer.picture.shape == view.picture.shape
        assert asked(nearer.rows[:1]).all()
        widths.append(float(np.diff(boxes(nearer)[0][[0, 2]])[0]))
    assert 60 <= min(widths) < 66
    assert 70 < max(widths) <= 77


def test_new_clothes_and_walls_leave_outlines_and_rows_alone() -> None:
    view = make_view((0, 1, (100, 60, 160, 200)), (1, 2, (200, 100, 240, 239)))
    dressed = papered = False
    for rng in seeds():
        other = mixing.disguise(view, rng, share=0.9)
        changed = (other.picture != view.picture).any(axis=2)
        assert not changed[view.mask != 1].any()
        dressed |= bool(changed.any())
        other = mixing.repaper(view, rng)
        changed = (other.picture != view.picture).any(axis=2)
        assert not changed[view.mask > 0].any()
        papered |= bool(changed[60:200, 90:100].any())
        assert other.rows is view.rows
    assert dressed
    assert papered


def test_mirrored_twice_is_as_before() -> None:
    view = make_view((0, 1, (100, 60, 160, 200)))
    check_rows(view.mirrored())
    again = view.mirrored().mirrored()
    assert (again.picture == view.picture).all()
    assert again.rows == pytest.approx(view.rows)
