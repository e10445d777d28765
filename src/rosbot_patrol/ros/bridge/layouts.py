"""Layouts of devices' messages: their bytes are checked against the definition and passed on undecoded.

So a text that is not UTF-8, or a number that Python would encode differently, leaves as it came.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import roslib.message
import rospy

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.protocol.topics import TopicInfo

_ARRAY = re.compile(r"^(.+)\[(\d*)\]$")
_SIZES = {"time": 8, "duration": 8, "bool": 1, "byte": 1, "char": 1, "float32": 4, "float64": 8}
_SIZES |= {f"{sign}int{bits}": bits // 8 for sign in ("", "u") for bits in (8, 16, 32, 64)}


class Run(NamedTuple):
    """A sequence of fixed size: `size` in bytes, and the offsets of its bools."""

    size: int
    flags: tuple[int, ...] = ()


class Many(NamedTuple):
    """An array with a length prefix, such as a text: `parts` of each element."""

    parts: tuple[Any, ...]  # Run and Many


Parts = tuple[Any, ...]
_TEXT = Many((Run(1),))


@dataclass(frozen=True)
class Layout:
    """A message type with messages of one fixed size.

    Attributes:
        size: size of a message [bytes]; flags: offsets of its bools.
    """

    size: int
    flags: tuple[int, ...] = ()

    def check(self, data: bytes, info: TopicInfo) -> bytes:
        """Check a message; returns it with each bool set to 0 or 1.

        Raises:
            ProtocolError: the message has another size.
        """
        if len(data) != self.size:
            raise ProtocolError(
                "", f"{info.name}: {count_of(len(data), 'byte')}, a {info.message_type} has {self.size}"
            )
        return _with_clean_flags(data, self.flags)


@dataclass(frozen=True)
class VaryingLayout:
    """A message type with texts or arrays."""

    parts: Parts

    def check(self, data: bytes, info: TopicInfo) -> bytes:
        """Check a message as in `Layout`; raises ProtocolError if the bytes end too early or too late."""
        flags: list[int] = []
        try:
            end = _walk(self.parts, data, 0, flags)
        except struct.error:
            end = -1
        if end != len(data):
            raise ProtocolError(
                "", f"{info.name}: {count_of(len(data), 'byte that is', 'bytes that are')} no {info.message_type}"
            )
        return _with_clean_flags(data, flags)


@cache
def layout(cls: Any) -> Layout | VaryingLayout:
    """Layout in memory of a class's messages."""
    parts = _parts(cls._slot_types)
    if not parts:
        return Layout(0)
    if len(parts) == 1 and isinstance(parts[0], Run):
        return Layout(*parts[0])
    return VaryingLayout(parts)


@cache
def raw_message(cls: Any) -> Any:
    """A class of the same messages for rospy that keeps their bytes in `_buff`."""
    known = {name: getattr(cls, name) for name in ("_type", "_md5sum", "_full_text", "_slot_types")}
    return type(cls.__name__, (rospy.AnyMsg,), {"__slots__": [], **known})


@cache
def raw_service(cls: Any) -> Any:
    """A class of the same service for rospy with messages that keep their bytes."""
    messages = {name: raw_message(getattr(cls, name)) for name in ("_request_class", "_response_class")}
    return type(cls.__name__, (), {"_type": cls._type, "_md5sum": cls._md5sum, **messages})


def raw_from(cls: Any, data: bytes, info: TopicInfo) -> Any:
    """Make a message of `raw_message(cls)` from its bytes.

    Raises:
        ProtocolError: they are not such a message.
    """
    message = raw_message(cls)()
    message._buff = layout(cls).check(data, info)
    return message


def _parts(types: list[str]) -> Parts:
    parts: list[Any] = []
    for name in types:
        for part in _parts_of(name):
            if isinstance(part, Run) and parts and isinstance(parts[-1], Run):
                before = parts.pop()
                part = Run(before.size + part.size, before.flags + tuple(before.size + at for at in part.flags))
            parts.append(part)
    return tuple(parts)


def _parts_of(name: str) -> Parts:
    if array := _ARRAY.match(name):
        element = _parts([array[1]])
        return element * int(array[2]) if array[2] else (Many(element),)
    if name == "string":
        return (_TEXT,)
    if name in _SIZES:
        return (Run(_SIZES[name], (0,) if name == "bool" else ()),)
    cls = roslib.message.get_message_class(name)
    if cls is None:
        raise ProtocolError("", f"message type {name} is not built in this workspace")
    return _parts(cls._slot_types)


def _walk(parts: Parts, data: bytes, at: int, flags: list[int]) -> int:
    """End of the parts that begin at `at`; collects bools. May lie beyond the data; raises struct.error."""
    for part in parts:
        if isinstance(part, Run):
            flags += [at + flag for flag in part.flags]
            at += part.size
        else:
            (count,) = struct.unpack_from("<I", data, at)
            at = _walk_array(part.parts, count, data, at + 4, flags)
    return at


def _walk_array(parts: Parts, count: int, data: bytes, at: int, flags: list[int]) -> int:
    runs = [part for part in parts if isinstance(part, Run) and not part.flags]
    if len(runs) == len(parts):
        return at + count * sum(run.size for run in runs)
    if count > len(data) - at:  # an element has at least one byte
        raise struct.error("too short")
    for _ in range(count):
        at = _walk(parts, data, at, flags)
    return at


def _with_clean_flags(data: bytes, flags: tuple[int, ...] | list[int]) -> bytes:
    if all(data[at] <= 1 for at in flags):
        return data
    changed = bytearray(data)
    for at in flags:
        changed[at] = min(changed[at], 1)
    return bytes(changed)
