"""The way out for notices that the disk does not take: from memory, by every channel, at once.

What a channel took of them is kept in memory, too. When the disk takes something again, `settle` writes the receipts
first and then the notice: whoever delivers from the disk sends it only to those channels that did not take it yet. What
dies with the process before that is the knowledge of what was taken, and the notices that no channel took.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from contextlib import ExitStack

from rosbot_patrol.alerts.channels.channel import Channel
from rosbot_patrol.alerts.dispatch.delivery import ChannelStatus, Clocks, Delivery
from rosbot_patrol.alerts.dispatch.dispatcher import Dispatcher
from rosbot_patrol.alerts.outbox.memory_outbox import MemoryOutbox
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox
from rosbot_patrol.alerts.outbox.receipts import Receipt, Receipts


class SparePost:
    """Keeps notices in memory and sends them from there.

    Args:
        channels: ways out.
        clocks: time.
        seed: for the jitter.
    """

    def __init__(self, channels: Sequence[Channel], *, clocks: Clocks | None = None, seed: int | None = None) -> None:
        self._box = MemoryOutbox()
        self._dispatcher = Dispatcher(self._box, channels, clocks=clocks, seed=seed)
        self._dispatcher.take_over()
        self._sending = {channel.name: threading.Lock() for channel in channels}

    def __len__(self) -> int:
        return len(self._box)

    @property
    def ids(self) -> list[str]:
        """Of the notices that are here."""
        return [notice.id for notice in self._box.all()]

    def find(self, notice_id: str) -> Notice | None:
        """A notice that is not on the disk yet, None where it is or is not known."""
        return self._box.find(notice_id)

    def put(self, notice: Notice) -> bool:
        """Take a notice; returns False where it is here already."""
        is_new = self._box.put(notice)
        self._dispatcher.refresh()
        return is_new

    def deliver(self, name: str) -> Delivery | None:
        """Send what is due on a channel, None where nothing is; waits for the transport."""
        with self._sending[name]:
            return self._dispatcher.deliver(name)

    def learn(self, receipt: Receipt) -> None:
        """A channel took something from the disk."""
        self._dispatcher.learn(receipt)

    def pause(self, name: str) -> float:
        """How long until `deliver` may have something to do [s]."""
        return self._dispatcher.pause(name)

    def settle(self, outbox: Outbox, receipts: Receipts) -> bool:
        """Bring everything to the disk; returns whether nothing is left here.

        While a channel is busy with a notice, nobody knows whether it takes it: then nothing is brought.

        Raises:
            OSError: the disk does not take it.
        """
        with ExitStack() as stack:
            for lock in self._sending.values():
                if not lock.acquire(blocking=False):
                    return False
                stack.callback(lock.release)
            self.write_receipts(receipts)
            for notice in self._box.all():
                outbox.put(notice)
                self._box.forget(notice.id)
            self._dispatcher.refresh()
        return not len(self._box)

    def write_receipts(self, receipts: Receipts) -> None:
        """Write down what channels took from here. Raises OSError."""
        added = self._dispatcher.receipts.added
        while added:
            receipts.add(added[0])
            added.pop(0)

    def statuses(self) -> list[ChannelStatus]:
        """How the channels do with what they have still to take."""
        return [status for status in self._dispatcher.statuses() if status.waiting]

    def nudge(self) -> None:
        """The network came back."""
        self._dispatcher.nudge()

    def tell_faults(self) -> None:
        """Tell of a channel that is down for long on the others."""
        self._dispatcher.tell_faults()
