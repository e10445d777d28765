"""What counts as found, as missed and as false, and the figures and tables made of it.

A detection hits the person (or hydrant) of its kind that it overlaps most, where that is an IoU of 0.5 or more; each is
hit once, by the most probable. Everything else is **false**: a box where nobody is, a second box on somebody, a box of
the wrong size. One exception, as in the Caltech pedestrian benchmark (Dollar et al. 2012): somebody there who is not
asked for (`dataset.asked`: hardly seen, or not to be made out) is neither missed nor false; a detection that overlaps
him by 0.5, or lies by more than half inside his box, is left out of the count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.detection.darknet import decode
from training.learning.dataset import asked
from training.pictures.labels import column

KINDS = ("person", "fire hydrant")
AIMED = "persons 1-6 m, half of the figure seen"
HIT = 0.5
INSIDE = 0.5
TOUCHES = 0.1
SUPPRESSION = 0.4  # the overlap beyond which darknet_ros keeps one box of two
FALSE_ALARMS = (
    "of the wrong size, on a person who is found by no surer box",
    "a second one, on a person who is found",
    "beside the persons of the picture",
    "in a picture with no person",
)


@dataclass
class Found:
    """All detections of a set, and the labels.

    Attributes:
        boxes: picture, kind, probability, x0, y0, x1, y1, index of the label that it hits or -1, whether it is left
            out of the count; shape (N, 9).
        labels: rows of the labels with the picture's number in the whole set.
        hit: the best probability with which each label was found, 0 if not.
        index: (shard, picture) of each picture.
    """

    boxes: NDArray[Any]
    labels: NDArray[Any]
    hit: NDArray[Any]
    index: NDArray[Any] = field(repr=False)

    @property
    def wanted(self) -> NDArray[Any]:
        """Which labels are asked for."""
        return asked(self.labels)

    def false(self, kind: int) -> NDArray[Any]:
        """Which detections are false alarms of that kind."""
        alarms: NDArray[Any] = (self.boxes[:, 1] == kind) & (self.boxes[:, 7] < 0) & (self.boxes[:, 8] == 0)
        return alarms

    def good(self, kind: int) -> NDArray[Any]:
        """Which detections of that kind hit what is asked for."""
        at = self.boxes[:, 7].astype(int)
        hits: NDArray[Any] = (self.boxes[:, 1] == kind) & (at >= 0) & (self.wanted[at] if len(self.labels) else False)
        return hits


def match(number: int, found: decode.Candidates, rows: NDArray[Any], first: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Rows of `Found.boxes` of one picture, and with which probability each of its labels was found.

    Args:
        number: of the picture.
        found: its detections.
        rows: its labels.
        first: index of the first of them among all labels.
    """
    low, high = found.boxes[:, :2] - found.boxes[:, 2:] / 2, found.boxes[:, :2] + found.boxes[:, 2:] / 2
    out = np.zeros((len(found), 9))
    out[:, 0], out[:, 1] = number, found.probabilities.argmax(axis=1)
    out[:, 2], out[:, 3:7], out[:, 7] = found.probabilities.max(axis=1), np.clip(np.hstack([low, high]), 0, 1), -1
    truth, wanted, hit = rows[:, 2:6], asked(rows), np.zeros(len(rows))
    for k in np.argsort(-out[:, 2], kind="stable") if len(rows) else ():
        same = rows[:, 1] == out[k, 1]
        overlap = _iou(out[k, 3:7], truth) * same
        for group in (wanted, ~wanted):
            free = np.where((hit == 0) & group, overlap, 0)
            if free.max() >= HIT:
                j = int(free.argmax())
                hit[j], out[k, 7], out[k, 8] = out[k, 2], first + j, not wanted[j]
                break
        else:
            out[k, 8] = ((_inside(out[k, 3:7], truth) > INSIDE) & same & ~wanted).any()
    return out, hit


def average_precision(found: Found, kind: int) -> float:
    """Area under the curve of precision over recall at IoU 0.5, of what is asked for."""
    good, false = found.good(kind), found.false(kind)
    counts = good | false
    order = np.argsort(-found.boxes[counts, 2], kind="stable")
    hits = np.cumsum(good[counts][order])
    precision = hits / np.arange(1, len(hits) + 1)
    precision = np.maximum.accumulate(precision[::-1])[::-1]
    recall = hits / max(int((found.wanted & (column(found.labels, "kind") == kind)).sum()), 1)
    return float(np.sum(np.diff(np.concatenate([[0], recall])) * precision))


