"""darknet_ros over a bag: its detector processes each picture (the node skips those that it is too slow for)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any

from rosbot_patrol.detection.detector import Detector
from rosbot_patrol.errors import ImageError
from rosbot_patrol.replay.bags.picture_records import KINDS, PictureRecord
from rosbot_patrol.replay.results.comparison import Field
from rosbot_patrol.replay.results.tables import STAMP, Result, Rows
from rosbot_patrol.replay.runner import Input

INPUTS = (
    Input(name="camera", topic="camera/rgb/image_raw", types=("sensor_msgs/Image", "sensor_msgs/CompressedImage")),
)
FIELDS = {
    "boxes.probability": Field(tolerance=0.02),
    **{f"boxes.{edge}": Field(tolerance=2, unit="px") for edge in ("xmin", "ymin", "xmax", "ymax")},
}


class DetectorReplay:
    """A detector and its node's processing of a picture.

    Args:
        detector: a detector that is ready to run.
        topic: default topic of the pictures.
    """

    kinds = KINDS

    def __init__(self, detector: Detector, topic: str = INPUTS[0].topic) -> None:
        self._detector = detector
        self.inputs = (replace(INPUTS[0], topic=topic.lstrip("/")),)
        self._boxes = Rows(STAMP, "label", "probability", "xmin", "ymin", "xmax", "ymax")
        self._pictures = Rows(STAMP, "boxes")
        self._refused = 0

    def begin(self, names: Collection[str]) -> None:
        """Ignore the list of inputs: there is only one."""

    def hear(self, name: str, now: float, content: Any) -> None:
        """Process a picture; invalid ones are counted and skipped."""
        if not isinstance(content, PictureRecord):
            self._refused += 1
            return
        try:
            found = self._detector.detect(content.picture)
        except ImageError:
            self._refused += 1
            return
        self._pictures.add(content.stamp, len(found))
        for one in found:
            self._boxes.add(content.stamp, one.name, one.probability, one.xmin, one.ymin, one.xmax, one.ymax)

    def finish(self) -> Result:
        """All boxes, and the number of boxes per picture."""
        counts = {"pictures": len(self._pictures), "refused": self._refused, "boxes": len(self._boxes)}
        tables = {"pictures": self._pictures.table(), "boxes": self._boxes.table()}
        return Result("darknet_ros", counts=counts, tables=tables)
