"""Interface of a detector, and the detector that runs a darknet network.

Matches darknet_ros: letterbox, thresholds, class-agnostic suppression at IoU 0.4, boxes cropped to the picture, and
boxes under 1 % of its width or height dropped. There is one detection for each class above the threshold, ordered by
class and then by objectness.

Differs: of more than 100 boxes the 100 most probable ones are sent; darknet_ros sends none.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rosbot_patrol.detection.darknet.cfg import read_cfg
from rosbot_patrol.detection.darknet.decode import Candidates, decode
from rosbot_patrol.detection.darknet.layers import NetworkSpec
from rosbot_patrol.detection.darknet.letterbox import Letterbox
from rosbot_patrol.detection.darknet.weights import read_weights
from rosbot_patrol.detection.network import Network, load_network
from rosbot_patrol.errors import DetectorError
from rosbot_patrol.images.encodings import Picture

IOU_THRESHOLD = 0.4
SMALLEST_SHARE = 0.01
MOST_BOXES = 100


@dataclass(frozen=True)
class Detection:
    """One detected object.

    Args:
        class_id: index of its class, from 0; class_name: the name.
        probability: objectness times class, 0 to 1.
        xmin: left edge [px], and so on; inside the picture.
    """

    class_id: int
    name: str
    probability: float
    xmin: int
    ymin: int
    xmax: int
    ymax: int


class Detector(Protocol):
    """Interface of detectors."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its classes."""

    @property
    def runtime(self) -> str:
        """Its run-time, for logs."""

    def detect(self, picture: Picture) -> list[Detection]:
        """Detect objects in one picture.

        Raises:
            ImageError: the picture has no usable encoding.
        """


class DarknetDetector:
    """A darknet network as a detector.

    Args:
        spec: the network, with the run-time that holds its weights in `network`.
        names: of its classes.
        threshold: on objectness and probability, 0 to 1.
    """

    def __init__(self, spec: NetworkSpec, network: Network, names: Sequence[str], *, threshold: float = 0.3) -> None:
        check_names(spec, names)
        self._spec = spec
        self._network = network
        self._names = tuple(names)
        self._threshold = threshold

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its classes."""
        return self._names

    @property
    def runtime(self) -> str:
        """Run-time of the network."""
        return self._network.name

    def detect(self, picture: Picture) -> list[Detection]:
        """Detect objects in one picture; ImageError if it has no colours."""
        found = self.candidates(picture)
        return to_detections(found, self._names, picture.width, picture.height)

    def candidates(self, picture: Picture) -> Candidates:
        """Boxes relative to the picture, after suppression."""
        place = Letterbox(picture.width, picture.height, self._spec.width, self._spec.height)
        values = self._network.run(picture.eight_bits(), place)
        return decode(self._spec.heads, values, place, threshold=self._threshold, iou_threshold=IOU_THRESHOLD)


def load_detector(
    cfg_path: str, weights_path: str, names: Sequence[str], *, threshold: float = 0.3, threads: int = 1
) -> DarknetDetector:
    """Load a network's files and make it ready to run.

    Args:
        cfg_path: darknet's network file.
        weights_path: its weights file.
        names: of its classes; if empty, read from the .names file beside the cfg.
        threshold: on objectness and probability, 0 to 1.
        threads: number of cores it may use.

    Raises:
        DetectorError: a file is missing, damaged or does not fit; says which and what to do.
    """
    spec = read_cfg(cfg_path)
    names = list(names) or read_names(os.path.splitext(cfg_path)[0] + ".names", spec)
    check_names(spec, names)
    network = load_network(spec, read_weights(weights_path, spec), threads=threads)
    return DarknetDetector(spec, network, names, threshold=threshold)


def read_names(path: str, spec: NetworkSpec) -> list[str]:
    """Read class names, one per line.

    Raises:
        DetectorError: there is no such file.
    """
    try:
        with open(path, encoding="utf-8") as file:
            return [line.strip() for line in file if line.strip()]
    except OSError as err:
        raise DetectorError(
            f"{spec.source} tells {spec.classes} classes apart, but no names are given and {path} cannot be read: "
            f"{err.strerror}"
        ) from err


def check_names(spec: NetworkSpec, names: Sequence[str]) -> None:
    """Check the number of names against the network; DetectorError with both counts."""
    if len(names) != spec.classes:
        raise DetectorError(f"{len(names)} class names are given, {spec.source} tells {spec.classes} classes apart")


def to_detections(found: Candidates, names: Sequence[str], width: int, height: int) -> list[Detection]:
    """Detections from candidates, as darknet_ros sends them, for a picture of `width` x `height` [px]."""
    low = np.clip(found.boxes[:, :2] - found.boxes[:, 2:] / 2, 0.0, None)
    high = np.clip(found.boxes[:, :2] + found.boxes[:, 2:] / 2, None, 1.0)
    large = ((high - low) > SMALLEST_SHARE).all(axis=1)  # False for NaN
    pixels = np.array([width, height])
    with np.errstate(invalid="ignore"):
        corners = np.concatenate([low * pixels, high * pixels], axis=1).astype(np.int64)
    # by class, then in the order of the candidates
    hits = np.argwhere(((found.probabilities > 0.0) & large[:, None]).T)
    if len(hits) > MOST_BOXES:
        scores = found.probabilities[hits[:, 1], hits[:, 0]]
        hits = hits[np.sort(np.argsort(-scores, kind="stable")[:MOST_BOXES])]
    return [
        Detection(int(k), names[k], float(found.probabilities[i, k]), *(int(v) for v in corners[i])) for k, i in hits
    ]
