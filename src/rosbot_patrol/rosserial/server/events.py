"""Events of the server's side of rosserial, made from a device's bytes (`session`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from rosbot_patrol.rosserial.protocol.topics import TopicId, TopicInfo


@dataclass(frozen=True)
class Announced:
    """A permitted topic; answer with `Session.reject` if it is not available."""

    kind: TopicId
    info: TopicInfo


class Received(NamedTuple):  # there are thousands of these
    """A message of the device on a topic that it announced."""

    kind: TopicId
    info: TopicInfo
    data: bytes


@dataclass(frozen=True)
class Refused:
    """A topic, or a message without one, was refused."""

    what: str
    reason: str


@dataclass(frozen=True)
class LogLine:
    """A log line of the device, level 0 (debug) to 4 (fatal)."""

    level: int
    text: str


@dataclass(frozen=True)
class TimeAsked:
    """The device asks for the time; answer with `Session.answer_time`."""


@dataclass(frozen=True)
class ParamAsked:
    """The device asks for a permitted parameter; answer with `Session.answer_param`."""

    name: str


@dataclass(frozen=True)
class Garbled:
    """Bytes arrived that are no frame; reported once per connection, with the fault of what looks like a frame."""

    sample: bytes
    fault: str = ""


@dataclass(frozen=True)
class SyncLost:
    """Nothing arrived for some time; the topics are requested again."""

    seconds: float


@dataclass(frozen=True)
class Proven:
    """The device has proved that it has the key of that sensor; `is_signed`: and signs each frame from now on."""

    sensor_id: int
    is_signed: bool = False


@dataclass(frozen=True)
class HangUp:
    """The connection should be closed.

    Attributes:
        is_refusal: a stranger is turned away, which is logged once and not at each attempt.
    """

    reason: str
    is_refusal: bool = False


Event = Announced | Received | Refused | LogLine | TimeAsked | ParamAsked | Garbled | SyncLost | Proven | HangUp
