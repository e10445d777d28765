"""Node darknet_ros: detects objects in a camera's pictures.

Matches darknet_ros 1.1.5 (leggedrobotics/darknet_ros 1027a28): parameters, topics, types, action, thresholds, and the
content and time of each message.

Differs:
- Boxes, count and drawn picture carry the stamp of the picture they belong to, and `image_header` its header.
- Each picture is processed once, and only the newest; upstream processes the last one repeatedly.
- rgb8 and bgr8 both have correct colours; upstream swaps those of bgr8.
- The action answers each goal with the boxes of its own picture.
- Of more than 100 boxes the 100 most probable are sent; upstream sends none.
- More encodings (`rosbot_patrol.images.encodings`); upstream takes mono8, mono16, rgb8, bgr8, rgba8 and bgra8.
- Weights or class names that do not fit the network end the node with one sentence; upstream goes on.
- Additional: compressed input (`~image_transport`), `~network` auto, ssdlite and hog, `~publish_empty`, `~max_rate`,
  `~threads`, the service `~enable`, `~standby_after` (replaces another detector that has gone), `~camera_ok`
  (std_msgs/Bool, latched) and /diagnostics, which report a stopped or frozen camera and the network.
- There is no nodelet: Python has none.
"""

from __future__ import annotations

import importlib
import logging
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rospkg
import rospy
from darknet_ros_msgs.msg import BoundingBox, BoundingBoxes, ObjectCount
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse

from rosbot_patrol.detection.choice import Choice, NetworkFolders, choose_detector
from rosbot_patrol.detection.detector import Detection
from rosbot_patrol.detection.params import DarknetParams
from rosbot_patrol.errors import ImageError
from rosbot_patrol.images.encodings import Picture
from rosbot_patrol.ros.detector.action import CheckForObjects
from rosbot_patrol.ros.detector.camera import Camera
from rosbot_patrol.ros.detector.display import display_problem
from rosbot_patrol.ros.detector.running_network import announce
from rosbot_patrol.ros.detector.standby import Standby
from rosbot_patrol.ros.messages.images import picture_to_msg
from rosbot_patrol.ros.runtime import diagnostics
from rosbot_patrol.ros.runtime.node import Worker, load_params, run_node

log = logging.getLogger(__name__)

IDLE_WAIT = 0.25
CONSOLE_PERIOD = 1.0
CONSOLE_REPEAT = 10.0


def main() -> None:
    """Run the node."""
    run_node("darknet_ros", _body)


def _body() -> None:
    params = load_params(DarknetParams)
    packages = rospkg.RosPack()
    own, darknet = (Path(packages.get_path(name)) for name in ("rosbot_patrol", "darknet_ros"))
    choice = choose_detector(params, NetworkFolders(own=own / "models", darknet=darknet))
    DarknetNode(params, choice).run()


def boxes_to_msg(found: Sequence[Detection], image_header: Header) -> BoundingBoxes:
    """Convert the detections of the picture with this header to a message."""
    msg = BoundingBoxes(header=Header(stamp=image_header.stamp, frame_id="detection"), image_header=image_header)
    msg.bounding_boxes = [
        BoundingBox(
            probability=one.probability,
            xmin=one.xmin,
            ymin=one.ymin,
            xmax=one.xmax,
            ymax=one.ymax,
            id=one.class_id,
            Class=one.name,
        )
        for one in found
    ]
    return msg


