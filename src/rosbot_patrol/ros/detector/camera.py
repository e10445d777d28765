"""A camera topic: its newest picture, and a watch for a silent or frozen camera."""

from __future__ import annotations

import importlib
import logging
import threading
import time
from collections.abc import Callable

import rosgraph
import rospy
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Bool

from rosbot_patrol.images.encodings import Picture
from rosbot_patrol.images.stream import Stream, StreamWatch
from rosbot_patrol.ros.messages.images import picture_from_msg
from rosbot_patrol.ros.runtime import diagnostics
from rosbot_patrol.ros.runtime.node import Worker

log = logging.getLogger(__name__)

PART = "camera"
WATCH_PERIOD = 0.5
FIRST_WAIT = 2.0
RATE_WAIT = 1.5
WAIT_REPEAT = 10.0
MOST_NAMED = 5
BUFFER_SIZE = 16 * 2**20


class Camera:
    """Subscribe to a camera, keep its newest unprocessed picture, and report if it is silent or frozen.

    Args:
        topic: base name of the topic.
        transport: raw, compressed or compressedDepth.
        timeout: silence after which the camera counts as stopped [s] of wall time.
        frozen_timeout: time with equal pictures after which it counts as frozen [s] of wall time, 0 for never.
        health: receives the camera's health.
        notify: called when a picture has come.
        once: skip a repeated picture (same stamp), and publish the camera's health on ~camera_ok.
        mode: decoding of compressed pictures: unchanged, color or gray.
    """

    def __init__(
        self,
        topic: str,
        *,
        transport: str,
        timeout: float,
        frozen_timeout: float,
        health: diagnostics.Health,
        notify: Callable[[], None],
        once: bool = True,
        mode: str = "unchanged",
    ) -> None:
        self._kind = Image if transport == "raw" else CompressedImage
        self._transport = transport
        base = rospy.resolve_name(topic)  # as in image_transport, remappings apply to the base name
        self._topic = base if transport == "raw" else f"{base}/{transport}"
        self._lock = threading.Lock()
        self._newest: Image | CompressedImage | None = None
        self._last_stamp = rospy.Time(0)
        self._watch = StreamWatch(timeout, frozen_timeout)
        self._refused = ""
        self._seen = ""
        self._health = health
        self._notify = notify
        self._once = once
        self._mode = mode
        self._ok = rospy.Publisher("~camera_ok", Bool, queue_size=1, latch=True) if once else None
        self._subscriber = rospy.Subscriber(
            self._topic, self._kind, self._on_picture, queue_size=1, buff_size=BUFFER_SIZE, tcp_nodelay=True
        )
        Worker(self._run, name="camera watch").start()

    @property
    def pending(self) -> bool:
        """Whether a picture is waiting."""
        return self._newest is not None

    def take(self) -> Image | CompressedImage | None:
        """Take the newest message, None if it was taken already."""
        with self._lock:
            message, self._newest = self._newest, None
            return message

    def decode(self, message: Image | CompressedImage) -> Picture:
        """Decode a message's picture; ImageError if that fails."""
        picture: Picture
        if not isinstance(message, CompressedImage):
            picture = picture_from_msg(message)
        elif self._transport == "compressedDepth":
            codec = importlib.import_module("rosbot_patrol.images.compressed_depth")
            picture = codec.decompress_depth(message.format, message.data)
        else:
            codec = importlib.import_module("rosbot_patrol.images.compressed")
            picture = codec.decompress(message.format, message.data, mode=self._mode)
        return picture

    def accept(self) -> None:
        """Report that a picture could be processed."""
        self._refused = ""

    def refuse(self, problem: str) -> None:
        """Report that a picture could not be processed; the same reason is logged once."""
        if problem != self._refused:
            log.error("%s: %s", self._topic, problem)
        self._refused = problem

    def _on_picture(self, message: Image | CompressedImage) -> None:
        stamp = message.header.stamp
        with self._lock:
            # the camera's stamp and a sample of the bytes: a frozen driver repeats them
            self._watch.note(time.monotonic(), bytes(message.data[::997]))
            if self._once and stamp == self._last_stamp and not stamp.is_zero():
                return  # a repeated picture
            self._last_stamp = stamp
            self._newest = message
            self._seen = _describe(message)
        self._notify()

    def _run(self) -> None:
        before: Stream | None = None
        seen, flows_since = "", 0.0
        tell = time.monotonic() + FIRST_WAIT
        while not rospy.is_shutdown():
            now = time.monotonic()
            with self._lock:
                state, silent, rate = self._watch.state(now), self._watch.silent_for(now), self._watch.rate
            if state is not before:
                self._changed(state, before, silent)
                before, flows_since = state, now
            if state is Stream.WAITING and now >= tell:
                log.warning("waiting for pictures on %s (%s): %s", self._topic, self._kind._type, self._who_publishes())
                tell = now + WAIT_REPEAT
            if state is Stream.FLOWING and self._seen != seen and now - flows_since >= RATE_WAIT:
                log.info("%s: pictures of %s come in, %.1f a second", self._topic, self._seen, rate)
                seen = self._seen
            self._tell_health(state, silent, rate)
            time.sleep(WATCH_PERIOD)

    def _changed(self, state: Stream, before: Stream | None, silent: float) -> None:
        if self._ok is not None:
            self._ok.publish(Bool(state is Stream.FLOWING))
        if state is Stream.STOPPED:
            log.error("%s: the camera has been silent for %.1f s: %s", self._topic, silent, self._who_publishes())
        elif state is Stream.FROZEN:
            log.error("%s: the camera is frozen, it sends the same picture again and again", self._topic)
        elif before in (Stream.STOPPED, Stream.FROZEN):
            log.info("%s: %s again", self._topic, state.value)

    def _tell_health(self, state: Stream, silent: float, rate: float) -> None:
        values = {
            "topic": self._topic,
            "type": self._kind._type,
            "pictures": self._seen or "none yet",
            "rate": f"{rate:.1f}",
            "seconds since the last picture": f"{silent:.1f}",
        }
        if self._refused:
            self._health.set(PART, diagnostics.ERROR, self._refused, values)
            return
        level = {Stream.WAITING: diagnostics.WARN, Stream.FLOWING: diagnostics.OK}.get(state, diagnostics.ERROR)
        self._health.set(PART, level, state.value, values)

    def _who_publishes(self) -> str:
        """Publisher and type of the topic, or other topics with pictures."""
        try:
            master = rosgraph.Master(rospy.get_name())
            publishers = dict(master.getSystemState()[0])
            kinds = dict(master.getTopicTypes())
        except (OSError, rosgraph.MasterException) as err:
            return f"the master does not say who publishes it ({err})"
        mine, kind = publishers.get(self._topic, []), kinds.get(self._topic, "")
        if mine:
            text = f"published by {', '.join(mine)}"
            if kind not in ("", "*", self._kind._type):
                return f"{text} as {kind}, which is another type"
            return f"{text}, but none has come"
        others = [f"{t} ({kinds[t]})" for t in sorted(publishers) if self._may_be_meant(t, kinds.get(t, ""))]
        return "nobody publishes it" + (f"; there are pictures on {', '.join(others[:MOST_NAMED])}" if others else "")

    def _may_be_meant(self, topic: str, kind: str) -> bool:
        own = topic.startswith(rospy.get_name() + "/")
        return kind in (Image._type, CompressedImage._type) and not own


def _describe(message: Image | CompressedImage) -> str:
    """Size and encoding of a picture, as far as its message states them."""
    if isinstance(message, CompressedImage):
        return f"'{message.format}'"
    return f"{message.width}x{message.height} {message.encoding}"
