"""How far a network's values are from the boxes that pictures hold: YOLOv3's decoding, generalised-IoU boxes.

Each box is learnt by every anchor whose shape overlaps it by `MATCH`, and by its best one in any case. Predictions that
overlap a box well but are not made for it, and all that lie on something too hidden to ask for, are left alone.
Objectness learns how well the box fits (IoU-aware, as in PP-YOLO, Long et al. 2020): a box of the wrong size counts as
false, so it must not be sure of itself. Boxes that suppression would take for one are learnt cut apart (`apart.py`) and
count `CUT` times; what such a box reaches into the other's counts besides, as in "Repulsion Loss", Wang et al. 2018.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
import torch.nn.functional as fn

from rosbot_patrol.detection.darknet.layers import Yolo
from training.pictures.apart import APART, cut_apart, shared_and_union

MATCH = 0.45
IGNORE_IOU = 0.5
SURPRISE = 0.5
LEAST_SURE, SURE_FROM = 0.1, 0.75  # objectness of a box that overlaps by LOOSE or less, and the overlap of a sure one
LOOSE = 0.45
CUT = 6.0  # times as much counts a box that is cut apart from another: so few are, and suppression takes what is not


@dataclass
class Truth:
    """Boxes of a batch, in the network's input: shape (N, 4) centre and size [px], batch index, class, and whether
    the box is asked for (else it is left alone). `exists` is False for rows that only fill a batch up to a fixed size
    (such rows are asked for neither); None where there are none of them. `sure` is the objectness of a box that fits, 1
    where it is None.
    """

    boxes: torch.Tensor
    batch: torch.Tensor
    kinds: torch.Tensor
    asked: torch.Tensor
    exists: torch.Tensor | None = None
    sure: torch.Tensor | None = None


def yolo_loss(heads: list[Yolo], values: list[torch.Tensor], truth: Truth, width: int) -> dict[str, torch.Tensor]:
    """Parts of the loss: box, objectness, kind; each already weighted."""
    parts, _ = yolo_losses(heads, values, truth, width)
    return parts


def yolo_losses(
    heads: list[Yolo], values: list[torch.Tensor], truth: Truth, width: int
) -> tuple[dict[str, torch.Tensor], torch.Tensor]:
    """The same, and the objectness of each picture alone, shape (batch,): how badly each goes wrong.

    No operation's shape depends on the values, so that a GPU never has to wait for the processor to hear one.
    """
    boxes, other = cut_apart(truth.boxes, truth.batch, truth.asked)
    truth = replace(truth, boxes=boxes)
    sizes = torch.tensor([a for head in heads for a in head.anchors], device=truth.boxes.device)
    overlap = _shape_iou(truth.boxes[:, 2:], sizes)
    take = (overlap > MATCH) | (overlap == overlap.max(dim=1, keepdim=True).values)
    take &= truth.asked[:, None]
    parts = {name: values[0].new_zeros((), dtype=torch.float32) for name in ("box", "kind")}
    each = values[0].new_zeros(values[0].shape[0], dtype=torch.float32)
    first = 0
    for head, raw in zip(heads, values, strict=True):
        count = len(head.anchors)
        found = _head_loss(head, raw.float(), truth, other, take[:, first : first + count], width=width)
        for name in ("box", "kind"):
            parts[name] = parts[name] + found[name]
        each = each + 2.0 * found["object"]
        first += count
    matched = take.sum().clamp(min=1)
    weighted = {"box": 2.0 * parts["box"] / matched, "object": each.mean(), "kind": 0.5 * parts["kind"] / matched}
    return weighted, each.detach()


def _head_loss(
    head: Yolo, raw: torch.Tensor, truth: Truth, other: torch.Tensor, take: torch.Tensor, *, width: int
) -> dict[str, torch.Tensor]:
    batch, _, rows, columns = raw.shape
    anchors = len(head.anchors)
    stride = width / columns
    grid = raw.view(batch, anchors, 5 + head.classes, rows, columns)
    column = (truth.boxes[:, 0] / stride).long().clamp(0, columns - 1)
    row = (truth.boxes[:, 1] / stride).long().clamp(0, rows - 1)
    mine = grid[truth.batch, :, :, row, column]  # (N, anchors, 5 + classes)
    sizes = torch.tensor(head.anchors, device=raw.device)
    place = torch.stack([column, row], 1)[:, None]
    centre = (torch.sigmoid(mine[..., :2]) + place) * stride
    predicted = torch.cat([centre, torch.exp(mine[..., 2:4].clamp(max=6)) * sizes], 2)
    overlap, generalised = _overlaps(predicted, truth.boxes[:, None].expand_as(predicted))
    wanted = fn.one_hot(truth.kinds, head.classes).float()[:, None].expand_as(mine[..., 5:])
    unlike = fn.binary_cross_entropy_with_logits(mine[..., 5:], wanted, reduction="none").sum(2)
    none = unlike.new_zeros(())
    theirs, _ = _overlaps(predicted, truth.boxes[other][:, None].expand_as(predicted))
    cut = (other != torch.arange(len(other), device=raw.device))[:, None]
    amiss = torch.where(cut, CUT * (1 - generalised + (theirs - APART).clamp(min=0.0)), 1 - generalised)
    result = {
        "box": torch.where(take, amiss, none).sum(),
        "kind": torch.where(take, unlike, none).sum(),
    }
    fit = ((overlap.detach() - LOOSE) / (SURE_FROM - LOOSE)).clamp(0.0, 1.0)
    surest = LEAST_SURE + (1.0 - LEAST_SURE) * fit
    if truth.sure is not None:
        surest = surest * truth.sure[:, None]
    which = torch.arange(anchors, device=raw.device)
    cell = ((truth.batch[:, None] * anchors + which) * rows + row[:, None]) * columns + column[:, None]
    cell = torch.where(take, cell, batch * anchors * rows * columns)  # those not taken go to a cell beyond the last
    target = fit.new_zeros(batch * anchors * rows * columns + 1)
    target = target.scatter(0, cell.flatten(), surest.flatten())
    target = target[:-1].view(batch, anchors, rows, columns)
    weight = torch.where(target > 0, 1.0, _weight(head, grid, truth, stride))
    # a little focal: the many cells that are surely empty count less
    logits = grid[:, :, 4]
    surprise = (torch.sigmoid(logits) - target).abs().detach() ** SURPRISE
    each = fn.binary_cross_entropy_with_logits(logits, target, reduction="none")
    result["object"] = (each * surprise * weight).sum((1, 2, 3))
    return result


def _weight(head: Yolo, grid: torch.Tensor, truth: Truth, stride: float) -> torch.Tensor:
    """0 where a prediction is left alone, else 1."""
    batch, anchors, _, rows, columns = grid.shape
    left = grid.new_zeros(batch, anchors, rows, columns)
    if not len(truth.boxes):
        return left + 1.0
    with torch.no_grad():
        device = grid.device
        y, x = torch.meshgrid(torch.arange(rows, device=device), torch.arange(columns, device=device), indexing="ij")
        shapes = torch.tensor(head.anchors, device=device)[None, :, :, None, None]
        centre = (torch.sigmoid(grid[:, :, :2]) + torch.stack([x, y])) * stride
        size = torch.exp(grid[:, :, 2:4].clamp(max=6)) * shapes
        centre, size = centre[truth.batch], size[truth.batch]  # (N, anchors, 2, rows, columns)
        box = truth.boxes[:, None, :, None, None]
        low = torch.maximum(centre - size / 2, box[:, :, :2] - box[:, :, 2:] / 2)
        high = torch.minimum(centre + size / 2, box[:, :, :2] + box[:, :, 2:] / 2)
        shared, own = (high - low).clamp(min=0).prod(dim=2), size.prod(dim=2)
        good = shared / (own + box[:, :, 2:].prod(dim=2) - shared) > IGNORE_IOU
        away = (torch.stack([x, y])[None, None] + 0.5) * stride - box[:, :, :2]
        middle = (away.abs() < box[:, :, 2:] / 2 + stride).all(dim=2)
        doubtful = (shared / own.clamp(min=1.0) > 0.3) | middle
        alone = torch.where(truth.asked[:, None, None, None], good, doubtful)
        if truth.exists is not None:
            alone &= truth.exists[:, None, None, None]
        left.index_add_(0, truth.batch, alone.float())
    return (left == 0.0).float()


def _shape_iou(sizes: torch.Tensor, anchors: torch.Tensor) -> torch.Tensor:
    shared = torch.minimum(sizes[:, None], anchors[None]).prod(dim=2)
    return shared / (sizes.prod(dim=1)[:, None] + anchors.prod(dim=1)[None] - shared)


def _overlaps(a: torch.Tensor, b: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """IoU, and generalised IoU (Rezatofighi et al. 2019), of boxes pair by pair, shape (..., 4)."""
    a_low, a_high, b_low, b_high = (
        a[..., :2] - a[..., 2:] / 2,
        a[..., :2] + a[..., 2:] / 2,
        b[..., :2] - b[..., 2:] / 2,
        b[..., :2] + b[..., 2:] / 2,
    )
    shared, union = shared_and_union(a_low, a_high, b_low, b_high)
    hull = (torch.maximum(a_high, b_high) - torch.minimum(a_low, b_low)).prod(dim=-1)
    overlap = shared / union.clamp(min=1e-6)
    return overlap, overlap - (hull - union) / hull.clamp(min=1e-6)
