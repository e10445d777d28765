"""What a row of labels says, and the size of the pictures of a set."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

WIDTH, HEIGHT = 384, 288
COLUMNS = (
    "picture", "kind", "x0", "y0", "x1", "y1", "distance", "seen_of_whole", "seen_of_part", "pixels", "light", "test",
    "contrast", "mask",
)  # fmt: skip
_AT = {name: i for i, name in enumerate(COLUMNS)}


def column(rows: NDArray[Any], name: str) -> NDArray[Any]:
    """One column of label rows by its name.

    `kind` is 0 for a person and 1 for a hydrant; x0 to y1 are shares of the picture, `distance` [m] along the floor;
    `seen_of_whole` is the share of the figure's outline that is seen, `seen_of_part` the share of what lies inside the
    picture's edges; `pixels` counts those seen at 640 x 480, `light` is the picture's mean level.
    `contrast` [levels of 255] is by how much the clearer quarter of its outline stands out in the finished picture.
    `mask` is the value of its pixels in the picture's mask, 0 where there is none.
    """
    return rows[:, _AT[name]]