def found_at(found: Found, precision: float) -> tuple[float, int, int]:
    """What is found of the persons that are aimed at, where the threshold is as low as that precision allows.

    Args:
        found: what a network found in a set.
        precision: least share of right boxes among all boxes of persons.

    Returns:
        The threshold (1 where none is high enough), how many are found with it or more, how many there are.
    """
    good = found.good(0)
    counts = good | found.false(0)
    order = np.argsort(-found.boxes[counts, 2], kind="stable")
    scores = found.boxes[counts, 2][order]
    right = np.cumsum(good[counts][order]) / np.arange(1, len(order) + 1)
    last = np.append(scores[1:] < scores[:-1], True)  # of boxes that are as sure, all count or none
    enough = np.flatnonzero((right >= precision) & last)
    threshold = float(scores[enough[-1]]) if len(enough) else 1.0
    aimed = groups(found)[AIMED]
    return threshold, int((found.hit[aimed] >= threshold).sum()), int(aimed.sum())


def groups(found: Found) -> dict[str, NDArray[Any]]:
    """The sets of labels whose recall is told, the one that is aimed at first."""
    rows = found.labels
    person, distance = column(rows, "kind") == 0, column(rows, "distance")
    whole, part, light = column(rows, "seen_of_whole"), column(rows, "seen_of_part"), column(rows, "light")
    wanted = found.wanted
    near = (distance >= 1) & (distance <= 6) & wanted
    aimed = person & near & (whole >= 0.5)
    edge = (column(rows, "x0") < 0.01) | (column(rows, "x1") > 0.99)
    sets = {
        AIMED: aimed,
        "persons 1-6 m, half of what is inside the picture seen": person & near & (part >= 0.5),
        "fire hydrants 1-6 m, half seen": ~person & near & (part >= 0.5),
    }
    for low, high in ((0.7, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 7), (7, 8.6)):
        there = person & wanted & (distance >= low) & (distance < high)
        sets[f"distance {low:g}-{high:g} m, half of what is inside the picture seen"] = there & (part >= 0.5)
    for low, high in ((0.1, 0.3), (0.3, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 1.01)):
        sets[f"1-6 m, {low:.0%} to {min(high, 1):.0%} of the figure seen"] = (
            person & near & (whole >= low) & (whole < high)
        )
    for low, high, name in ((0, 25, "dark"), (25, 60, "dim"), (60, 130, "usual"), (130, 256, "bright")):
        sets[f"1-6 m, half of the figure seen, {name} (mean level {low}-{min(high, 255)})"] = (
            aimed & (light >= low) & (light < high)
        )
    sets["1-6 m, half of the figure seen, outline of 15 levels or less"] = aimed & (column(rows, "contrast") <= 15)
    sets["1-6 m, half of the figure seen, at the picture's edge"] = aimed & edge
    sets["1-6 m, half of the figure seen, away from the edge"] = aimed & ~edge
    return sets


def figures(found: Found, threshold: float) -> dict[str, float]:
    """Counts at a threshold."""
    out: dict[str, float] = {"threshold": threshold, "pictures": len(found.index)}
    for name, chosen in groups(found).items():
        out[f"{name}: there"], out[f"{name}: found"] = int(chosen.sum()), int((found.hit[chosen] > threshold).sum())
    sure = found.boxes[:, 2] > threshold
    for kind, name in enumerate(KINDS):
        false, good = found.false(kind) & sure, found.good(kind) & sure
        there = np.isin(found.boxes[:, 0], column(found.labels, "picture")[column(found.labels, "kind") == kind])
        out[f"{name}: boxes"], out[f"{name}: false"] = int((false | good).sum()), int(false.sum())
        out[f"{name}: false where there is none"] = int((false & ~there).sum())
    return out


def false_alarms(found: Found, threshold: float) -> dict[str, int]:
    """What the false boxes of persons above a threshold are: how many of each of `FALSE_ALARMS`.

    A box belongs to the person it overlaps most, where that is an IoU of `TOUCHES` or more.
    """
    counts = dict.fromkeys(FALSE_ALARMS, 0)
    wrong, second, beside, nobody = FALSE_ALARMS
    person = column(found.labels, "kind") == 0
    for box in found.boxes[found.false(0) & (found.boxes[:, 2] > threshold)]:
        there = np.flatnonzero(person & (column(found.labels, "picture") == box[0]))
        overlap = _iou(box[3:7], found.labels[there, 2:6])
        if not len(there):
            counts[nobody] += 1
        elif overlap.max() < TOUCHES:
            counts[beside] += 1
        else:
            counts[second if found.hit[there[overlap.argmax()]] >= box[2] else wrong] += 1
    return counts


