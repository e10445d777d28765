"""Boxes that darknet's suppression would take for one, cut so that both are left.

darknet keeps one of two boxes that overlap by more than 0.4, so of two people who stand half one behind the other one
is not told. Nothing says that a box must reach to the last pixel: each may end a little earlier on the other's side and
still count as right (an overlap of 0.5 with the label's). So a network learns such boxes cut. What "Repulsion Loss:
Detecting Pedestrians in a Crowd", Wang et al. 2018, does by a term of the loss, is done here to what is learnt as well.
"""

from __future__ import annotations

import torch

APART = 0.33  # darknet_ros suppresses at 0.4; predicted boxes are not exact
MOST = 0.25  # of a box's width or height is cut at most: the overlap with what it was is 0.75 then
STEPS = 26


def cut_apart(boxes: torch.Tensor, batch: torch.Tensor, asked: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """The boxes, of which those that overlap another by more than `APART` are cut, both by the same share.

    The second value is the row of the box that each is cut away from, its own where it is not cut, shape (N,).

    Each is cut away from the one that it overlaps most, across or upwards, whichever takes less; where `MOST` of both
    is not enough, they stay as they are. No operation's shape depends on the values.

    Args:
        boxes: centre and size [px], shape (N, 4).
        batch: picture of each, shape (N,).
        asked: whether each is asked for; what is not neither is cut nor cuts, shape (N,).
    """
    number = torch.arange(len(boxes), device=boxes.device)
    if len(boxes) < 2:
        return boxes, number
    low, high = boxes[:, :2] - boxes[:, 2:] / 2, boxes[:, :2] + boxes[:, 2:] / 2
    pairs = (batch[:, None] == batch) & asked[:, None] & asked & (number[:, None] != number)
    overlap = torch.where(pairs, _iou(low[:, None], high[:, None], low, high), 0.0)
    most, other = overlap.max(dim=1)
    before = boxes[:, :2] < boxes[other, :2]
    before = before | ((boxes[:, :2] == boxes[other, :2]) & (number < other)[:, None])  # (N, axis): left of, above
    steps = torch.linspace(0.0, MOST, STEPS, device=boxes.device)
    share = torch.eye(2, device=boxes.device)[:, None] * steps[:, None]  # (axis, step, x and y)
    mine = _cut(low, high, share, before)
    theirs = _cut(low[other], high[other], share, ~before)
    left = _iou(*mine, *theirs)  # (N, axis, step)
    least = torch.where(left <= APART, steps, torch.inf).amin(dim=2)
    cut, axis = least.min(dim=1)
    cut = torch.where((most > APART) & cut.isfinite(), cut, 0.0)
    share = torch.nn.functional.one_hot(axis, 2) * cut[:, None]
    low = low + torch.where(before, 0.0, share) * boxes[:, 2:]
    high = high - torch.where(before, share, 0.0) * boxes[:, 2:]
    boxes = torch.where(cut[:, None] > 0, torch.cat([(low + high) / 2, high - low], dim=1), boxes)
    return boxes, torch.where(cut > 0, other, number)


def _cut(
    low: torch.Tensor, high: torch.Tensor, share: torch.Tensor, before: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Corners with each share cut, shape (N, axis, step, 2): at the far end of who comes before, else at the near."""
    off = share * (high - low)[:, None, None]
    first = before[:, None, None]
    return low[:, None, None] + torch.where(first, 0.0, off), high[:, None, None] - torch.where(first, off, 0.0)


def _iou(low: torch.Tensor, high: torch.Tensor, other_low: torch.Tensor, other_high: torch.Tensor) -> torch.Tensor:
    shared, union = shared_and_union(low, high, other_low, other_high)
    return shared / union.clamp(min=1e-6)


def shared_and_union(
    low: torch.Tensor, high: torch.Tensor, other_low: torch.Tensor, other_high: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Areas [px^2] that boxes share and that they cover together, pair by pair; corners, shape (..., 2)."""
    shared = (torch.minimum(high, other_high) - torch.maximum(low, other_low)).clamp(min=0).prod(dim=-1)
    return shared, (high - low).prod(dim=-1) + (other_high - other_low).prod(dim=-1) - shared
