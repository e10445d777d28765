"""Notices about a channel's fault, for the other channels."""

from __future__ import annotations

import hashlib
import time

from rosbot_patrol.alerts.channels.channel import Channel
from rosbot_patrol.alerts.dispatch.channel_queue import ChannelQueue
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Waiting
from rosbot_patrol.alerts.safe_text import token
from rosbot_patrol.counts import count_of


def down_notice(channel: Channel, queue: ChannelQueue, oldest: Waiting, others: tuple[str, ...], wall: float) -> Notice:
    """The notice that a channel takes nothing; the same id as long as the same notice is its oldest.

    Args:
        channel: that is down.
        queue: what waits for it.
        oldest: the first that waits.
        others: names of the channels that tell of it.
        wall: now, seconds since 1970.
    """
    when = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(oldest.wall))
    text = (
        f"The channel '{channel.name}' ({channel.transport.describe()}) takes nothing: {queue.error}\n\n"
        f"{count_of(len(queue), 'notice waits', 'notices wait')} for it, the oldest of {when}. "
        f"{'It is' if len(queue) == 1 else 'They are'} kept and tried on."
    )
    return Notice(
        id=f"{oldest.id[:90]}-down-{_mark(channel.name)}",
        wall=wall,
        kind="fault",
        subject=f"rosbot patrol: the channel '{channel.name}' is down",
        text=text,
        channels=others,
    )


def refused_notice(channel: Channel, entry: Waiting, error: str, others: tuple[str, ...], wall: float) -> Notice:
    """The notice that a channel refused one for good; always the same id for the two.

    Args:
        channel: that refused it.
        entry: what it refused.
        error: its words.
        others: names of the channels that tell of it.
        wall: now, seconds since 1970.
    """
    rest = "It is kept and tried again now and then; the others pass."
    if channel.group:
        rest += " What it refused for good is not sent to it again once another recipient has it."
    text = (
        f"The channel '{channel.name}' ({channel.transport.describe()}) refused the notice {entry.id}"
        f" ({entry.kind}): {error}\n\n{rest}"
    )
    return Notice(
        id=f"{entry.id[:90]}-refused-{_mark(channel.name)}",
        wall=wall,
        kind="fault",
        subject=f"rosbot patrol: the channel '{channel.name}' refused a notice",
        text=text,
        channels=others,
    )


def _mark(name: str) -> str:
    """A channel's name as a part of a notice's id."""
    if len(name) <= 40 and token(name) == name:
        return name
    return f"{token(name)[:31]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