class DarknetNode:
    """The node darknet_ros: one detector and its topics; `step` processes one picture.

    Args:
        params: its parameters.
        choice: a detector that is ready to run.
    """

    def __init__(self, params: DarknetParams, choice: Choice) -> None:
        self._params = params
        self._detector = choice.detector
        self._enabled = params.enabled
        self._wake = threading.Condition()
        self._health = diagnostics.Health()
        self._report_network(choice)
        self._console = _Console() if params.image_view.enable_console_output else None
        self._window = self._open_window()
        self._advertise()
        self._standby = Standby(_private(params.publishers.object_detector.topic), params.standby_after, self._health)
        self._action = CheckForObjects(rospy.resolve_name(_private(params.actions.camera_reading.topic)), self._notify)
        self._camera = Camera(
            _private(params.subscribers.camera_reading.topic),
            transport=params.image_transport,
            timeout=params.camera_timeout,
            frozen_timeout=params.frozen_timeout,
            health=self._health,
            notify=self._notify,
        )
        rospy.Service("~enable", SetBool, self._on_enable)

    def run(self) -> None:
        """Process pictures until shutdown; the window needs the main thread."""
        worker = Worker(self._work, name="detection")
        worker.start()
        if self._window is not None:
            self._window.run()
        while worker.is_alive() and not rospy.is_shutdown():
            worker.join(0.2)

    def step(self) -> bool:
        """Answer one goal or process the newest picture; returns whether there was anything to do."""
        goal = self._action.take()
        if goal is not None:
            self._answer(goal)
            return True
        message = self._camera.take()  # also while switched off, so that an old picture is not processed later
        if not self._standby.is_wanted() or message is None or not self._enabled:
            return False
        started = time.monotonic()
        try:
            picture = self._camera.decode(message)
            found = self._detector.detect(picture)
        except ImageError as err:
            self._camera.refuse(str(err))
            return True
        self._camera.accept()
        self._publish(picture, message.header, found)
        self._report(found, time.monotonic() - started)
        return True

    def _work(self) -> None:
        due = 0.0
        while not rospy.is_shutdown():
            if not self.step():
                self._wait()
            elif self._params.max_rate > 0.0:
                due = max(due + 1.0 / self._params.max_rate, time.monotonic())
                time.sleep(max(due - time.monotonic(), 0.0))

    def _wait(self) -> None:
        with self._wake:
            if not (self._action.pending or self._camera.pending):
                self._wake.wait(IDLE_WAIT)

    def _notify(self) -> None:
        with self._wake:
            self._wake.notify()

    def _advertise(self) -> None:
        out = self._params.publishers
        self._boxes = _publisher(out.bounding_boxes, BoundingBoxes)
        self._count = _publisher(out.object_detector, ObjectCount)
        self._drawn = _publisher(out.detection_image, Image)

    def _answer(self, goal: Any) -> None:
        """Process the picture of an action's goal; as upstream, it is published like a camera's."""
        try:
            picture, header = goal.picture()
            found = self._detector.detect(picture)
        except ImageError as err:
            goal.abort(f"the goal's picture cannot be looked at: {err}")
            return
        boxes = self._publish(picture, header, found)
        goal.finish(boxes)

    def _publish(self, picture: Picture, header: Header, found: Sequence[Detection]) -> BoundingBoxes:
        boxes = boxes_to_msg(found, header)
        if found or self._params.publish_empty:
            self._boxes.publish(boxes)
        self._count.publish(ObjectCount(header=boxes.header, count=len(found)))
        if self._drawn.get_num_connections() or self._window is not None:
            drawn = importlib.import_module("rosbot_patrol.detection.draw").draw_boxes(picture, found)
            if self._drawn.get_num_connections():
                self._drawn.publish(picture_to_msg(drawn, Header(stamp=header.stamp, frame_id="detection_image")))
            if self._window is not None:
                self._window.show(drawn.pixels)
        return boxes

    def _report_network(self, choice: Choice) -> None:
        level = diagnostics.WARN if choice.passed_over else diagnostics.OK
        text = "; ".join([choice.describe(), *choice.passed_over])
        self._health.set("network", level, text, {"network": choice.network, "runtime": choice.detector.runtime})
        announce(choice)  # the patrol looks up what the scores of this network are worth

    def _report(self, found: Sequence[Detection], seconds: float) -> None:
        values = {"milliseconds": f"{seconds * 1e3:.1f}", "objects": len(found), "runtime": self._detector.runtime}
        self._health.set("", diagnostics.OK, "looks at pictures", values)
        if self._console is not None:
            self._console.tell(found, time.monotonic())

    def _on_enable(self, request: SetBoolRequest) -> SetBoolResponse:
        self._enabled = bool(request.data)
        message = "looks at pictures" if self._enabled else "switched off"
        self._health.set("", diagnostics.OK, message)
        log.info("the detector %s", message if self._enabled else "is switched off")
        self._notify()
        return SetBoolResponse(success=True, message=message)

    def _open_window(self) -> Any:
        if not self._params.image_view.enable_opencv:
            return None
        problem = display_problem()
        if problem:
            log.info("no window with the boxes: %s; see the topic detection_image", problem)
            return None
        window = importlib.import_module("rosbot_patrol.ros.detector.window")  # brings OpenCV, 98 MB
        return window.Window(rospy.get_name().strip("/"))


class _Console:
    """Console output of rate and objects: on each change, and at intervals."""

    def __init__(self) -> None:
        self._counted = 0
        self._since: float | None = None
        self._printed: tuple[str, ...] | None = None

    def tell(self, found: Sequence[Detection], now: float) -> None:
        """Count a picture and print if it is due; called for each picture."""
        if self._since is None:
            self._since = now
        self._counted += 1
        seen = tuple(dict.fromkeys(one.name for one in found))
        waited = now - self._since
        if waited < CONSOLE_PERIOD or (seen == self._printed and waited < CONSOLE_REPEAT):
            return
        objects = ", ".join(_by_class(found)) or "nothing"
        print(f"{self._counted / waited:.1f} pictures a second; seen: {objects}", flush=True)
        self._counted, self._since, self._printed = 0, now, seen


def _by_class(found: Sequence[Detection]) -> list[str]:
    """Best probability and count of each class."""
    best: dict[str, list[float]] = {}
    for one in found:
        best.setdefault(one.name, []).append(one.probability)
    return [f"{name} {max(p):.0%}" + (f" and {len(p) - 1} more" if len(p) > 1 else "") for name, p in best.items()]


def _private(name: str) -> str:
    """Resolve a name as upstream does: below the node's own, unless it starts with a slash."""
    return name if name.startswith(("/", "~")) else "~" + name


def _publisher(topic: Any, kind: type) -> rospy.Publisher:
    return rospy.Publisher(_private(topic.topic), kind, queue_size=topic.queue_size, latch=topic.latch)