def spared(found: Found, sure: NDArray[Any]) -> int:
    """How many of the persons that are aimed at darknet's suppression leaves, if every box is as it should be.

    Args:
        found: what is there; what a network found in it does not matter.
        sure: objectness of the box of each label, shape (labels,).
    """
    left = 0
    aimed, wanted, pictures = groups(found)[AIMED], found.wanted, column(found.labels, "picture")
    for picture in np.unique(pictures[aimed]):
        there = np.flatnonzero((pictures == picture) & wanted)
        low, high = found.labels[there, 2:4], found.labels[there, 4:6]
        boxes = np.hstack([(low + high) / 2, high - low])
        exact = decode.Candidates(boxes, sure[there], aimed[there, None].astype(float))
        left += int(decode.suppress_by_objectness(exact, SUPPRESSION).probabilities.sum())
    return left


def wilson(hits: float, count: float) -> tuple[float, float]:
    """The 95 % interval of a share (Wilson 1927)."""
    if not count:
        return 0.0, 1.0
    z, share = 1.959964, hits / count
    middle = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = z * np.sqrt(share * (1 - share) / count + z * z / (4 * count * count)) / (1 + z * z / count)
    return max(float(middle - half), 0.0), min(float(middle + half), 1.0)


def say(result: dict[str, float]) -> str:
    """The figures as lines of text."""
    lines = [f"threshold {result['threshold']:g}, {result['pictures']:.0f} pictures"]
    for name, value in result.items():
        stem, _, what = name.rpartition(": ")
        if what == "there":
            lines.append(f"  recall, {stem}: {share(result[stem + ': found'], value)}")
        elif what == "boxes":
            right = share(value - result[stem + ": false"], value)
            alone = result[stem + ": false where there is none"]
            lines.append(f"  precision, {stem}: {right} ({alone:.0f} false with none there)")
    return "\n".join(lines)


def say_found_at(found: Found, precisions: tuple[float, ...] = (0.95, 0.99, 0.995)) -> str:
    """How many of the persons that are aimed at are found at those precisions, as lines of text."""
    lines = []
    for precision in precisions:
        threshold, hits, there = found_at(found, precision)
        lines.append(f"{AIMED}, at a precision of {precision:.1%} (threshold {threshold:.3f}): {share(hits, there)}")
    return "\n".join(lines)


def say_spared(found: Found) -> str:
    """What `spared` tells where those aimed at are the surest, and where they are the least sure, as lines of text."""
    aimed = groups(found)[AIMED]
    return "\n".join(
        f"{AIMED}, left by the suppression of exact boxes, {how}: {share(spared(found, sure), aimed.sum())}"
        for how, sure in (("theirs the surest", aimed.astype(float)), ("theirs the least sure", (~aimed).astype(float)))
    )


def say_false_alarms(found: Found, thresholds: Sequence[float]) -> str:
    """What `false_alarms` counts, as lines of text."""
    lines = []
    for threshold in thresholds:
        counts = false_alarms(found, threshold)
        lines.append(f"{sum(counts.values())} false boxes of persons above {threshold:g}:")
        lines += [f"  {count} {what}" for what, count in counts.items()]
    return "\n".join(lines)


def share(hits: float, count: float) -> str:
    """As text: "97/100 = 97.00 % (95 %: ...)", with the interval of `wilson`."""
    if not count:
        return "none there"
    low, high = wilson(hits, count)
    return f"{hits:.0f}/{count:.0f} = {100 * hits / count:.2f} % (95 %: {100 * low:.1f} to {100 * high:.1f})"


def _iou(box: NDArray[Any], others: NDArray[Any]) -> NDArray[Any]:
    shared = _shared(box, others)
    union = (box[2:] - box[:2]).prod() + (others[:, 2:] - others[:, :2]).prod(axis=1) - shared
    overlaps: NDArray[Any] = shared / np.maximum(union, 1e-9)
    return overlaps


def _inside(box: NDArray[Any], others: NDArray[Any]) -> NDArray[Any]:
    return _shared(box, others) / max(float((box[2:] - box[:2]).prod()), 1e-9)


def _shared(box: NDArray[Any], others: NDArray[Any]) -> NDArray[Any]:
    corners = np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2])
    return np.asarray(np.clip(corners, 0, None).prod(axis=1))
