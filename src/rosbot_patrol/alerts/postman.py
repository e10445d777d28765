"""Brings the mails of an outbox to their transport, one at a time, from any number of threads that put some in."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from rosbot_patrol.alerts.mail import Envelope, build_mail
from rosbot_patrol.alerts.notice import Notice
from rosbot_patrol.alerts.outbox import Entry, Outbox
from rosbot_patrol.alerts.transports import DeliveryError, Transport

log = logging.getLogger(__name__)

LOOK_AGAIN = 60.0  # [s]


@dataclass(frozen=True, kw_only=True)
class Delivery:
    """What became of a mail: delivered to `location`, or put off or set aside; `text` says so."""

    id: str
    delivered: bool
    location: str = ""
    text: str


class Postman:
    """Owns an outbox and its transport.

    Args:
        outbox: mails on disk.
        transport: how they leave.
        envelope: whom they go to.
        clock: monotonic time [s].
    """

    def __init__(
        self, outbox: Outbox, transport: Transport, envelope: Envelope, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._outbox, self.transport, self._envelope = outbox, transport, envelope
        self._clock = clock
        self._lock = threading.Lock()

    def __len__(self) -> int:
        with self._lock:
            return len(self._outbox)

    @property
    def place(self) -> str:
        """The outbox's folder."""
        return str(self._outbox.folder)

    def has(self, mail_id: str) -> bool:
        """Whether a mail of this id waits or was delivered."""
        with self._lock:
            return self._outbox.has(mail_id)

    def put(self, notice: Notice) -> None:
        """Keep a notice until it is delivered. Raises OSError."""
        with self._lock:
            self._outbox.put(notice.id, build_mail(notice, self._envelope))

    def wait(self) -> float | None:
        """How long until something is due [s], None where nothing waits."""
        with self._lock:
            return self._outbox.wait(self._clock())

    def pause(self) -> float:
        """How long until `deliver` may have something to do [s], a minute where nothing waits."""
        wait = self.wait()
        return LOOK_AGAIN if wait is None else wait + 0.01

    def deliver(self) -> Delivery | None:
        """Deliver what is due now, None where nothing is; waits for the transport. Raises OSError."""
        with self._lock:
            entry = self._outbox.due(self._clock())
        if entry is None:
            return None
        try:
            mail = entry.mail()
        except FileNotFoundError:
            with self._lock:
                self._outbox.forget(entry)
            return self._failed(entry, f"{entry.path} is gone from the outbox")
        except (OSError, ValueError) as err:
            with self._lock:
                aside = self._outbox.set_aside(entry)
            return self._failed(entry, f"{entry.path} cannot be sent ({err}), set aside as {aside}")
        try:
            location = self.transport.send(entry.id, mail)
        except DeliveryError as err:
            with self._lock:
                delay = self._outbox.failed(entry, self._clock(), permanent=err.permanent)
            return self._failed(entry, f"{err}; the mail stays in {entry.path}, next try in {delay:.0f} s")
        with self._lock:
            self._outbox.delivered(entry, self._clock())
        text = f"mail {entry.id} delivered by {self.transport.name}: {location}"
        log.info("%s", text)
        return Delivery(id=entry.id, delivered=True, location=location, text=text)

    def _failed(self, entry: Entry, text: str) -> Delivery:
        log.error("%s", text)
        return Delivery(id=entry.id, delivered=False, text=text)
