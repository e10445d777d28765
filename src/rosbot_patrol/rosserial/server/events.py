"""What the bytes of a device mean to the server's side of rosserial (`session`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from rosbot_patrol.rosserial.protocol.topics import TopicId, TopicInfo


@dataclass(frozen=True)
class Announced:
    """A topic that the policy allows; answer with `Session.reject` where it cannot be had."""

    kind: TopicId
    info: TopicInfo


class Received(NamedTuple):  # comes by the thousand
    """A message of the device on a topic that it announced."""

    kind: TopicId
    info: TopicInfo
    data: bytes


@dataclass(frozen=True)
class Refused:
    """A topic, or what was sent on none, is not accepted."""

    what: str
    reason: str


@dataclass(frozen=True)
class LogLine:
    """The device logs, level 0 (debug) to 4 (fatal)."""

    level: int
    text: str


@dataclass(frozen=True)
class TimeAsked:
    """The device asks for the time; answer with `Session.answer_time`."""


@dataclass(frozen=True)
class ParamAsked:
    """The device asks for a parameter that it may know; answer with `Session.answer_param`."""

    name: str


@dataclass(frozen=True)
class Garbled:
    """Bytes came that are no frame; told once a connection, with what is wrong where they look like one."""

    sample: bytes
    fault: str = ""


@dataclass(frozen=True)
class SyncLost:
    """Nothing was heard for some time; the topics are asked for again."""

    seconds: float


@dataclass(frozen=True)
class Proven:
    """The device has the key of that sensor."""

    sensor_id: int


@dataclass(frozen=True)
class HangUp:
    """The connection is not worth keeping.

    Attributes:
        is_refusal: a stranger is turned away, which is said once and not at each of its attempts.
    """

    reason: str
    is_refusal: bool = False


Event = Announced | Received | Refused | LogLine | TimeAsked | ParamAsked | Garbled | SyncLost | Proven | HangUp
