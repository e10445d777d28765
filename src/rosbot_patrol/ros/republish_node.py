"""The node republish: takes pictures in one transport and sends them in another.

    republish IN_TRANSPORT in:=BASE [OUT_TRANSPORT] out:=BASE

Matches image_transport's republish (image_common, noetic-devel) with the transports raw and compressed: names of topics
(`BASE` for raw, `BASE/compressed`), parameters of the compressed publisher under its topic, of the subscriber under the
node, `~image_transport`, anonymous unless named, always subscribed. Without an out transport it sends both.

Differs: a picture that cannot be read is reported and left out; says what it waits for; /diagnostics.
"""

from __future__ import annotations

import logging
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field

import rospy
from sensor_msgs.msg import CompressedImage, Image

from rosbot_patrol import params as parameters
from rosbot_patrol.errors import ImageError, ParamError
from rosbot_patrol.images.compressed import CompressedParams, compress
from rosbot_patrol.params import param
from rosbot_patrol.ros import diagnostics
from rosbot_patrol.ros.camera import Camera
from rosbot_patrol.ros.convert_images import picture_to_msg
from rosbot_patrol.ros.heap import share_one_heap
from rosbot_patrol.ros.node import load_params, run_node

log = logging.getLogger(__name__)

TRANSPORTS = ("raw", "compressed")
USAGE = "usage: republish IN_TRANSPORT in:=BASE [OUT_TRANSPORT] out:=BASE, transports raw and compressed"
IDLE_WAIT = 0.25
# of compressed_image_transport's publisher: read by rospy's side or without a meaning here
FOREIGN_KEYS = ("enable",)


@dataclass(frozen=True, kw_only=True)
class DecoderParams:
    """Parameters of a compressed subscriber, as upstream's."""

    mode: str = param("unchanged", choices=("unchanged", "color", "gray"), doc="how a picture is decoded")


@dataclass(frozen=True, kw_only=True)
class RepublishParams:
    """Parameters of republish."""

    image_transport: str = param("", doc="transport of the input, in place of the first argument")
    compressed: DecoderParams = field(default_factory=DecoderParams)
    camera_timeout: float = param(2.0, unit="s", lo=0.1, doc="an input silent for longer has stopped (wall time)")


def main() -> None:
    """Run the node."""
    share_one_heap()
    run_node("image_republisher", _body, anonymous=True)


def parse_arguments(arguments: Sequence[str]) -> tuple[str, tuple[str, ...]]:
    """In transport and out transports of a command line without its remappings.

    Raises:
        ParamError: there are too few or too many, or a transport is not known here.
    """
    words = [word for word in arguments if word.strip()]
    if not 1 <= len(words) <= 2:
        raise ParamError("republish", f"got {len(words)} arguments; {USAGE}")
    for word in words:
        if word not in TRANSPORTS:
            raise ParamError("republish", f"the transport '{word}' is not known here; {USAGE}")
    return words[0], (words[1],) if len(words) == 2 else TRANSPORTS


def _body() -> None:
    source, targets = parse_arguments(rospy.myargv(sys.argv)[1:])
    params = load_params(RepublishParams)
    if params.image_transport:
        source, _ = parse_arguments([params.image_transport])
    Republisher(params, source, targets).run()


class Republisher:
    """One input, one or more outputs.

    Args:
        params: its parameters.
        source: transport of the input.
        targets: transports of the outputs.
    """

    def __init__(self, params: RepublishParams, source: str, targets: Sequence[str]) -> None:
        base = rospy.resolve_name("out")
        self._raw = rospy.Publisher(base, Image, queue_size=1) if "raw" in targets else None
        self._compressed = None
        if "compressed" in targets:
            topic = f"{base}/compressed"
            tree = rospy.get_param(topic, {})
            self._codec = parameters.load(CompressedParams, tree, name=topic + "/", ignore=FOREIGN_KEYS)
            self._compressed = rospy.Publisher(topic, CompressedImage, queue_size=1)
        self._wake = threading.Event()
        self._health = diagnostics.Health()
        self._input = Camera(
            rospy.resolve_name("in"),
            transport=source,
            timeout=params.camera_timeout,
            frozen_timeout=0.0,
            health=self._health,
            notify=self._wake.set,
            once=False,
            mode=params.compressed.mode,
        )

    def run(self) -> None:
        """Republish until shutdown."""
        while not rospy.is_shutdown():
            self._wake.wait(IDLE_WAIT)
            self._wake.clear()
            try:
                self.step()
            except rospy.ROSException:
                if not rospy.is_shutdown():
                    raise

    def step(self) -> None:
        """Send the newest picture on."""
        message = self._input.take()
        if message is None:
            return
        try:
            self._send(message)
        except ImageError as err:
            self._input.refuse(str(err))

    def _send(self, message: Image | CompressedImage) -> None:
        picture = self._input.decode(message)
        if self._raw is not None:
            self._raw.publish(message if isinstance(message, Image) else picture_to_msg(picture, message.header))
        if self._compressed is not None:
            text, data = compress(picture, self._codec)
            self._compressed.publish(CompressedImage(header=message.header, format=text, data=data))
