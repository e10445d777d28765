"""These need PyTorch, which only training needs: run them by `.ws/train/bin/python -m pytest` where it is installed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="PyTorch is installed only in the environment of scripts/train_network")

from rosbot_patrol.detection.darknet import decode  # noqa: E402
from rosbot_patrol.detection.darknet.cfg import read_cfg  # noqa: E402
from rosbot_patrol.detection.darknet.layers import Yolo  # noqa: E402
from training.judging.scoring import SUPPRESSION  # noqa: E402
from training.learning.loss import CUT, Truth, yolo_loss  # noqa: E402
from training.pictures.apart import APART, MOST, cut_apart  # noqa: E402

Corners = tuple[float, float, float, float]


def _cut(*corners: Corners, pictures: list[int] | None = None, hidden: int = -1) -> np.ndarray:
    """Corners x0, y0, x1, y1 of boxes after the cut."""
    at = torch.tensor(corners)
    boxes = torch.cat([(at[:, :2] + at[:, 2:]) / 2, at[:, 2:] - at[:, :2]], dim=1)
    asked = torch.arange(len(at)) != hidden
    batch = torch.tensor(pictures) if pictures else torch.zeros(len(at), dtype=torch.long)
    cut, _ = cut_apart(boxes, batch, asked)
    return torch.cat([cut[:, :2] - cut[:, 2:] / 2, cut[:, :2] + cut[:, 2:] / 2], dim=1).numpy()


def _iou(a: np.ndarray, b: np.ndarray) -> float:
    shared = np.clip(np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]), 0, None).prod()
    return float(shared / ((a[2:] - a[:2]).prod() + (b[2:] - b[:2]).prod() - shared))


LEFT, RIGHT = (100.0, 50.0, 140.0, 170.0), (110.0, 50.0, 150.0, 170.0)


def test_two_side_by_side_end_earlier_on_the_others_side_and_both_are_left() -> None:
    assert _iou(np.array(LEFT), np.array(RIGHT)) == pytest.approx(0.6)
    left, right = _cut(LEFT, RIGHT)
    assert _iou(left, right) <= APART < SUPPRESSION
    assert left[[0, 1, 3]] == pytest.approx(LEFT[:2] + LEFT[3:])
    assert right[1:] == pytest.approx(RIGHT[1:])
    assert LEFT[2] - left[2] == pytest.approx(right[0] - RIGHT[0], abs=1e-3)
    assert min(_iou(left, np.array(LEFT)), _iou(right, np.array(RIGHT))) >= 1 - MOST
    middle = np.array([left, right]).reshape(2, 2, 2).mean(axis=1) / 400
    sizes = np.array([left[2:] - left[:2], right[2:] - right[:2]]) / 400
    exact = decode.Candidates(np.hstack([middle, sizes]), np.array([1.0, 0.9]), np.ones((2, 1)))
    assert (decode.suppress_by_objectness(exact, SUPPRESSION).probabilities > 0).sum() == 2


def test_one_above_the_other_is_cut_upwards() -> None:
    upper, lower = _cut((50, 0, 150, 100), (50, 30, 150, 130))
    assert upper[[0, 1, 2]] == pytest.approx([50, 0, 150])
    assert lower[[0, 2, 3]] == pytest.approx([50, 150, 130])
    assert upper[3] < 100
    assert lower[1] > 30


def test_the_order_of_the_boxes_does_not_matter() -> None:
    wide = (90.0, 60.0, 150.0, 180.0)
    assert _cut(RIGHT, LEFT)[::-1] == pytest.approx(_cut(LEFT, RIGHT))
    assert _cut(wide, LEFT)[::-1] == pytest.approx(_cut(LEFT, wide))


def test_two_of_the_same_centre_part_too() -> None:
    high, wide = (100.0, 100.0, 140.0, 160.0), (90.0, 115.0, 150.0, 145.0)
    a, b = _cut(high, wide)
    assert _iou(a, b) <= APART < _iou(np.array(high), np.array(wide))


@pytest.mark.parametrize(
    ("boxes", "more"),
    [
        ((LEFT, (125.0, 50.0, 165.0, 170.0)), {}),  # an overlap of 0.23 is none to speak of
        ((LEFT, (101.0, 50.0, 141.0, 170.0)), {}),  # one of 0.95 is beyond help
        ((LEFT, RIGHT), {"pictures": [0, 1]}),
        ((LEFT, RIGHT), {"hidden": 1}),
        ((LEFT,), {}),
    ],
)
def test_what_stays_as_it_is(boxes: tuple, more: dict) -> None:
    assert _cut(*boxes, **more) == pytest.approx(np.array(boxes))


def test_none_at_all_are_fine() -> None:
    none = torch.zeros(0, 4)
    boxes, other = cut_apart(none, torch.zeros(0, dtype=torch.long), torch.zeros(0, dtype=torch.bool))
    assert boxes.shape == (0, 4)
    assert other.shape == (0,)


def _predicting(heads: list[Yolo], boxes: torch.Tensor, cells_of: torch.Tensor, width: int) -> list[torch.Tensor]:
    """Values by which all anchors of the cell of each of `cells_of` say the box of `boxes` in the same row."""
    values = []
    for head in heads:
        _, rows, columns = head.in_shape
        value = torch.zeros(1, len(head.anchors), 5 + head.classes, rows, columns)
        cells = (cells_of[:, :2] / width * columns).long()
        for box, (column, row) in zip(boxes, cells, strict=True):
            value[0, :, :2, row, column] = torch.logit(box[:2] / width * columns - torch.stack([column, row]))
            value[0, :, 2:4, row, column] = torch.log(box[2:] / torch.tensor(head.anchors))
        values.append(value.flatten(1, 2))
    return values


def test_the_loss_learns_boxes_cut_and_heeds_them_more() -> None:
    spec = read_cfg(str(Path(__file__).parents[2] / "models" / "house.cfg"))
    kinds, asked = torch.zeros(2, dtype=torch.long), torch.ones(2, dtype=torch.bool)
    whole = torch.tensor([[120.0, 110, 40, 120], [130.0, 110, 40, 120]])
    cut, other = cut_apart(whole, kinds, asked)
    assert other.tolist() == [1, 0]
    again, none = cut_apart(cut, kinds, asked)
    assert torch.equal(again, cut)
    assert none.tolist() == [0, 1]

    def loss(learnt: torch.Tensor, predicted: torch.Tensor) -> dict[str, torch.Tensor]:
        values = _predicting(spec.heads, predicted, cut, spec.width)
        return yolo_loss(spec.heads, values, Truth(learnt, kinds, kinds, asked), spec.width)

    exact, far, plain = loss(whole, cut), loss(whole, whole), loss(cut, whole)
    assert exact["box"] == pytest.approx(0.0, abs=1e-5)
    assert torch.equal(far["kind"], plain["kind"])
    assert torch.equal(far["object"], plain["object"])
    corners = torch.cat([cut[:, :2] - cut[:, 2:] / 2, cut[:, :2] + cut[:, 2:] / 2], dim=1).numpy()
    into_the_other = _iou(np.array((100.0, 50.0, 140.0, 170.0)), corners[1]) - APART
    assert into_the_other > 0.05
    assert float(far["box"]) == pytest.approx(CUT * (float(plain["box"]) + 2.0 * into_the_other), rel=1e-4)


def test_a_box_alone_counts_once() -> None:
    spec = read_cfg(str(Path(__file__).parents[2] / "models" / "house.cfg"))
    kinds, asked = torch.zeros(2, dtype=torch.long), torch.ones(2, dtype=torch.bool)
    boxes = torch.tensor([[120.0, 110, 40, 120], [220.0, 110, 40, 120]])
    assert cut_apart(boxes, kinds, asked)[1].tolist() == [0, 1]
    values = _predicting(spec.heads, boxes * torch.tensor([1.0, 1.0, 0.5, 1.0]), boxes, spec.width)
    part = yolo_loss(spec.heads, values, Truth(boxes, kinds, kinds, asked), spec.width)["box"]
    assert float(part) == pytest.approx(2.0 * 0.5, rel=1e-4)
