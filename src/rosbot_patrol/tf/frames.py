"""What a node's core needs of tf; `ros.runtime.transforms.Transforms` and `tf.tree.TransformTree` give it."""

from __future__ import annotations

from typing import Protocol

from rosbot_patrol.geometry import Pose2D, Transform

NO_FRAME = "set header.frame_id in its driver; a ROSbot's firmware before 0.14 leaves it empty"


class Frames(Protocol):
    """Transforms between named frames; a name may carry tf1's leading slash."""

    def transform(self, target: str, source: str, stamp: float | None = None) -> Transform:
        """Look up `target_from_source` in space at a time [s], the newest for None.

        Raises:
            TransformError: it is not known, or not at that time.
        """

    def lookup(self, target: str, source: str, stamp: float | None = None) -> Pose2D:
        """Look up the planar part of `transform`; raises as that does."""

    def lookup_stamped(self, target: str, source: str) -> tuple[Pose2D, float]:
        """Look up the newest `target_from_source` and its stamp [s], 0 if nothing between them moves.

        Raises:
            TransformError: it is not known.
        """
