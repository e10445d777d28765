"""Mixing of whole batches says and shows what `mixing.py` does; needs PyTorch (see test_network.py)."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from oblongs import BLUE, RED, make_view

torch = pytest.importorskip("torch", reason="PyTorch is installed only in the environment of scripts/train_network")

from training.learning import device_mixing, mixing  # noqa: E402
from training.learning.dataset import asked, sureness  # noqa: E402
from training.learning.device_mixing import Mixer, draw_chance, mix_batch, truth_of  # noqa: E402
from training.learning.mixing import View  # noqa: E402
from training.pictures.labels import COLUMNS, HEIGHT, WIDTH  # noqa: E402
from training.pictures.view_pool import AT, KEPT, MOST_ROWS, ViewPool, Views  # noqa: E402

CPU = torch.device("cpu")
BANK = torch.randint(0, 256, (5, 64, 64, 3), dtype=torch.uint8, generator=torch.Generator().manual_seed(1))
PERSON, HYDRANT, SOFA = (0, 1, (40, 60, 90, 220)), (1, 2, (200, 150, 240, 210)), (9, 120, (100, 100, 180, 230))


def pool_of(*views: View) -> ViewPool:
    pool = ViewPool(len(views), CPU)
    pool.add(Views.of(np.array([v.picture for v in views]), [v.mask for v in views], [v.rows for v in views]))
    return pool


def still(count: int, **changed: object) -> dict[str, torch.Tensor]:
    """Chance that changes nothing, but for what is given."""
    chance = draw_chance(count, len(BANK), CPU, torch.Generator().manual_seed(0))
    off = {"quad_on": False, "mixed": False, "dye": -1.0, "zoomed": False, "mirrored": False, "gains": 1.0}
    off |= {"offsets": 0.0, "order": torch.arange(3), "donor_mirrored": False, "donor_gain": 1.0}
    off |= {"donor_soft": False, "donor_shift": 0, "donor_share": 0.0}
    for name, value in (off | changed).items():
        chance[name] = torch.as_tensor(value, dtype=chance[name].dtype).expand_as(chance[name]).clone()
    return chance


def run(view: View, donor: View, **changed: object) -> tuple[np.ndarray, np.ndarray]:
    """The picture, uint8, and the rows that exist, of one view mixed with a donor."""
    pool = pool_of(view, donor)
    sides = [(pool.pictures[at], pool.masks[at], pool.rows[at], pool.counts[at]) for at in ([0], [1])]
    images, rows = mix_batch(*sides, still(1, **changed), BANK)
    picture = (images[0].permute(1, 2, 0) * 255).round().byte().numpy()
    return picture, rows[0][rows[0, :, AT["mask"]] > 0].numpy()


def boxes(rows: np.ndarray) -> np.ndarray:
    return rows[:, 1:5] * [WIDTH, HEIGHT, WIDTH, HEIGHT]


def test_without_chance_a_view_stays_as_it_is() -> None:
    view = make_view(PERSON, HYDRANT, SOFA, colour=BLUE)
    picture, rows = run(view, make_view(colour=RED))
    assert np.array_equal(picture, view.picture)
    assert rows == pytest.approx(view.rows[:, [COLUMNS.index(name) for name in KEPT]])


def test_who_comes_from_a_donor_stands_before_what_was_there() -> None:
    view, donor = make_view((0, 1, (60, 100, 100, 200)), colour=BLUE), make_view(PERSON, colour=RED)
    picture, rows = run(view, donor, mixed=True)
    there = donor.mask > 0
    assert np.array_equal(picture[there], donor.picture[there])
    assert np.array_equal(picture[~there], view.picture[~there])
    assert sorted(map(tuple, boxes(rows).round())) == [(40, 60, 90, 220), (90, 100, 100, 200)]
    hidden = rows[rows[:, AT["mask"]] == 1][0]
    assert hidden[AT["seen_of_part"]] == pytest.approx(0.25)
    assert hidden[AT["seen_of_whole"]] == pytest.approx(0.25 * 0.8)
    assert hidden[AT["pixels"]] == pytest.approx(4000)
    assert rows[rows[:, AT["mask"]] != 1][0][AT["pixels"]] == pytest.approx(4 * 50 * 160)


def test_who_is_covered_wholly_is_no_longer_told() -> None:
    view, donor = make_view((0, 1, (50, 100, 80, 200)), colour=BLUE), make_view(PERSON, colour=RED)
    assert len(run(view, donor, mixed=True)[1]) == 1


@pytest.mark.parametrize(
    ("shift", "mirrored", "wanted"), [(100, False, (140, 190)), (0, True, (294, 344)), (-60, False, (0, 30))]
)
def test_a_donor_is_moved_and_mirrored(shift: int, mirrored: bool, wanted: tuple[int, int]) -> None:
    donor = make_view(PERSON, colour=RED)
    picture, rows = run(make_view(colour=BLUE), donor, mixed=True, donor_shift=shift, donor_mirrored=mirrored)
    assert boxes(rows)[0] == pytest.approx([wanted[0], 60, wanted[1], 220])
    assert rows[0, AT["pixels"]] == pytest.approx(4 * (wanted[1] - wanted[0]) * 160)
    assert rows[0, AT["seen_of_whole"]] == pytest.approx(0.8 * (wanted[1] - wanted[0]) / 50)
    assert rows[0, AT["seen_of_part"]] == 1.0
    columns = np.flatnonzero((picture != BLUE).any(axis=(0, 2)))
    assert (columns[0], columns[-1] + 1) == wanted


def test_a_mirrored_picture_has_mirrored_boxes() -> None:
    view = make_view(PERSON, HYDRANT, colour=BLUE)
    picture, rows = run(view, view, mirrored=True)
    assert np.array_equal(picture, view.picture[:, ::-1])
    assert boxes(rows)[0] == pytest.approx([294, 60, 344, 220])


def test_enlarging_is_as_opencv_does_it() -> None:
    view = make_view(PERSON, HYDRANT, colour=BLUE)
    picture, rows = run(view, view, zoomed=True, zoom=torch.tensor([1.2, 1.1]), zoom_middle=100.0)
    matrix = np.float64([[1.2, 0, 100 * (1 - 1.2)], [0, 1.1, (HEIGHT - 1) / 2 * (1 - 1.1)]])
    wanted = cv2.warpAffine(view.picture, matrix, (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR)
    assert np.abs(picture.astype(int) - wanted).mean() < 0.5
    mask = cv2.warpAffine(view.mask, matrix, (WIDTH, HEIGHT), flags=cv2.INTER_NEAREST)
    for row, value in zip(rows, (1, 2), strict=True):
        y, x = np.nonzero(mask == value)
        assert boxes(row[None])[0] == pytest.approx([x.min(), y.min(), x.max() + 1, y.max() + 1], abs=1.01)
        assert row[AT["seen_of_whole"]] == pytest.approx(0.8, abs=0.03)
        assert row[AT["pixels"]] == pytest.approx(view.rows[value - 1, COLUMNS.index("pixels")] * 1.32, rel=0.03)


def test_patterns_are_laid_up_to_the_outline_of_who_is_there() -> None:
    view = make_view(PERSON, SOFA, colour=(200, 200, 200))
    picture, rows = run(view, view, quad_on=True)
    actor = view.mask == 1
    assert np.array_equal(picture[actor], view.picture[actor])
    assert (picture[~actor] != view.picture[~actor]).any()
    assert boxes(rows)[0] == pytest.approx(PERSON[2])


@pytest.mark.parametrize("kind", [0.1, 0.5, 0.9])
def test_only_people_are_dressed_anew(kind: float) -> None:
    view = make_view(PERSON, HYDRANT, colour=BLUE)
    picture, _ = run(view, view, dye=0.5, dye_kind=kind, dye_half=3)
    changed = (picture != view.picture).any(axis=2)
    assert changed[view.mask == 1].mean() > 0.9
    assert not changed[view.mask != 1].any()


def test_half_of_somebody_is_dressed_anew_up_to_an_edge() -> None:
    view = make_view(PERSON, colour=BLUE)
    picture, _ = run(view, view, dye=0.5, dye_kind=0.1, dye_half=1, dye_edge=0.5)
    lines = np.flatnonzero((picture != view.picture).any(axis=(1, 2)))
    assert (lines[0], lines[-1] + 1) == (140, 220)


def test_who_is_asked_for_and_how_surely_is_as_for_single_pictures() -> None:
    rng = np.random.default_rng(4)
    rows = np.zeros((MOST_ROWS * 200, len(COLUMNS)), np.float32)
    ranges = {"y1": 0.15, "distance": 8, "seen_of_part": 1, "pixels": 900, "light": 20, "contrast": 15, "x1": 1}
    ranges["seen_of_whole"] = 1
    for name, most in ranges.items():
        rows[:, COLUMNS.index(name)] = rng.uniform(0, most, len(rows))
    rows[:, COLUMNS.index("mask")] = 1
    rows[:, COLUMNS.index("kind")] = rng.integers(2, size=len(rows))
    kept = torch.from_numpy(rows[:, [COLUMNS.index(name) for name in KEPT]]).view(200, MOST_ROWS, -1)
    truth = truth_of(kept)
    assert np.array_equal(truth.asked.numpy(), asked(rows))
    assert 0 < truth.asked.sum() < len(rows)
    assert truth.sure.numpy() == pytest.approx(sureness(rows), abs=1e-5)
    kept[..., AT["mask"]] = 0
    assert not truth_of(kept).asked.any()
    assert not truth_of(kept).exists.any()


def test_homographies_take_corners_to_the_corners_of_a_pattern() -> None:
    corners = torch.tensor([[10.0, 20.0], [200.0, 40.0], [180.0, 250.0], [30.0, 230.0]])
    back = device_mixing._inverse(device_mixing._square_to(corners))
    places = torch.cat([corners, torch.ones(4, 1)], 1) @ back.T
    assert torch.allclose(places[:, :2] / places[:, 2:], torch.tensor([[0.0, 0], [1, 0], [1, 1], [0, 1]]), atol=1e-4)


def test_batches_are_about_as_full_as_single_pictures_mixed() -> None:
    views = [
        make_view(PERSON, HYDRANT, SOFA),
        make_view(colour=BLUE),
        make_view((0, 1, (150, 30, 220, 250)), colour=RED),
    ]
    pool = pool_of(*views)
    mixer = Mixer(pool, 3)
    truth = mixer.batch(torch.arange(60) % 3)[1]
    rng, rows = np.random.default_rng(5), 0
    for k in range(60):
        view = views[k % 3]
        mixed = mixing.mix(view, views[int(rng.integers(3))], rng) if rng.random() < 0.5 else view
        rows += len(mixed.rows)
    assert int(truth.exists.sum()) == pytest.approx(rows, rel=0.25)


def test_a_seed_gives_the_same_batch_again() -> None:
    pool = pool_of(make_view(PERSON, colour=BLUE), make_view(HYDRANT, SOFA, colour=RED))
    one, other = (Mixer(pool, 7).batch(torch.tensor([0, 1, 1])) for _ in range(2))
    assert torch.equal(one[0], other[0])
    assert torch.equal(one[1].boxes, other[1].boxes)
    assert one[0].shape == (3, 3, HEIGHT, WIDTH)
    assert one[0].is_contiguous(memory_format=torch.channels_last)


def test_a_full_pool_lets_its_oldest_go_and_leaves_crowds_out() -> None:
    pool = ViewPool(3, CPU)
    crowd = make_view(*[(0, k + 1, (10 * k, 50, 10 * k + 8, 90)) for k in range(MOST_ROWS + 1)])
    for view in (make_view(colour=BLUE), make_view(colour=RED), crowd, make_view(PERSON), make_view(HYDRANT)):
        pool.add(Views.of(view.picture[None], [view.mask], [view.rows]))
    assert (pool.size, pool.added) == (3, 4)
    assert tuple(pool.pictures[0, 0, 0]) != BLUE
    assert tuple(pool.pictures[1, 0, 0]) == RED
    assert int(pool.counts[2, 1]) == 50 * 160
    assert int(pool.counts[0, 2]) == 40 * 60
