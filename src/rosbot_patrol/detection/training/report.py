"""How well a weights file finds people and hydrants: recall by distance, precision, average precision, worst misses.

Reads the weights file itself and decodes as the node does, so that what is measured is what is shipped.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from rosbot_patrol.detection import decode
from rosbot_patrol.detection.darknet_cfg import read_cfg
from rosbot_patrol.detection.darknet_weights import read_weights
from rosbot_patrol.detection.letterbox import Letterbox
from rosbot_patrol.detection.training.dataset import Pictures, asked, batch_of
from rosbot_patrol.detection.training.labels import HEIGHT, WIDTH, column

KINDS = ("person", "fire hydrant")
FLOOR = 0.02
HIT = 0.5
Forward = Callable[[np.ndarray], list[np.ndarray]]


@dataclass
class Found:
    """All detections of a set above `FLOOR`, and the labels.

    Attributes:
        boxes: picture, kind, probability, x0, y0, x1, y1, index of the label that it hits or -1, whether it lies on
            something that is not asked for.
        labels: rows of the labels with the picture's number in the whole set.
        hit: the best probability with which each label was found, 0 if not.
    """

    boxes: np.ndarray
    labels: np.ndarray
    hit: np.ndarray
    index: np.ndarray = field(repr=False)


def torch_forward(cfg: Path, weights: Path) -> Forward:
    """Runs a weights file by PyTorch."""
    import torch

    from rosbot_patrol.detection.training.network import Darknet

    spec = read_cfg(str(cfg))
    network = Darknet(spec).eval()
    network.from_weights(read_weights(str(weights), spec))

    def forward(images: np.ndarray) -> list[np.ndarray]:
        inputs = torch.from_numpy(images).permute(0, 3, 1, 2).float() / 255.0
        inputs[:, :, :8] = inputs[:, :, -8:] = 0.5
        with torch.inference_mode():
            return [value.numpy() for value in network(inputs)]

    return forward


def find_all(pictures: Pictures, cfg: Path, forward: Forward, *, batch: int = 16) -> Found:
    """Run a network over a set."""
    spec = read_cfg(str(cfg))
    index = pictures.index()
    boxes, labels, hits = [], [], []
    place = Letterbox(WIDTH, HEIGHT, spec.width, spec.height)
    for start in range(0, len(index), batch):
        chosen = index[start : start + batch]
        values = forward(batch_of(pictures, chosen, None)[0])
        for b, (shard, i) in enumerate(chosen):
            rows = pictures.labels[shard][i].copy()
            rows[:, 0] = start + b
            mine = [value[b] for value in values]
            found = decode.decode(spec.heads, mine, place, threshold=FLOOR, iou_threshold=0.4)
            got, hit = _match(start + b, found, rows, sum(len(h) for h in hits))
            boxes.append(got)
            labels.append(rows)
            hits.append(hit)
    return Found(np.concatenate(boxes), np.concatenate(labels), np.concatenate(hits), index)


def _match(number: int, found: decode.Candidates, rows: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
    low, high = found.boxes[:, :2] - found.boxes[:, 2:] / 2, found.boxes[:, :2] + found.boxes[:, 2:] / 2
    corners = np.clip(np.concatenate([low, high], axis=1), 0, 1)
    out = np.zeros((len(found), 9))
    out[:, 0], out[:, 1] = number, found.probabilities.argmax(axis=1)
    out[:, 2], out[:, 3:7], out[:, 7] = found.probabilities.max(axis=1), corners, -1
    truth = rows[:, 2:6]
    hit = np.zeros(len(rows))
    taken = np.zeros(len(rows), bool)
    for k in np.argsort(-out[:, 2]):
        overlap = _iou(out[k, 3:7], truth) * (rows[:, 1] == out[k, 1])
        free = np.where(taken, 0, overlap)
        if len(rows) and free.max() >= HIT:
            j = int(free.argmax())
            taken[j], hit[j], out[k, 7] = True, out[k, 2], first + j
        elif len(rows):
            # on somebody who is hardly seen, or a second box on a group of people: no false alarm
            inside = _inside(out[k, 3:7], truth)
            same = rows[:, 1] == out[k, 1]
            out[k, 8] = ((inside > 0.5) & same).any() or (overlap > 0.3).any()
    return out, hit


def average_precision(found: Found, kind: int) -> float:
    """Area under the curve of precision over recall at IoU 0.5, of what is asked for."""
    wanted = asked(found.labels) & (column(found.labels, "kind") == kind)
    mine = found.boxes[found.boxes[:, 1] == kind]
    matched = mine[:, 7].astype(int)
    good = np.where(matched >= 0, wanted[matched], False)
    counts = (matched < 0) & (mine[:, 8] == 0) | good
    order = np.argsort(-mine[counts, 2])
    hits = np.cumsum(good[counts][order])
    precision = hits / np.arange(1, len(hits) + 1)
    precision = np.maximum.accumulate(precision[::-1])[::-1]
    recall = hits / max(wanted.sum(), 1)
    return float(np.sum(np.diff(np.concatenate([[0], recall])) * precision))


def figures(found: Found, threshold: float) -> dict[str, float]:
    """Counts and shares at a threshold."""
    labels, boxes = found.labels, found.boxes[found.boxes[:, 2] > threshold]
    out: dict[str, float] = {"threshold": threshold, "pictures": len(found.index)}
    distance, person = column(labels, "distance"), column(labels, "kind") == 0
    half = column(labels, "seen_of_part") >= 0.5
    lit = column(labels, "light") > 6.0
    near = person & (distance >= 1) & (distance <= 6) & lit
    sets = {
        "persons 1-6 m, half of what is in the picture seen": near & half & asked(labels),
        "persons 1-6 m, half of the whole figure seen": near & (column(labels, "seen_of_whole") >= 0.5),
        "fire hydrants 1-6 m, half seen": ~person & (distance >= 1) & (distance <= 6) & half & lit,
    }
    for lo, hi in ((0.7, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 7), (7, 8.5)):
        sets[f"persons {lo}-{hi} m, half seen"] = (
            person & (distance >= lo) & (distance < hi) & half & lit & asked(labels)
        )
    for name, chosen in sets.items():
        out[f"{name}: there"] = int(chosen.sum())
        out[f"{name}: found"] = int((found.hit[chosen] > threshold).sum())
    for kind, name in enumerate(KINDS):
        mine = boxes[boxes[:, 1] == kind]
        false = (mine[:, 7] < 0) & (mine[:, 8] == 0)
        out[f"{name}: boxes"], out[f"{name}: false"] = len(mine), int(false.sum())
        nobody = false & ~np.isin(mine[:, 0], column(labels, "picture")[column(labels, "kind") == kind])
        out[f"{name}: false where there is none"] = int(nobody.sum())
    return out


def say(result: dict[str, float]) -> str:
    """The figures as lines of text."""
    lines = [f"threshold {result['threshold']}, {result['pictures']} pictures"]
    for name, value in result.items():
        if name.endswith(": there"):
            stem = name[: -len(": there")]
            hits = result[stem + ": found"]
            share = f"{100 * hits / value:.2f} %" if value else "none"
            lines.append(f"  recall, {stem}: {hits:.0f}/{value:.0f} = {share}")
        elif name.endswith(": boxes"):
            stem = name[: -len(": boxes")]
            false = result[stem + ": false"]
            share = f"{100 * (1 - false / value):.2f} %" if value else "none"
            alone = result[stem + ": false where there is none"]
            lines.append(
                f"  precision, {stem}: {value - false:.0f}/{value:.0f} = {share} ({alone:.0f} false with none there)"
            )
    return "\n".join(lines)


def draw_worst(pictures: Pictures, found: Found, threshold: float, target: Path, *, count: int = 10) -> None:
    """A picture of the worst misses (upper rows) and false alarms (lower rows)."""
    labels = found.labels
    wanted = asked(labels) & (column(labels, "kind") == 0) & (column(labels, "seen_of_part") >= 0.5)
    wanted &= column(labels, "distance") <= 6
    missed = np.flatnonzero(wanted & (found.hit <= threshold))
    missed = missed[np.argsort(-column(labels, "pixels")[missed])][:count]
    false = found.boxes[(found.boxes[:, 7] < 0) & (found.boxes[:, 8] == 0)]
    false = false[np.argsort(-false[:, 2])][:count]
    tiles = [_tile(pictures, found, int(labels[i, 0]), labels[i, 2:6], (255, 0, 0), "missed") for i in missed]
    tiles += [_tile(pictures, found, int(b[0]), b[3:7], (255, 160, 0), f"{KINDS[int(b[1])]} {b[2]:.2f}") for b in false]
    save_sheet(tiles, target)


def draw_found(
    pictures: Pictures, found: Found, threshold: float, target: Path, *, count: int = 15, seed: int = 0
) -> None:
    """A picture of what was found in pictures by chance."""
    numbers = np.random.default_rng(seed).permutation(len(found.index))
    with_some = [n for n in numbers if (found.labels[:, 0] == n).any()][: count - 3]
    tiles = []
    for n in [*with_some, *[n for n in numbers[-50:] if n not in with_some][:3]]:
        picture = _picture(pictures, found, int(n))
        for box in found.boxes[(found.boxes[:, 0] == n) & (found.boxes[:, 2] > threshold)]:
            colour = (255, 40, 40) if box[1] == 0 else (60, 255, 60)
            _frame(picture, box[3:7], colour, f"{KINDS[int(box[1])]} {box[2]:.2f}")
        tiles.append(picture)
    save_sheet(tiles, target)


def draw_samples(pictures: Pictures, target: Path, *, count: int = 20, seed: int = 0) -> None:
    """A picture of the labels of pictures by chance."""
    index = pictures.index()
    tiles = []
    for n in np.random.default_rng(seed).permutation(len(index))[:count]:
        picture = pictures.picture(*index[n]).copy()
        rows = pictures.labels[index[n][0]][index[n][1]]
        for row, good in zip(rows, asked(rows), strict=True):
            colour = (150, 150, 150) if not good else (255, 40, 40) if row[1] == 0 else (60, 255, 60)
            _frame(picture, row[2:6], colour, "")
        tiles.append(picture)
    save_sheet(tiles, target)


def save_sheet(tiles: list[np.ndarray], target: Path, *, columns: int = 5) -> None:
    """Pictures beside each other, as a jpeg."""
    if not tiles:
        return
    tiles = tiles + [np.zeros_like(tiles[0])] * (-len(tiles) % columns)
    rows = [np.hstack(tiles[i : i + columns]) for i in range(0, len(tiles), columns)]
    target.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(target), np.vstack(rows)[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 78])


def _picture(pictures: Pictures, found: Found, number: int) -> np.ndarray:
    return pictures.picture(*found.index[number]).copy()


def _tile(
    pictures: Pictures, found: Found, number: int, box: np.ndarray, colour: tuple[int, int, int], text: str
) -> np.ndarray:
    picture = _picture(pictures, found, number)
    _frame(picture, box, colour, text)
    return picture


def _frame(picture: np.ndarray, box: np.ndarray, colour: tuple[int, int, int], text: str) -> None:
    x0, y0, x1, y1 = (box * [WIDTH, HEIGHT, WIDTH, HEIGHT]).astype(int)
    cv2.rectangle(picture, (x0, y0), (x1 - 1, y1 - 1), colour, 1)
    cv2.putText(picture, text, (x0, max(y0 - 3, 9)), cv2.FONT_HERSHEY_SIMPLEX, 0.35, colour, 1, cv2.LINE_AA)


def _iou(box: np.ndarray, others: np.ndarray) -> np.ndarray:
    shared = np.clip(np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2]), 0, None).prod(axis=1)
    union = (box[2:] - box[:2]).prod() + (others[:, 2:] - others[:, :2]).prod(axis=1) - shared
    return shared / np.maximum(union, 1e-9)


def _inside(box: np.ndarray, others: np.ndarray) -> np.ndarray:
    shared = np.clip(np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2]), 0, None).prod(axis=1)
    return shared / max(float((box[2:] - box[:2]).prod()), 1e-9)


def main() -> None:
    """Report on a set from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--name", default="test")
    parser.add_argument("--cfg", type=Path, required=True)
    parser.add_argument("--weights", type=Path, required=True)
    parser.add_argument("--threshold", type=float, nargs="+", default=[0.3])
    parser.add_argument("--sheets", type=Path, help="folder for pictures")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    pictures = Pictures.open(options.data, options.name)
    found = find_all(pictures, options.cfg, torch_forward(options.cfg, options.weights))
    results = []
    for threshold in options.threshold:
        results.append(figures(found, threshold))
        sys.stdout.write(say(results[-1]) + "\n")
    precisions = {f"average precision, {k}": average_precision(found, i) for i, k in enumerate(KINDS)}
    sys.stdout.write("".join(f"{k}: {v:.4f}\n" for k, v in precisions.items()))
    if options.json:
        options.json.write_text(json.dumps({"thresholds": results, **precisions}, indent=1))
    if options.sheets:
        draw_worst(pictures, found, options.threshold[0], options.sheets / f"worst_{options.name}.jpg")
        draw_found(pictures, found, options.threshold[0], options.sheets / f"found_{options.name}.jpg")
        draw_samples(pictures, options.sheets / f"samples_{options.name}.jpg")


if __name__ == "__main__":
    main()
