"""Choice of the detector from darknet_ros's parameters."""

from __future__ import annotations

import importlib
import logging

from rosbot_patrol.counts import count_of
from rosbot_patrol.detection.detector import Detector, load_detector
from rosbot_patrol.detection.params import DarknetParams

log = logging.getLogger(__name__)


def make_detector(params: DarknetParams, own_models: str) -> Detector:
    """Make the detector that the parameters name; DetectorError if its files are missing or damaged, or do not fit."""
    threshold = params.yolo_model.threshold.value
    if params.network == "hog":
        hog = importlib.import_module("rosbot_patrol.detection.hog")  # brings OpenCV, 98 MB
        found: Detector = hog.HogDetector(threshold=threshold, threads=params.threads)
        log.info("people by %s", found.runtime)
        return found
    cfg, weights = params.network_files(own_models)
    names = params.yolo_model.detection_classes.names
    detector = load_detector(cfg, weights, names, threshold=threshold, threads=params.threads)
    log.info("%s, %s, by %s", cfg, count_of(len(detector.names), "class", "classes"), detector.runtime)
    return detector
