"""Detectors by name for `real_people.py`, each with its own threshold, as the node loads them; and their answers."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from people_pictures import Photograph
from people_scores import Answer

from rosbot_patrol.detection.choice import REAL_CAMERAS, NetworkFolders, choose_detector, network_settings
from rosbot_patrol.detection.detector import Detector
from rosbot_patrol.detection.params import DarknetParams
from rosbot_patrol.detection.second_opinion import SecondOpinion
from rosbot_patrol.errors import DetectorError
from rosbot_patrol.images.encodings import Picture
from rosbot_patrol.package_files import package_file, package_folder

NAMES = ("house", "hog", *REAL_CAMERAS)


@dataclass(frozen=True)
class NetworkFinder:
    """Finds networks' files.

    Args:
        folder: with NAME.cfg and NAME.weights of darknet networks (and NAME.names of unknown ones), None for
            darknet_ros's own folders.
    """

    folder: Path | None

    def load(self, name: str, threshold: float | None = None) -> Detector:
        """Load a network with a threshold, by default its own; PatrolError if it is not there."""
        params = self._params(name)
        if threshold is not None:
            value = dataclasses.replace(params.yolo_model.threshold, value=threshold)
            params = dataclasses.replace(params, yolo_model=dataclasses.replace(params.yolo_model, threshold=value))
        return choose_detector(params, _folders()).detector

    def load_pair(self, name: str, second: str) -> Detector:
        """Load a network with another one for a second opinion; PatrolError if one is not there."""
        choice = choose_detector(dataclasses.replace(self._params(name), second_opinion=second), _folders())
        if choice.second != second:
            raise DetectorError("; ".join(choice.passed_over))
        return choice.detector

    def _params(self, name: str) -> DarknetParams:
        given = self.folder / f"{name}.cfg" if self.folder else None
        if given is None or not given.is_file():
            return network_settings(name, DarknetParams(), _folders())
        paths = {"config_path": str(given.parent), "weights_path": str(given.parent)}
        if (given.parent / f"{name}.names").is_file():
            model = DarknetParams().yolo_model
            files = {"config_file": f"{name}.cfg", "weight_file": f"{name}.weights"}
            named = {key: dataclasses.replace(getattr(model, key), name=file) for key, file in files.items()}
            return DarknetParams(yolo_model=dataclasses.replace(model, **named), **paths)
        return dataclasses.replace(network_settings(name, DarknetParams(), _folders()), **paths)


def _folders() -> NetworkFolders:
    return NetworkFolders(own=package_file("models"), darknet=package_folder("darknet_ros"))


def forget(detector: Detector) -> None:
    """Make a detector with a second opinion ask for it again; no picture follows another here."""
    if isinstance(detector, SecondOpinion):
        detector.forget()


def look(detector: Detector, photographs: list[Photograph]) -> list[Answer]:
    """Answers of a detector, each picture by itself."""
    answers = []
    for one in photographs:
        forget(detector)
        boxes = [
            (found.probability, found.xmin, found.ymin, found.xmax, found.ymax)
            for found in detector.detect(Picture(one.pixels, "bgr8"))
            if found.name == "person"
        ]
        answers.append(Answer(one.pixels.shape[0], one.persons, np.array(boxes, dtype=np.float64).reshape(-1, 5)))
    return answers
