"""The rosserial bridge over a bag: one Session per recorded connection, fed with the original bytes.

The bag has them if serial_node ran with `~record_bytes` (topic `~bytes`, rosbot_patrol/SerialBytes). The lists decide
about topics and types; whether ROS knows a type is not checked. A device's proof by a key cannot be replayed, because
the challenge was different.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Collection
from typing import Any, NamedTuple

from rosbot_patrol.replay.bags.definitions import STAMP as HEADER
from rosbot_patrol.replay.bags.records import Kind, stamp_of
from rosbot_patrol.replay.results.comparison import Field
from rosbot_patrol.replay.results.tables import STAMP, Result, Rows
from rosbot_patrol.replay.runner import Input
from rosbot_patrol.rosserial.protocol.topics import TopicId
from rosbot_patrol.rosserial.server.events import (
    Announced,
    Event,
    Garbled,
    HangUp,
    LogLine,
    ParamAsked,
    Received,
    Refused,
    SyncLost,
    TimeAsked,
)
from rosbot_patrol.rosserial.server.policy import Policy
from rosbot_patrol.rosserial.server.session import Session

OPENED, DATA, CLOSED = 0, 1, 2  # rosbot_patrol/SerialBytes
TICK_S = 0.5  # period of checks for missing messages

INPUTS = (Input(name="serial_node/bytes", types=("rosbot_patrol/SerialBytes",)),)
FIELDS = {
    "messages.rows": Field(),
    "events.rows": Field(is_by_order=True),
    f"events.{STAMP}": Field(tolerance=TICK_S, unit="s"),
    "events.text": Field(tolerance=math.inf),  # wording; kind and peer are compared
}


class BytesRecord(NamedTuple):
    """rosbot_patrol/SerialBytes: time [s], event, connection, peer address, bytes."""

    stamp: float
    event: int
    peer: str
    address: str
    data: bytes


def _bytes(message: Any) -> BytesRecord:
    stamp = stamp_of(message.header.stamp)
    return BytesRecord(stamp, int(message.event), message.peer, message.address, bytes(message.data))


KINDS: dict[str, Kind] = {
    "rosbot_patrol/msg/SerialBytes": Kind(
        _bytes, HEADER | {"event": "int", "peer": "string", "address": "string", "data": "int[]"}
    )
}


class SerialReplay:
    """Sessions of a bridge.

    Args:
        policy: the devices' permissions.
        silence_timeout: silence after which a device is disconnected [s].
    """

    inputs = INPUTS
    kinds = KINDS

    def __init__(self, policy: Policy, silence_timeout: float | None) -> None:
        self._policy, self._silence = policy, silence_timeout
        self._sessions: dict[str, Session] = {}
        self._next_tick = -math.inf
        names = "connections", "bytes", "messages", "answers", "garbled", "refused", "hang_ups", "unopened"
        self._counts = dict.fromkeys(names, 0)
        self._messages = Rows(STAMP, "peer", "topic", "size", "digest")
        self._events = Rows(STAMP, "peer", "kind", "text")

    def begin(self, names: Collection[str]) -> None:
        """Ignore the list of inputs: there is only one."""

    def hear(self, name: str, now: float, content: BytesRecord) -> None:
        """Process an event of a connection."""
        self._tick(now)
        if content.event == OPENED:
            self._open(content, now)
        elif content.event == CLOSED:
            self._sessions.pop(content.peer, None)
        elif content.peer in self._sessions:
            self._receive(content, now)
        else:
            self._counts["unopened"] += 1  # it began before the bag, or was closed by us

    def finish(self) -> Result:
        """Messages of the devices, other events, and counts of received and answered messages."""
        tables = {"messages": self._messages.table(), "events": self._events.table()}
        return Result("serial_node", counts=self._counts, tables=tables)

    def _open(self, content: BytesRecord, now: float) -> None:
        self._counts["connections"] += 1
        session = Session(self._policy, now, address=content.address, silence_timeout=self._silence)
        self._sessions[content.peer] = session
        self._answer(session)

    def _receive(self, content: BytesRecord, now: float) -> None:
        session = self._sessions[content.peer]
        self._counts["bytes"] += len(content.data)
        self._take(content.peer, session, session.receive(content.data, now), now)
        session.pause(now)

    def _tick(self, now: float) -> None:
        if now < self._next_tick:
            return
        self._next_tick = now + TICK_S
        for peer, session in list(self._sessions.items()):
            self._take(peer, session, session.tick(now), now)

    def _take(self, peer: str, session: Session, events: list[Event], now: float) -> None:
        for event in events:
            if isinstance(event, Received):
                self._counts["messages"] += 1
                digest = hashlib.sha256(event.data).hexdigest()[:12]
                self._messages.add(now, peer, event.info.name, len(event.data), digest)
                continue
            self._note(peer, event, now)
            if isinstance(event, TimeAsked):
                session.answer_time(math.floor(now), round((now % 1.0) * 1e9) % 10**9)
            elif isinstance(event, HangUp):
                self._sessions.pop(peer, None)
        self._answer(session)

    def _note(self, peer: str, event: Event, now: float) -> None:
        for kind, name in ((Garbled, "garbled"), (Refused, "refused"), (HangUp, "hang_ups")):
            self._counts[name] += isinstance(event, kind)
        self._events.add(now, peer, type(event).__name__, _said(event))

    def _answer(self, session: Session) -> None:
        self._counts["answers"] += len(session.take_output())


def _said(event: Event) -> str:
    """An event as one line of text."""
    match event:
        case Announced():
            return f"{TopicId(event.kind).name.lower()} {event.info.name} {event.info.message_type}"
        case Refused():
            return f"{event.what}: {event.reason}"
        case LogLine():
            return event.text
        case ParamAsked():
            return event.name
        case HangUp():
            return event.reason
        case SyncLost():
            return f"{event.seconds:.1f} s"
        case Garbled():
            return event.sample.hex()
    return ""
