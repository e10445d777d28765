"""A channel to the owner: its name, its transport, and the notices that it takes."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Waiting
from rosbot_patrol.errors import AlertError


class FailureCause(Enum):
    """Why a transport did not take a notice; each but OTHER has its own advice in the channel test."""

    UNKNOWN_HOST = "unknown host"
    CONNECTION_REFUSED = "connection refused"
    CERTIFICATE = "certificate not trusted"
    NO_TLS = "no TLS"
    NO_STARTTLS = "no STARTTLS"
    LOGIN = "login refused"
    NO_ANSWER = "no answer"
    RECIPIENT = "recipient refused"
    REDIRECT = "redirect"
    UNAUTHORIZED = "unauthorized"
    FORBIDDEN = "forbidden"
    NOT_FOUND = "not found"
    OTHER = "other"


class DeliveryError(AlertError):
    """A transport did not take a notice.

    Args:
        problem: what happened, and where.
        permanent: the fault is this notice's, and others may pass.
        answered: the other side answered and did not want it now; the fault may be this notice's after all.
        delay: pause that the other side asked for [s].
        of_recipient: the fault is the recipient's, whatever the notice is.
        cause: kind of the failure.
    """

    def __init__(
        self,
        problem: str,
        *,
        permanent: bool = False,
        answered: bool = False,
        delay: float | None = None,
        of_recipient: bool = False,
        cause: FailureCause = FailureCause.OTHER,
    ) -> None:
        super().__init__(problem)
        self.permanent, self.answered, self.delay = permanent, answered, delay
        self.of_recipient, self.cause = of_recipient, cause


class Transport(Protocol):
    """Takes notices."""

    name: str

    def describe(self) -> str:
        """Where they go, for people."""

    def send(self, notice: Notice) -> str:
        """Deliver; returns the place (a file, the addresses, an answer). Never hangs. Raises DeliveryError."""


@dataclass(frozen=True, kw_only=True)
class Pace:
    """How fast a channel goes.

    Attributes:
        interval: least time between two messages [s].
        first_delay: delay after the first failure [s]; doubles with each further one.
        max_delay: longest delay [s].
        jitter: part of a delay that is left to chance, so that several robots do not come at once.
    """

    interval: float = 10.0
    first_delay: float = 5.0
    max_delay: float = 900.0
    jitter: float = 0.2


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One way to the owner.

    Attributes:
        name: for people, and in the receipts.
        transport: how notices leave.
        kinds: of notices that it takes; empty: all.
        pace: intervals and delays.
        recipient: its address, for kinds of channels that may have several.
        group: its name in the configuration, if several recipients became a channel each; otherwise "".
    """

    name: str
    transport: Transport
    kinds: tuple[str, ...] = ()
    pace: Pace = field(default_factory=Pace)
    recipient: str = ""
    group: str = ""

    @property
    def names(self) -> frozenset[str]:
        """Its name now, and those that it has with and without other recipients: NAME and NAME:ADDRESS."""
        base = self.group or self.name
        return frozenset((self.name, base, f"{base}:{self.recipient}" if self.recipient else base))

    def takes(self, entry: Waiting) -> bool:
        """Whether a notice is for this channel."""
        if entry.channels:
            return not self.names.isdisjoint(entry.channels)
        return not self.kinds or entry.kind in self.kinds

    def is_beside(self, other: Channel) -> bool:
        """Whether both belong to one channel of the configuration, with several recipients."""
        return self.name != other.name and bool(self.group) and self.group == other.group
