"""The shards that `render.py` wrote, as batches: pictures as the network gets them and their boxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from training.learning.mixing import View, disguise, mix, repaper, zoom
from training.pictures.labels import COLUMNS, HEIGHT, WIDTH, column
from training.pictures.overlay import lay_patterns

OVERLAY = 0.5
FAINT = 5.0
MIX, ZOOM = 0.5, 0.4
HIDDEN = 0.65
SHOWS = {"seen_of_part": (0.4, 0.6), "seen_of_whole": (0.25, 0.45)}
"""Shares seen of a person, up to which he hides, and from which on he shows: see `sureness`."""
JPEGS = ".jpegs"


class Packed:
    """A shard in memory as jpegs of high quality: a seventh of its size, and no disk between the network and it.

    Args:
        files: a jpeg each, uint8.
    """

    def __init__(self, files: list[NDArray[Any]]) -> None:
        self._files = files

    @classmethod
    def of(cls, pictures: NDArray[Any]) -> Packed:
        """Of pictures, RGB, uint8, shape (N, 288, 384, 3)."""
        return cls([_packed(picture) for picture in pictures])

    @classmethod
    def load(cls, path: Path) -> Packed:
        """What `save` wrote."""
        with np.load(path) as file:
            return cls(np.split(file["bytes"], file["ends"][:-1]))

    def save(self, path: Path) -> None:
        """Write a shard."""
        with path.open("wb") as file:
            np.savez(file, bytes=np.concatenate(self._files), ends=np.cumsum([len(f) for f in self._files]))

    def __len__(self) -> int:
        return len(self._files)

    def file(self, i: int) -> NDArray[Any]:
        """The jpeg of a picture, uint8."""
        return self._files[i]

    def __getitem__(self, i: int) -> NDArray[Any]:
        picture: NDArray[Any] = cv2.cvtColor(cv2.imdecode(self._files[i], cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
        return picture


@dataclass
class Pictures:
    """A set of pictures, opened as memory maps or packed into memory, and the label rows of each."""

    shards: Sequence[NDArray[Any] | Packed]
    labels: list[list[NDArray[Any]]]
    masks: list[list[NDArray[Any]] | None] = field(default_factory=list)

    @classmethod
    def open(cls, folder: Path, name: str) -> Pictures:
        """All finished shards of that name, or of several names with commas between them.

        Raises:
            FileNotFoundError: there are none.
            ValueError: pictures of another size, drawn for a network before this one.
        """
        files = [
            f
            for one in name.split(",")
            for kind in (".npy", JPEGS)
            for f in sorted(folder.glob(f"{one}-[0-9]*{kind}"))
            if ".part" not in f.name
        ]
        if not files:
            raise FileNotFoundError(f"{folder} holds no pictures named {name}-*.npy; make them with render.py")
        packed = {f: Packed.load(f) for f in files if f.suffix == JPEGS}  # a shard that is listed twice is kept once
        shards = [packed[f] if f in packed else np.load(f, mmap_mode="r") for f in files]
        for file, shard in zip(files, shards, strict=True):
            if shard[0].shape != (HEIGHT, WIDTH, 3):
                high, wide = shard[0].shape[:2]
                raise ValueError(f"{file} holds pictures of {wide} x {high}, not {WIDTH} x {HEIGHT}: draw them anew")
        sizes = {f: len(shard) for f, shard in zip(files, shards, strict=True)}
        read = {f: read_labels(f.with_suffix(".npz"), count) for f, count in sizes.items()}
        return cls(shards, [read[f][0] for f in files], [read[f][1] for f in files])

    def pack(self) -> Pictures:
        """The same, read once and kept in memory (some 35 kB a picture); a shard that is listed twice is kept once."""
        packed: dict[str, Packed] = {}
        for shard in self.shards:
            if isinstance(shard, np.memmap) and str(shard.filename) not in packed:
                packed[str(shard.filename)] = Packed.of(shard)
        shards = [packed[str(s.filename)] if isinstance(s, np.memmap) else s for s in self.shards]
        return Pictures(shards, self.labels, self.masks)

    def __len__(self) -> int:
        return sum(len(shard) for shard in self.shards)

    def index(self) -> NDArray[Any]:
        """(shard, picture) of each picture, shape (N, 2)."""
        return np.array([(s, i) for s, shard in enumerate(self.shards) for i in range(len(shard))])

    def picture(self, shard: int, i: int) -> NDArray[Any]:
        """RGB, uint8, shape (288, 384, 3)."""
        return self.shards[shard][i]

    def jpeg(self, shard: int, i: int) -> NDArray[Any]:
        """The file of a picture as it is packed, uint8."""
        held = self.shards[shard]
        return held.file(i) if isinstance(held, Packed) else _packed(held[i])

    def view(self, shard: int, i: int) -> View | None:
        """The picture with its rows and its mask; None where the set has no masks."""
        held = self.masks[shard]
        if held is None:
            return None
        return View(self.picture(shard, i), self.labels[shard][i], cv2.imdecode(held[i], cv2.IMREAD_GRAYSCALE))


def read_labels(file: Path, count: int) -> tuple[list[NDArray[Any]], list[NDArray[Any]] | None]:
    """Rows of each picture of a shard, and the png of its mask; None for a set of before there were masks."""
    with np.load(file) as held:
        rows = held["boxes"]
        masks = np.split(held["masks"], held["mask_ends"][:-1]) if "masks" in held else None
    if masks is None:  # perhaps of before there was even the contrast
        rows = np.pad(rows, ((0, 0), (0, max(len(COLUMNS) - 1 - rows.shape[1], 0))), constant_values=255)
        rows = np.pad(rows, ((0, 0), (0, len(COLUMNS) - rows.shape[1])))
    return [rows[column(rows, "picture") == i] for i in range(count)], masks


def pack_masks(masks: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Masks of a shard, shape (N, 288, 384), as arrays for its file: each a png.

    A pixel's value is the actor's number (from 1, column `mask` of its row; a pet has a number and no row), or
    `FURNITURE` and more for what else stands there, 0 for nothing that is labelled.
    """
    return join_masks([cv2.imencode(".png", mask, [cv2.IMWRITE_PNG_COMPRESSION, 4])[1] for mask in masks])


