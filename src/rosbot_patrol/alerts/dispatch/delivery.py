"""Records of the dispatcher: the outcome of one message, and the state of one channel."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rosbot_patrol.alerts.channels.channel import Channel, DeliveryError
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Waiting
from rosbot_patrol.alerts.outbox.receipts import Receipt

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Clocks:
    """Time of the machine and of the day [s]; tests give their own."""

    now: Callable[[], float] = time.monotonic
    wall: Callable[[], float] = lambda: time.clock_gettime(time.CLOCK_REALTIME)


@dataclass(frozen=True, kw_only=True)
class Delivery:
    """Outcome of one message.

    Attributes:
        channel: name.
        transport: of the channel: smtp, maildir, ...
        ids: of the notices, several for a digest.
        delivered: the channel took it.
        permanent: the channel refused it for good.
        where: its place, for people; "" if it was not taken.
        text: the outcome, for people.
    """

    channel: str
    transport: str
    ids: tuple[str, ...]
    delivered: bool
    permanent: bool = False
    where: str = ""
    text: str


@dataclass(frozen=True, kw_only=True)
class ChannelStatus:
    """State of one channel.

    Attributes:
        name: of the channel.
        describe: where it goes.
        waiting: number of notices that it has still to take.
        since: time of the oldest of them, seconds since 1970; None if none waits.
        refused: number of them that it refused for good.
        down_for: time for which it has not taken what it should [s]; None if it takes everything.
        error: its last words, "" where all is well.
        next_try: time to the next attempt [s]; None if none waits.
        refusal: why it refused the last notice for good, "" if it took that.
    """

    name: str
    describe: str
    waiting: int
    since: float | None
    refused: int
    down_for: float | None
    error: str
    next_try: float | None
    refusal: str = ""


def send(channel: Channel, notice: Notice) -> str:
    """Send a notice; waits for the transport.

    Returns:
        Its place, for people.

    Raises:
        DeliveryError: the channel did not take it, or has a defect that this notice brings out.
    """
    try:
        return channel.transport.send(notice)
    except DeliveryError:
        raise
    except Exception as err:  # a defect that one notice brings out must not hold up the others
        log.error("channel '%s' stumbled over notice %s", channel.name, notice.id, exc_info=True)
        raise DeliveryError(f"the channel stumbled over it: {err!r}", permanent=True) from err


def title_of(batch: Sequence[Waiting]) -> str:
    """The notices of one message, for people."""
    return f"notice {batch[0].id}" if len(batch) == 1 else f"a digest of {len(batch)} notices"


def delivery_of(receipt: Receipt) -> Delivery:
    """The outcome that a receipt of another program tells."""
    became = f"refused for good by '{receipt.channel}': {receipt.refused}"
    if not receipt.refused:
        became = f"delivered by {receipt.transport}: {receipt.where}"
    return Delivery(
        channel=receipt.channel,
        transport=receipt.transport,
        ids=receipt.ids,
        delivered=not receipt.refused,
        permanent=bool(receipt.refused),
        where=receipt.where,
        text=f"notice {', '.join(receipt.ids)} {became}",
    )
