"""Parameters of the node darknet_ros; names and defaults as upstream's, ours after them."""

from __future__ import annotations

import os
from dataclasses import dataclass, field

from rosbot_patrol.params import param

_THRESHOLD = 0.3


@dataclass(frozen=True, kw_only=True)
class CameraTopic:
    """Topic of the images."""

    topic: str = param("/camera/image_raw", doc="image topic; its base name if `image_transport` is not raw")
    queue_size: int = param(1, lo=1, doc="accepted, has no effect: only the newest image is kept")


@dataclass(frozen=True, kw_only=True)
class Subscribers:
    """Inputs."""

    camera_reading: CameraTopic = field(default_factory=CameraTopic)


@dataclass(frozen=True, kw_only=True)
class FoundObject:
    """Topic with the number of boxes."""

    topic: str = param("found_object", doc="number of boxes in each image")
    queue_size: int = param(1, lo=1, doc="length of the publisher's queue")
    latch: bool = param(False, doc="send the last message to new subscribers")


@dataclass(frozen=True, kw_only=True)
class BoundingBoxes:
    """Topic with the boxes."""

    topic: str = param("bounding_boxes", doc="boxes of each image that shows something")
    queue_size: int = param(1, lo=1, doc="length of the publisher's queue")
    latch: bool = param(False, doc="send the last message to new subscribers")


@dataclass(frozen=True, kw_only=True)
class DetectionImage:
    """Topic with the annotated image."""

    topic: str = param("detection_image", doc="image with its boxes drawn, sent only while somebody subscribes")
    queue_size: int = param(1, lo=1, doc="length of the publisher's queue")
    latch: bool = param(True, doc="send the last message to new subscribers")


@dataclass(frozen=True, kw_only=True)
class Publishers:
    """Outputs."""

    object_detector: FoundObject = field(default_factory=FoundObject)
    bounding_boxes: BoundingBoxes = field(default_factory=BoundingBoxes)
    detection_image: DetectionImage = field(default_factory=DetectionImage)


@dataclass(frozen=True, kw_only=True)
class ActionName:
    """Name of the action."""

    topic: str = param("check_for_objects", doc="name of the action")
    name: str = param("", doc="accepted, has no effect, as upstream; present in many files")


@dataclass(frozen=True, kw_only=True)
class Actions:
    """Actions."""

    camera_reading: ActionName = field(default_factory=ActionName)


@dataclass(frozen=True, kw_only=True)
class ImageView:
    """Output for a person at the screen."""

    enable_opencv: bool = param(True, doc="window with the boxes, if there is a display")
    wait_key_delay: int = param(3, unit="ms", doc="accepted, has no effect")
    enable_console_output: bool = param(False, doc="print rate and objects, at most once a second")
    use_darknet: bool = param(False, doc="accepted, has no effect")


@dataclass(frozen=True, kw_only=True)
class FileName:
    """Name of a file."""

    name: str = param("", doc="name of the file in its folder; without both folders, one of our own network")


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """Threshold of detections."""

    value: float = param(
        0.0,
        lo=0.0,
        hi=1.0,
        doc="minimum objectness, and minimum probability of a class; 0: auto takes the network's own, else 0.3",
    )


@dataclass(frozen=True, kw_only=True)
class DetectionClasses:
    """Names of the classes."""

    names: list[str] = param([], doc="names of the network's classes; empty: from the .names file beside the cfg")


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
    network: str = param(
        "darknet",
        choices=("darknet", "auto", "ssdlite", "hog"),
        doc="auto: the best one for a real camera that is ready; ssdlite, hog: people only, without darknet's files",
    )
    second_opinion: str = param(
        "",
        doc="name of a slower network that looks again where the first is unsure of people, or sure for the first time",
    )
    image_transport: str = param("raw", choices=("raw", "compressed"), doc="transport of the images")
    publish_empty: bool = param(False, doc="publish bounding_boxes for images without a detection, too")
    enabled: bool = param(True, doc="detect from the start; the service ~enable switches it")
    max_rate: float = param(0.0, unit="Hz", lo=0.0, doc="maximum rate of images processed; 0: all")
    standby_after: float = param(
        0.0,
        unit="s",
        lo=0.0,
        doc="silence of other detectors on the same topics after which this one starts; 0: always run",
    )
    threads: int = param(1, lo=1, doc="number of cores for the network")
    camera_timeout: float = param(
        2.0, unit="s", lo=0.1, doc="silence after which the camera counts as stopped (wall time)"
    )
    frozen_timeout: float = param(
        10.0, unit="s", lo=0.0, doc="time of unchanging images after which the camera counts as frozen; 0: never"
    )

    @property
    def threshold(self) -> float:
        """The threshold that counts."""
        return self.yolo_model.threshold.value or _THRESHOLD

    def network_files(self, own_models: str) -> tuple[str, str]:
        """Paths of cfg and weights; without any folder, of our own network in `own_models`."""
        model = self.yolo_model
        if not (self.weights_path or self.config_path or model.config_file.name or model.weight_file.name):
            return os.path.join(own_models, "house.cfg"), os.path.join(own_models, "house.weights")
        cfg = os.path.join(self.config_path or own_models, model.config_file.name or "yolov2-tiny.cfg")
        weights = os.path.join(self.weights_path or own_models, model.weight_file.name or "yolov2-tiny.weights")
        return cfg, weights
