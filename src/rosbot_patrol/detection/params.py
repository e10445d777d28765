"""Parameters of the node darknet_ros; names and defaults as upstream's, ours after them."""

from __future__ import annotations

import os
from dataclasses import dataclass, field

from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class CameraTopic:
    """Where pictures come from."""

    topic: str = param("/camera/image_raw", doc="picture topic, its base name where `image_transport` is not raw")
    queue_size: int = param(1, lo=1, doc="read for compatibility; only the newest picture is ever kept")


@dataclass(frozen=True, kw_only=True)
class Subscribers:
    """Inputs."""

    camera_reading: CameraTopic = field(default_factory=CameraTopic)


@dataclass(frozen=True, kw_only=True)
class FoundObject:
    """The topic that counts boxes."""

    topic: str = param("found_object", doc="number of boxes of each picture")
    queue_size: int = param(1, lo=1)
    latch: bool = param(False)


@dataclass(frozen=True, kw_only=True)
class BoundingBoxes:
    """The topic with the boxes."""

    topic: str = param("bounding_boxes", doc="boxes of a picture in which something is seen")
    queue_size: int = param(1, lo=1)
    latch: bool = param(False)


@dataclass(frozen=True, kw_only=True)
class DetectionImage:
    """The topic with the drawn picture."""

    topic: str = param("detection_image", doc="picture with its boxes drawn, sent only while somebody listens")
    queue_size: int = param(1, lo=1)
    latch: bool = param(True)


@dataclass(frozen=True, kw_only=True)
class Publishers:
    """Outputs."""

    object_detector: FoundObject = field(default_factory=FoundObject)
    bounding_boxes: BoundingBoxes = field(default_factory=BoundingBoxes)
    detection_image: DetectionImage = field(default_factory=DetectionImage)


@dataclass(frozen=True, kw_only=True)
class ActionName:
    """The action's name."""

    topic: str = param("check_for_objects", doc="name of the action")
    name: str = param("", doc="stands in many files and is not read, by upstream neither")


@dataclass(frozen=True, kw_only=True)
class Actions:
    """Actions."""

    camera_reading: ActionName = field(default_factory=ActionName)


@dataclass(frozen=True, kw_only=True)
class ImageView:
    """What a person in front of it sees."""

    enable_opencv: bool = param(True, doc="a window with the boxes, where there is a display")
    wait_key_delay: int = param(3, unit="ms", doc="read for compatibility, as upstream")
    enable_console_output: bool = param(False, doc="print rate and objects, once a second at most")
    use_darknet: bool = param(False, doc="read for compatibility, as upstream")


@dataclass(frozen=True, kw_only=True)
class FileName:
    """A file's name."""

    name: str = param("", doc="name of the file in its folder; where neither folder is given, of our own network")


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """The threshold."""

    value: float = param(0.3, lo=0.0, hi=1.0, doc="least objectness, and least probability of a class")


@dataclass(frozen=True, kw_only=True)
class DetectionClasses:
    """The classes."""

    names: list[str] = param([], doc="names of the network's classes; where empty, of the .names file beside the cfg")


@dataclass(frozen=True, kw_only=True)
class YoloModel:
    """The network."""

    config_file: FileName = field(default_factory=FileName)
    weight_file: FileName = field(default_factory=FileName)
    threshold: Threshold = field(default_factory=Threshold)
    detection_classes: DetectionClasses = field(default_factory=DetectionClasses)


@dataclass(frozen=True, kw_only=True)
class DarknetParams:
    """Parameters of darknet_ros."""

    subscribers: Subscribers = field(default_factory=Subscribers)
    publishers: Publishers = field(default_factory=Publishers)
    actions: Actions = field(default_factory=Actions)
    image_view: ImageView = field(default_factory=ImageView)
    yolo_model: YoloModel = field(default_factory=YoloModel)
    weights_path: str = param("", doc="folder of the weights file")
    config_path: str = param("", doc="folder of the network file")
    network: str = param("darknet", choices=("darknet", "hog"), doc="hog: OpenCV's people detector, without any files")
    image_transport: str = param("raw", choices=("raw", "compressed"), doc="how pictures come in")
    publish_empty: bool = param(False, doc="send bounding_boxes also of pictures in which nothing is seen")
    enabled: bool = param(True, doc="look from the start; the service ~enable switches it")
    max_rate: float = param(0.0, unit="Hz", lo=0.0, doc="most pictures looked at in a second, 0 for all")
    standby_after: float = param(
        0.0,
        unit="s",
        lo=0.0,
        doc="look only while no other detector on the same topics was heard for so long; 0: always",
    )
    threads: int = param(1, lo=1, doc="cores that the network may use")
    camera_timeout: float = param(2.0, unit="s", lo=0.1, doc="a camera silent for longer has stopped (wall time)")
    frozen_timeout: float = param(10.0, unit="s", lo=0.0, doc="pictures the same for longer are a fault, 0 for never")

    def network_files(self, own_models: str) -> tuple[str, str]:
        """Paths of cfg and weights; without any folder given our own network in `own_models`."""
        model = self.yolo_model
        if not (self.weights_path or self.config_path or model.config_file.name or model.weight_file.name):
            return os.path.join(own_models, "house.cfg"), os.path.join(own_models, "house.weights")
        cfg = os.path.join(self.config_path or own_models, model.config_file.name or "yolov2-tiny.cfg")
        weights = os.path.join(self.weights_path or own_models, model.weight_file.name or "yolov2-tiny.weights")
        return cfg, weights
