"""Reactions to a device's events: messages go to the handler, answers to the device, refusals to the log."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Protocol

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.protocol.topics import TopicId, TopicInfo, param_values
from rosbot_patrol.rosserial.server.admission import Door
from rosbot_patrol.rosserial.server.client import Client
from rosbot_patrol.rosserial.server.complaints import printable
from rosbot_patrol.rosserial.server.events import (
    Announced,
    Event,
    Garbled,
    HangUp,
    LogLine,
    ParamAsked,
    Proven,
    Received,
    Refused,
    SyncLost,
    TimeAsked,
)
from rosbot_patrol.rosserial.server.journal import Journal
from rosbot_patrol.rosserial.server.policy import Policy


class Handler(Protocol):
    """Source and destination of messages; called on the server's thread, must not block."""

    def open(self, client: Client, kind: TopicId, info: TopicInfo) -> None:
        """A topic or service is announced; raises ProtocolError if it is not available."""

    def receive(self, client: Client, kind: TopicId, info: TopicInfo, data: bytes) -> None:
        """A message arrived; raises ProtocolError if it is invalid."""

    def flush(self) -> None:
        """No more messages for now: pass on those received, before the device is answered."""

    def tick(self) -> None:
        """A quarter of a second has passed."""

    def closed(self, client: Client) -> None:
        """The client has gone, with all its topics."""

    def time(self) -> tuple[int, int]:
        """Time for devices: seconds, nanoseconds."""

    def device_log(self, client: Client, level: int, text: str) -> None:
        """The device logs something, level 0 (debug) to 4 (fatal)."""

    def parameter(self, name: str) -> object:
        """Value of a parameter; raises ProtocolError if it is not set."""


class Dispatcher:
    """Handles the events of all clients of a server.

    Args:
        handler: the other side.
        policy: what devices may do.
        door: admission; journal: log about clients.
        hang_up: ends a connection, with the reason to log; None: already logged.
        on_new_sensor: called when a client first speaks for a sensor.
    """

    def __init__(
        self,
        handler: Handler,
        policy: Policy,
        door: Door,
        journal: Journal,
        *,
        hang_up: Callable[[Client, str | None], None],
        on_new_sensor: Callable[[Client], None],
    ) -> None:
        self._handler = handler
        self._policy = policy
        self._door = door
        self._journal = journal
        self._hang_up = hang_up
        self._on_new_sensor = on_new_sensor
        self._names: set[str] = set()

    def take(self, client: Client, events: list[Event], now: float) -> None:
        """Handle the events of a client's session."""
        for event in events:
            if client.closed:
                return
            try:
                self._event(client, event, now)
            except ProtocolError as err:
                client.session.dropped += 1
                self._journal.refuse(client, f"a message: {err}", now)

    def _event(self, client: Client, event: Event, now: float) -> None:
        if isinstance(event, Received):
            if not client.session.accepts(event):  # meanwhile refused, in the same piece of data
                return
            if client.note_message(event.info.md5, event.data):
                self._on_new_sensor(client)
            self._handler.receive(client, event.kind, event.info, event.data)
        elif isinstance(event, Announced):
            self._announce(client, event, now)
        elif isinstance(event, TimeAsked):
            client.session.answer_time(*self._handler.time())
        elif isinstance(event, LogLine):
            self._device_log(client, event, now)
        elif isinstance(event, ParamAsked):
            client.session.answer_param(param_values(self._handler.parameter(event.name)))
        elif isinstance(event, Refused):
            self._journal.refuse(client, f"{event.what}: {event.reason}", now)
        elif isinstance(event, Garbled):
            if self._journal.is_new((client.address, "garbled"), now):
                fault = f" ({event.fault})" if event.fault else ""
                self._journal.say(
                    client, logging.WARNING, now, "bytes that are no frame, skipped: %s%s", event.sample.hex(" "), fault
                )
        elif isinstance(event, SyncLost):
            self._journal.say(
                client, logging.WARNING, now, "silent for %.0f s, asking for its topics again", event.seconds
            )
        elif isinstance(event, Proven):
            self._proven(client, event, now)
        elif isinstance(event, HangUp) and event.is_refusal:
            self._journal.refuse(client, event.reason, now)
            self._hang_up(client, None)
        elif isinstance(event, HangUp):
            self._hang_up(client, f"hung up on: {event.reason}")

    def _proven(self, client: Client, proof: Proven, now: float) -> None:
        sensor_id = proof.sensor_id
        if self._door.prove(client, sensor_id):
            self._journal.say(client, logging.INFO, now, "proved to be sensor %d", sensor_id)
            if not proof.is_signed and self._journal.is_new((client.address, "unsigned", sensor_id), now):
                told = "sensor %d has older firmware: what it says is not signed (docs/sensors.md, Keys)"
                self._journal.say(client, logging.WARNING, now, told, sensor_id)
        else:
            self._journal.refuse(client, f"one more connection of sensor {sensor_id}; is its key known to others?", now)
            self._hang_up(client, None)

    def _announce(self, client: Client, event: Announced, now: float) -> None:
        name = event.info.name.lstrip("/")
        try:
            if event.kind == TopicId.PUBLISHER and self._has_all_names(name):
                made = count_of(len(self._names), "topic has", "topics have")
                raise ProtocolError("", f"publisher {name!r}: {made} been made already")
            self._handler.open(client, event.kind, event.info)
        except ProtocolError as err:
            client.session.reject(event.kind, event.info)
            self._journal.refuse(client, str(err), now)
            return
        if event.kind == TopicId.PUBLISHER:
            self._names.add(name)
        self._door.settle(client)
        what = f"{event.kind.name.lower().replace('_', ' ')} {event.info.name} [{event.info.message_type}]"
        if self._journal.is_new((client.address, what), now):
            self._journal.say(client, logging.INFO, now, "%s", what)

    def _has_all_names(self, name: str) -> bool:
        return name not in self._names and len(self._names) >= self._policy.max_names

    def _device_log(self, client: Client, event: LogLine, now: float) -> None:
        text = event.text
        if self._policy.restricted:
            if not self._journal.may_speak(client.address, now):
                return
            text = printable(text)
        self._handler.device_log(client, event.level, text)
