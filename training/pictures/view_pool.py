"""Training pictures in the memory of a GPU, with their masks and labels: thousands of views at hand for each step.

A picture with its mask is 442 kB: an accelerator of 80 GB holds 130,000. When it is full, the oldest go.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from training.pictures.labels import COLUMNS, HEIGHT, WIDTH

MOST_ROWS = 8
KEPT = (
    "kind", "x0", "y0", "x1", "y1", "distance", "seen_of_whole", "seen_of_part", "pixels", "light", "contrast", "mask",
)  # fmt: skip
_KEPT_AT = [COLUMNS.index(name) for name in KEPT]
AT = {name: i for i, name in enumerate(KEPT)}


@dataclass(frozen=True)
class Views:
    """Some views on their way into a pool: pictures, masks and rows as it has them."""

    pictures: torch.Tensor
    masks: torch.Tensor
    rows: torch.Tensor

    @classmethod
    def of(cls, pictures: NDArray[Any], masks: Sequence[NDArray[Any]], rows: Sequence[NDArray[Any]]) -> Views:
        """Of a shard; views with more than `MOST_ROWS` rows are left out.

        Args:
            pictures: RGB, uint8, shape (N, 288, 384, 3).
            masks: uint8, shape (288, 384) each.
            rows: of labels of each picture, with all columns of `labels.py`.
        """
        chosen = [i for i, of_one in enumerate(rows) if len(of_one) <= MOST_ROWS]
        padded = np.zeros((len(chosen), MOST_ROWS, len(KEPT)), np.float32)
        for k, i in enumerate(chosen):
            padded[k, : len(rows[i])] = rows[i][:, _KEPT_AT]
        held = np.array([masks[i] for i in chosen], np.uint8).reshape(-1, HEIGHT, WIDTH)
        parts = np.ascontiguousarray(pictures[chosen]), held, padded
        return cls(*(torch.from_numpy(part) for part in parts))

    def pinned(self) -> Views:
        """In memory that a GPU fetches from by itself."""
        return Views(self.pictures.pin_memory(), self.masks.pin_memory(), self.rows.pin_memory())


class ViewPool:
    """Views by their place in it.

    Attributes:
        pictures: RGB, uint8, shape (places, 288, 384, 3).
        masks: as `mixing.View` has them, uint8, shape (places, 288, 384).
        rows: float32, shape (places, MOST_ROWS, columns of `KEPT`); `mask` is 0 where there is no row.
        counts: pixels of each value of a mask, int32, shape (places, 256).
        size: how many places are filled.
        added: how many views ever came.
    """

    def __init__(self, places: int, device: torch.device) -> None:
        self.pictures = torch.empty((places, HEIGHT, WIDTH, 3), dtype=torch.uint8, device=device)
        self.masks = torch.empty((places, HEIGHT, WIDTH), dtype=torch.uint8, device=device)
        self.rows = torch.zeros((places, MOST_ROWS, len(KEPT)), device=device)
        self.counts = torch.zeros((places, 256), dtype=torch.int32, device=device)
        self.places, self.size, self.added = places, 0, 0

    def add(self, views: Views) -> torch.Tensor:
        """Take views in, no more than there are places.

        Returns:
            The places they came to, shape (N,).
        """
        device = self.rows.device
        count = len(views.rows)
        places = (self.added + torch.arange(count)) % self.places
        places = places.to(device)
        self.pictures[places] = views.pictures.to(device, non_blocking=True)
        masks = views.masks.to(device, non_blocking=True)
        self.masks[places] = masks
        self.rows[places] = views.rows.to(device, non_blocking=True)
        flat = masks.flatten(1).long()
        self.counts[places] = torch.zeros((count, 256), dtype=torch.int32, device=device).scatter_add_(
            1, flat, torch.ones_like(flat, dtype=torch.int32)
        )
        self.added += count
        self.size = min(self.added, self.places)
        return places
