"""How well a weights file finds people and hydrants: recall by distance, precision, average precision, worst misses.

Reads the weights file itself and decodes as the node does, so that what is measured is what is shipped.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.detection.darknet import decode
from rosbot_patrol.detection.darknet.cfg import read_cfg
from rosbot_patrol.detection.darknet.letterbox import Letterbox
from rosbot_patrol.detection.darknet.weights import read_weights
from rosbot_patrol.detection.network import load_network
from rosbot_patrol.images.encodings import Picture
from training.judging.scoring import (
    AIMED,
    KINDS,
    SUPPRESSION,
    Found,
    average_precision,
    figures,
    groups,
    match,
    say,
    say_false_alarms,
    say_found_at,
    say_spared,
)
from training.learning.dataset import Pictures, asked, batch_of
from training.pictures.labels import HEIGHT, WIDTH, column

FLOOR = 0.02
Forward = Callable[[NDArray[Any]], list[NDArray[Any]]]


def load_forward(cfg: Path, weights: Path, *, threads: int = 2) -> Forward:
    """Runs a weights file as the node does, by the same run-time."""
    spec = read_cfg(str(cfg))
    network = load_network(spec, read_weights(str(weights), spec), threads=threads)
    place = Letterbox(WIDTH, HEIGHT, spec.width, spec.height)

    def forward(images: NDArray[Any]) -> list[NDArray[Any]]:
        answers = [network.run(Picture(picture, "rgb8"), place) for picture in images]
        return [np.stack(values) for values in zip(*answers, strict=True)]

    return forward


def find_all(pictures: Pictures, cfg: Path, forward: Forward, *, batch: int = 16) -> Found:
    """Run a network over a set."""
    spec = read_cfg(str(cfg))
    index = pictures.index()
    boxes, labels, hits, first = [], [], [], 0
    place = Letterbox(WIDTH, HEIGHT, spec.width, spec.height)
    for start in range(0, len(index), batch):
        chosen = index[start : start + batch]
        values = forward(batch_of(pictures, chosen, None)[0])
        for b, (shard, i) in enumerate(chosen):
            rows = pictures.labels[shard][i].copy()
            rows[:, 0] = start + b
            mine = [value[b] for value in values]
            found = decode.decode(spec.heads, mine, place, threshold=FLOOR, iou_threshold=SUPPRESSION)
            got, hit = match(start + b, found, rows, first)
            first += len(hit)
            boxes.append(got)
            labels.append(rows)
            hits.append(hit)
    return Found(np.concatenate(boxes), np.concatenate(labels), np.concatenate(hits), index)


def draw_worst(pictures: Pictures, found: Found, threshold: float, target: Path, *, count: int = 10) -> None:
    """A picture of the worst misses (upper rows) and false alarms (lower rows)."""
    labels = found.labels
    wanted = groups(found)[AIMED]
    missed = np.flatnonzero(wanted & (found.hit <= threshold))
    missed = missed[np.argsort(-column(labels, "pixels")[missed])][:count]
    false = found.boxes[found.false(0) | found.false(1)]
    false = false[np.argsort(-false[:, 2])][:count]
    tiles = [
        _tile(pictures, found, int(labels[i, 0]), labels[i, 2:6], colour=(255, 0, 0), text="missed") for i in missed
    ]
    tiles += [
        _tile(pictures, found, int(b[0]), b[3:7], colour=(255, 160, 0), text=f"{KINDS[int(b[1])]} {b[2]:.2f}")
        for b in false
    ]
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


def save_sheet(tiles: list[NDArray[Any]], target: Path, *, columns: int = 5) -> None:
    """Pictures beside each other, as a jpeg."""
    if not tiles:
        return
    tiles = tiles + [np.zeros_like(tiles[0])] * (-len(tiles) % columns)
    rows = [np.hstack(tiles[i : i + columns]) for i in range(0, len(tiles), columns)]
    target.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(target), np.vstack(rows)[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 78])


def _picture(pictures: Pictures, found: Found, number: int) -> NDArray[Any]:
    return pictures.picture(*found.index[number]).copy()


def _tile(
    pictures: Pictures, found: Found, number: int, box: NDArray[Any], *, colour: tuple[int, int, int], text: str
) -> NDArray[Any]:
    picture = _picture(pictures, found, number)
    _frame(picture, box, colour, text)
    return picture


def _frame(picture: NDArray[Any], box: NDArray[Any], colour: tuple[int, int, int], text: str) -> None:
    x0, y0, x1, y1 = (box * [WIDTH, HEIGHT, WIDTH, HEIGHT]).astype(int)
    cv2.rectangle(picture, (x0, y0), (x1 - 1, y1 - 1), colour, 1)
    cv2.putText(picture, text, (x0, max(y0 - 3, 9)), cv2.FONT_HERSHEY_SIMPLEX, 0.35, colour, 1, cv2.LINE_AA)


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
    found = find_all(pictures, options.cfg, load_forward(options.cfg, options.weights))
    results = []
    for threshold in options.threshold:
        results.append(figures(found, threshold))
        sys.stdout.write(say(results[-1]) + "\n")
    precisions = {f"average precision, {k}": average_precision(found, i) for i, k in enumerate(KINDS)}
    sys.stdout.write("".join(f"{k}: {v:.4f}\n" for k, v in precisions.items()))
    for lines in (say_found_at(found), say_spared(found), say_false_alarms(found, options.threshold)):
        sys.stdout.write(lines + "\n")
    if options.json:
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps({"thresholds": results, **precisions}, indent=1))
    if options.sheets:
        draw_worst(pictures, found, options.threshold[0], options.sheets / f"worst_{options.name}.jpg")
        draw_found(pictures, found, options.threshold[0], options.sheets / f"found_{options.name}.jpg")
        draw_samples(pictures, options.sheets / f"samples_{options.name}.jpg")


if __name__ == "__main__":
    main()
