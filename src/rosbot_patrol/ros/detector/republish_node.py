"""republish: receives pictures in one transport and sends them in another.

    republish IN_TRANSPORT in:=BASE [OUT_TRANSPORT] out:=BASE

Matches image_transport's republish (image_common, noetic-devel) with the transports raw, compressed (jpeg, png) and
compressedDepth (png, rvl): names of topics (`BASE` for raw, `BASE/TRANSPORT`), parameters of a publisher under its
topic (and by dynamic_reconfigure there), of the subscriber under the node, `~image_transport`, anonymous unless named,
always subscribed. Without an out transport it sends every transport that has a subscriber.

Differs: compresses only while there is a subscriber; reports and skips pictures that cannot be decoded; logs what it
waits for; has /diagnostics; does not support theora.
"""

from __future__ import annotations

import logging
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import rospy
from sensor_msgs.msg import CompressedImage, Image

from rosbot_patrol import params as parameters
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ImageError, ParamError
from rosbot_patrol.images.compressed import CompressedParams, compress
from rosbot_patrol.images.compressed_depth import CompressedDepthParams, compress_depth
from rosbot_patrol.images.encodings import Picture
from rosbot_patrol.params import param
from rosbot_patrol.ros.detector.camera import Camera
from rosbot_patrol.ros.messages.images import picture_to_msg
from rosbot_patrol.ros.runtime import diagnostics
from rosbot_patrol.ros.runtime.node import load_params, run_node
from rosbot_patrol.ros.runtime.reconfigure import ReconfigureServer
from rosbot_patrol.tunable import changed

log = logging.getLogger(__name__)

TRANSPORTS = ("raw", "compressed", "compressedDepth")
USAGE = f"usage: republish IN_TRANSPORT in:=BASE [OUT_TRANSPORT] out:=BASE, transports {', '.join(TRANSPORTS)}"
IDLE_WAIT = 0.25
# parameters of upstream's publishers that have no meaning here
FOREIGN_KEYS = ("enable",)


@dataclass(frozen=True, kw_only=True)
class DecoderParams:
    """Parameters of a compressed subscriber, as upstream's."""

    mode: str = param("unchanged", choices=("unchanged", "color", "gray"), doc="decoding of the image")


@dataclass(frozen=True, kw_only=True)
class RepublishParams:
    """Parameters of republish."""

    image_transport: str = param("", doc="transport of the input; replaces the first argument")
    compressed: DecoderParams = field(default_factory=DecoderParams)
    camera_timeout: float = param(
        2.0, unit="s", lo=0.1, doc="silence after which the input counts as stopped (wall time)"
    )


def main() -> None:
    """Run the node."""
    run_node("image_republisher", _body, anonymous=True)


def parse_arguments(arguments: Sequence[str]) -> tuple[str, tuple[str, ...]]:
    """Parse a command line without its remappings: in transport and out transports.

    Raises:
        ParamError: there are too few or too many arguments, or a transport is unknown.
    """
    words = [word for word in arguments if word.strip()]
    if not 1 <= len(words) <= 2:
        raise ParamError("republish", f"got {count_of(len(words), 'argument')}; {USAGE}")
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


class Output:
    """One topic for outgoing pictures, with messages only while there is a subscriber.

    Args:
        topic: its full name.
        kind: type of its messages.
    """

    def __init__(self, topic: str, kind: type) -> None:
        self._publisher = rospy.Publisher(topic, kind, queue_size=1)

    @property
    def is_heard(self) -> bool:
        """Whether there is a subscriber."""
        return bool(self._publisher.get_num_connections())

    def send(self, picture: Picture, message: Image | CompressedImage) -> None:
        """Send a picture with the header of its original message; ImageError if it cannot be encoded."""
        self._publisher.publish(message if isinstance(message, Image) else picture_to_msg(picture, message.header))


class CompressedOutput(Output):
    """A compressed output; its parameters are below its topic, and can be changed at run time.

    Args:
        topic: its full name.
        params: declaration of its parameters.
        codec: encodes a picture to format text and bytes.
    """

    def __init__(self, topic: str, params: type[Any], codec: Callable[[Picture, Any], tuple[str, bytes]]) -> None:
        super().__init__(topic, CompressedImage)
        self._params = parameters.load(params, rospy.get_param(topic, {}), name=topic + "/", ignore=FOREIGN_KEYS)
        self._codec = codec
        self._names = [field.name for field in fields(params)]
        self._topic = topic
        ReconfigureServer(topic, self._params, self._names, self._change)

    def send(self, picture: Picture, message: Image | CompressedImage) -> None:
        """Compress and send a picture; ImageError if it cannot be encoded."""
        text, data = self._codec(picture, self._params)
        self._publisher.publish(CompressedImage(header=message.header, format=text, data=data))

    def _change(self, changes: dict[str, Any]) -> Any:
        self._params = changed(self._params, changes, self._names, name=self._topic + "/")
        return self._params


class Republisher:
    """The node republish: one input, one or more outputs.

    Args:
        params: its parameters.
        source: transport of the input.
        targets: transports of the outputs.
    """

    def __init__(self, params: RepublishParams, source: str, targets: Sequence[str]) -> None:
        base = rospy.resolve_name("out")
        self._outputs = [_make_output(base, target) for target in targets]
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
        """Pass the newest picture on."""
        message = self._input.take()
        heard = [output for output in self._outputs if output.is_heard]
        if message is None or not heard:
            return
        try:
            picture = self._input.decode(message)
            for output in heard:
                output.send(picture, message)
        except ImageError as err:
            self._input.refuse(str(err))
        else:
            self._input.accept()


def _make_output(base: str, transport: str) -> Output:
    if transport == "raw":
        return Output(base, Image)
    topic = f"{base}/{transport}"
    if transport == "compressed":
        return CompressedOutput(topic, CompressedParams, compress)
    return CompressedOutput(topic, CompressedDepthParams, compress_depth)
