"""foxglove: all topics live in Foxglove or Lichtblick, by foxglove-sdk; what nobody looks at is not read.

    rosrun rosbot_patrol foxglove          # then open ws://localhost:8765 with config/foxglove_layout.json

Messages pass as ROS 1 has them on the wire. Nobody can send anything to the robot this way.
"""

from __future__ import annotations

import importlib
import logging
import threading
import time
from dataclasses import dataclass
from typing import Any

import roslib.message
import rospy

from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import param
from rosbot_patrol.ros.runtime.node import load_params, run_node

log = logging.getLogger(__name__)

_PERIOD = 2.0  # [s] between two looks for new topics
_BUFFER = 1 << 24  # [bytes] of a message, for maps


@dataclass(frozen=True, kw_only=True)
class FoxgloveParams:
    """Parameters of the node foxglove."""

    address: str = param("127.0.0.1", doc="address to listen on; whoever reaches it sees every topic")
    port: int = param(8765, lo=0, hi=65535, doc="TCP port; 0: any")


class _Topic:
    """One topic, subscribed to while somebody looks."""

    def __init__(self, name: str, channel: Any) -> None:
        self.name, self.channel = name, channel
        self._viewers = 0
        self._lock = threading.Lock()
        self._subscriber: rospy.Subscriber | None = None
        self._latched: dict[str, bytes] = {}  # of each publisher

    def look(self, change: int) -> None:
        """Count viewers that come or go. A latched message is repeated for who comes later."""
        with self._lock:
            self._viewers = max(self._viewers + change, 0)
            if self._viewers and self._subscriber is None:
                self._subscriber = rospy.Subscriber(
                    self.name, rospy.AnyMsg, self._take, queue_size=10, buff_size=_BUFFER, tcp_nodelay=True
                )
            elif not self._viewers and self._subscriber is not None:
                self._subscriber.unregister()
                self._subscriber = None
                self._latched.clear()
            latched = list(self._latched.values()) if change > 0 else []
        for data in latched:
            self._log(data)

    def _take(self, message: Any) -> None:
        header = getattr(message, "_connection_header", None) or {}
        data = bytes(message._buff)
        if header.get("latching") == "1":
            self._latched[header.get("callerid", "")] = data
        self._log(data)

    def _log(self, data: bytes) -> None:
        self.channel.log(data, log_time=rospy.Time.now().to_nsec())


class FoxgloveNode:
    """The server, and a thread that looks for topics."""

    def __init__(self) -> None:
        params = load_params(FoxgloveParams)
        try:
            self._foxglove = importlib.import_module("foxglove")
        except ImportError as err:
            raise ParamError("foxglove-sdk", f"is not installed ({err}): run scripts/bootstrap") from err
        self._topics: dict[str, _Topic] = {}
        self._by_channel: dict[int, _Topic] = {}
        self._early: dict[int, int] = {}  # viewers of a channel that is advertised, and not in _by_channel yet
        self._lock = threading.Lock()  # of those two
        self._unknown: set[str] = set()
        try:
            self._server = self._foxglove.start_server(
                name="rosbot_patrol", host=params.address, port=params.port, server_listener=self
            )
        except RuntimeError as err:
            raise ParamError(
                rospy.get_name() + "/port", f"{params.address}:{params.port} cannot be used: {err}"
            ) from err
        log.info("open ws://%s:%d in Foxglove or Lichtblick", params.address, self._server.port)
        rospy.set_param("~url", f"ws://{params.address}:{self._server.port}")

    def run(self) -> None:
        """Serve until shutdown."""
        while not rospy.is_shutdown():
            self._follow_topics()
            time.sleep(_PERIOD)
        self._server.stop()

    def on_subscribe(self, _client: Any, channel: Any) -> None:
        """Called by the server when somebody looks at a topic."""
        self._look(channel.id, 1)

    def on_unsubscribe(self, _client: Any, channel: Any) -> None:
        """Called by the server when somebody looks at a topic no more."""
        self._look(channel.id, -1)

    def __getattr__(self, name: str) -> Any:
        """What else a client may ask for has no effect."""
        if name.startswith("on_"):
            return lambda *_: None
        raise AttributeError(name)

    def _look(self, channel: int, change: int) -> None:
        with self._lock:
            topic = self._by_channel.get(channel)
            if topic is None:
                self._early[channel] = self._early.get(channel, 0) + change
                return
        topic.look(change)

    def _follow_topics(self) -> None:
        try:
            published = rospy.get_published_topics()
        except (OSError, rospy.ROSException) as err:
            log.warning("the topics are not known: %s", err)
            return
        for name, kind in published:
            if name in self._topics or kind in self._unknown:
                continue
            try:
                made = roslib.message.get_message_class(kind)
            except (ImportError, ValueError):
                made = None
            if made is None:
                self._unknown.add(kind)
                log.warning("%s is left out: the type %s is not known here", name, kind)
                continue
            definition = str(made._full_text).encode()  # noqa: SLF001 - genpy's only way to the whole definition
            schema = self._foxglove.Schema(name=kind, encoding="ros1msg", data=definition)
            topic = _Topic(name, self._foxglove.Channel(name, message_encoding="ros1", schema=schema))
            self._topics[name] = topic
            number = topic.channel.id()
            with self._lock:
                self._by_channel[number] = topic
                early = self._early.pop(number, 0)
            if early > 0:  # a viewer who is there already may answer before the channel has an entry
                topic.look(early)


def main() -> None:
    """Run the node."""
    run_node("foxglove", lambda: FoxgloveNode().run(), by_hand=True)