def join_masks(files: list[NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Masks that are pngs already, as arrays for a shard's file."""
    return {"masks": np.concatenate(files), "mask_ends": np.cumsum([len(file) for file in files])}


def asked(rows: NDArray[Any]) -> NDArray[Any]:
    """Whether a network is asked to find each: not the hardly visible, nor what is too dark or small to make out."""
    big = column(rows, "pixels") > np.where(column(rows, "distance") > 4.0, 150, 400)
    height = column(rows, "y1") - column(rows, "y0")
    clear = (column(rows, "light") > 6.0) & (column(rows, "contrast") > FAINT)
    findable: NDArray[Any] = big & (column(rows, "seen_of_part") > 0.25) & clear & (height > 0.05)
    return findable


def sureness(rows: NDArray[Any]) -> NDArray[Any]:
    """How sure a network is to be of each row at most: less of a person who hides, or of whom the edge leaves little.

    Of the boxes that are false, those surer than most right ones are of the wrong size on such people; so no box on
    them is to be worth as much as one on somebody who shows.
    """
    shown = [np.clip((column(rows, name) - low) / (high - low), 0.0, 1.0) for name, (low, high) in SHOWS.items()]
    return np.where(column(rows, "kind") == 0, HIDDEN + (1.0 - HIDDEN) * np.min(shown, axis=0), 1.0)


def batch_of(
    pictures: Pictures, chosen: NDArray[Any], rng: np.random.Generator | None
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Pictures uint8 (B, 288, 384, 3) and rows (batch, kind, centre x, y, width, height [px], sureness).

    Args:
        pictures: the set.
        chosen: (shard, picture) of each, shape (B, 2).
        rng: to mix with others of the set, to lay patterns over, to mirror and to shift colours by chance; None for
            none of it.

    Sureness is that of `sureness`, 0 for who is not `asked` for.
    """
    images = np.empty((len(chosen), HEIGHT, WIDTH, 3), np.uint8)
    boxes = []
    for b, (shard, i) in enumerate(chosen):
        view = pictures.view(shard, i) if rng is not None else None
        if view is not None and rng is not None:
            view = _mixed(view, pictures, rng)
            picture, rows = view.picture, view.rows
        else:
            picture, rows = pictures.picture(shard, i), pictures.labels[shard][i]
        x0, y0, x1, y1 = (column(rows, k) for k in ("x0", "y0", "x1", "y1"))
        if view is None and rng is not None and rng.random() < OVERLAY:
            corners = np.stack([x0 * WIDTH, y0 * HEIGHT, x1 * WIDTH, y1 * HEIGHT], axis=1)
            picture = lay_patterns(picture, corners, rng)
        images[b] = picture
        if rng is not None:
            if rng.random() < 0.5:
                images[b] = cv2.flip(images[b], 1)
                x0, x1 = 1 - x1, 1 - x0
            images[b] = _recolour(images[b], rng)
        centre = [(x0 + x1) / 2 * WIDTH, (y0 + y1) / 2 * HEIGHT]
        size = [(x1 - x0) * WIDTH, (y1 - y0) * HEIGHT]
        sure = asked(rows) * sureness(rows)
        boxes.append(np.stack([np.full(len(rows), b), column(rows, "kind"), *centre, *size, sure], axis=1))
    return images, np.concatenate(boxes).astype(np.float32)


def _mixed(view: View, pictures: Pictures, rng: np.random.Generator) -> View:
    if rng.random() < OVERLAY:
        view = repaper(view, rng)
    if rng.random() < MIX:
        shard = int(rng.integers(len(pictures.shards)))
        donor = pictures.view(shard, int(rng.integers(len(pictures.shards[shard]))))
        if donor is not None:
            view = mix(view, donor, rng)
    view = disguise(view, rng)
    return zoom(view, rng) if rng.random() < ZOOM else view


def _packed(picture: NDArray[Any]) -> NDArray[Any]:
    jpeg: NDArray[Any] = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 96])[1]
    return jpeg


def _recolour(picture: NDArray[Any], rng: np.random.Generator) -> NDArray[Any]:
    if rng.random() < 0.4:
        return picture
    levels = np.arange(256, dtype=np.float32)
    gains = np.exp(rng.normal(0, 0.15)) * (1 + rng.normal(0, 0.06, 3))
    tables = [np.clip(levels * gain + rng.normal(0, 4), 0, 255).astype(np.uint8) for gain in gains]
    if rng.random() < 0.1:
        picture = picture[..., rng.permutation(3)].copy()
    recoloured: NDArray[Any] = cv2.LUT(picture, np.stack(tables, axis=-1)[None])
    return recoloured
