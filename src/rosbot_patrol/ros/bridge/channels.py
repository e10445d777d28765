"""Subscriptions and services of one rosserial device; its publishers are in `bridge.publishers`."""

from __future__ import annotations

import io
import logging
import queue
import threading
from collections.abc import Callable
from typing import Any

import genpy
import roslib.message
import rospy
from rospy.exceptions import TransportException

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.msg import EspTrigger
from rosbot_patrol.ros.bridge.layouts import raw_from, raw_message, raw_service
from rosbot_patrol.ros.runtime.node import Worker
from rosbot_patrol.rosserial.protocol.old_types import find_old_type
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_TYPES, TopicInfo
from rosbot_patrol.rosserial.server.complaints import printable

log = logging.getLogger(__name__)

QUEUE_SIZE = 100
SERVICE_TIMEOUT = 5.0

# Errors that a device, a service or the master can cause in a call: none may end the bridge.
_CALL_ERRORS = (
    ProtocolError,
    rospy.ServiceException,
    rospy.ROSException,
    TransportException,  # the service's program was killed during a call
    genpy.SerializationError,
    OSError,
    ValueError,  # an answer with text that is not UTF-8
)

Send = Callable[[int, bytes], None]


def message_class(message_type: str) -> Any:
    """The class of "package/Type"; raises ProtocolError if it is not built here."""
    if message_type in ESP_TRIGGER_TYPES:
        return EspTrigger  # both names mean the same message, and the other package may be missing
    try:
        found = roslib.message.get_message_class(message_type)
    except (ImportError, ValueError) as err:
        raise ProtocolError("", f"message type {message_type} cannot be loaded: {err}") from err
    if found is None:
        raise ProtocolError("", f"message type {message_type} is not built in this workspace")
    return found


def service_class(service_type: str) -> Any:
    """The class of a service "package/Type"; raises ProtocolError if it is not built here."""
    try:
        found = roslib.message.get_service_class(service_type)
    except (ImportError, ValueError) as err:
        raise ProtocolError("", f"service type {service_type} cannot be loaded: {err}") from err
    if found is None:
        raise ProtocolError("", f"service type {service_type} is not built in this workspace")
    return found


def check_md5(info: TopicInfo, here: Any) -> None:
    """Compare the definitions of device and workspace; raises ProtocolError with both."""
    if info.md5 == here._md5sum:
        return
    if find_old_type(info.message_type, info.md5, here._md5sum):
        log.info("%s: %s as ROS melodic had it, its bytes are rewritten", info.name, info.message_type)
        return
    theirs = printable(info.md5, 32)
    raise ProtocolError(
        "",
        f"{info.name}: checksum of {info.message_type} does not match: here {here._md5sum} ({_definition(here)}), the "
        f"device has {theirs} ({_definition_of(info.md5)}); build its ros_lib from this workspace's messages",
    )


def _definition(cls: Any) -> str:
    return " ".join(getattr(cls, "_full_text", "").split("=" * 20)[0].split("\n"))[:200].strip()


def _definition_of(md5: str) -> str:
    """Definition of a device's message, if this process knows it; the device sends only its sum."""
    classes = [cls for cls in genpy.Message.__subclasses__() if getattr(cls, "_md5sum", "") == md5]
    return f"as {classes[0]._type}: {_definition(classes[0])}" if classes else "a definition not known here"


def serialize(message: Any) -> bytes:
    """Serialise a message to bytes."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


class Subscription:
    """Forwarding of a ROS topic to the device."""

    def __init__(self, info: TopicInfo, send: Send) -> None:
        cls = message_class(info.message_type)
        check_md5(info, cls)
        self._info = info
        self._send = send
        self._has_warned = False
        self._old = find_old_type(info.message_type, info.md5, cls._md5sum)
        self._subscriber = rospy.Subscriber(info.name, raw_message(cls), self._callback, queue_size=QUEUE_SIZE)

    def close(self) -> None:
        """Stop forwarding."""
        self._subscriber.unregister()

    def _callback(self, message: Any) -> None:
        try:
            data: bytes = message._buff
            self._send(self._info.topic_id, self._old.downgrade(data) if self._old else data)
        except ProtocolError as err:
            if not self._has_warned:
                self._has_warned = True
                log.warning("%s; such messages are dropped", err)


class DeviceService:
    """A service that the device offers to ROS: requests go out with one topic id, answers come with another."""

    def __init__(self, info: TopicInfo, send: Send) -> None:
        self._cls = service_class(info.message_type)
        self._info, self._name = info, info.name
        self._send = send
        self._request_id: int | None = None
        self._answers: queue.Queue[Any] = queue.Queue(maxsize=1)
        self._one_at_a_time = threading.Lock()
        self._service: rospy.Service | None = None

    def set_answer_topic(self, info: TopicInfo) -> None:
        """Set the topic of the device's answers; raises ProtocolError."""
        check_md5(info, self._cls._response_class)

    def set_request_topic(self, info: TopicInfo) -> None:
        """Set the topic of requests; from now on ROS can call. Raises ProtocolError."""
        check_md5(info, self._cls._request_class)
        self._request_id = info.topic_id
        if self._service is None:
            self._service = rospy.Service(self._name, raw_service(self._cls), self._call)

    def receive(self, data: bytes) -> None:
        """Take an answer; raises ProtocolError."""
        answer = raw_from(self._cls._response_class, data, self._info)
        if self._answers.empty():
            self._answers.put_nowait(answer)

    def close(self) -> None:
        """Withdraw the service."""
        if self._service is not None:
            self._service.shutdown("the device has gone")

    def _call(self, request: Any) -> Any:
        with self._one_at_a_time:
            while not self._answers.empty():  # an answer that came too late for the previous call
                self._answers.get_nowait()
            if self._request_id is None:
                raise rospy.ServiceException(f"{self._name}: the device has not announced it fully")
            self._send(self._request_id, request._buff)
            try:
                return self._answers.get(timeout=SERVICE_TIMEOUT)
            except queue.Empty as err:
                raise rospy.ServiceException(f"{self._name}: no answer within {SERVICE_TIMEOUT:.0f} s") from err


class ServiceCaller:
    """A ROS service that the device calls; calls wait on a thread of their own, so the device is still read."""

    def __init__(self, info: TopicInfo, send: Send) -> None:
        self._cls = service_class(info.message_type)
        self._info, self._name = info, info.name
        self._send = send
        self._answer_id: int | None = None
        self._requests: queue.Queue[bytes | None] = queue.Queue(maxsize=16)
        self._proxy = rospy.ServiceProxy(info.name, raw_service(self._cls))
        Worker(self._run, name=f"calls {info.name}").start()

    def set_request_topic(self, info: TopicInfo) -> None:
        """Set the topic of the device's requests; raises ProtocolError."""
        check_md5(info, self._cls._request_class)

    def set_answer_topic(self, info: TopicInfo) -> None:
        """Set the topic of answers; raises ProtocolError."""
        check_md5(info, self._cls._response_class)
        self._answer_id = info.topic_id

    def receive(self, data: bytes) -> None:
        """Take a request; raises ProtocolError if too many wait."""
        try:
            self._requests.put_nowait(data)
        except queue.Full as err:
            raise ProtocolError("", f"{self._name}: more than 16 calls wait for an answer") from err

    def close(self) -> None:
        """Stop the thread."""
        try:
            self._requests.put_nowait(None)
        except queue.Full:
            self._requests.get_nowait()
            self._requests.put_nowait(None)

    def _run(self) -> None:
        while (data := self._requests.get()) is not None:
            try:
                answer = self._proxy(raw_from(self._cls._request_class, data, self._info))
                if self._answer_id is not None:
                    self._send(self._answer_id, answer._buff)
            except _CALL_ERRORS as err:
                log.warning("service %s called by a device: %s: %s", self._name, type(err).__name__, err)
