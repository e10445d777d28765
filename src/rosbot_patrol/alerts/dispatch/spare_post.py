"""Delivery of notices that the disk does not take: from memory, by every channel, at once.

Receipts stay in memory, too. When the disk takes something again, `settle` writes first the receipts and then the
notices. So the program that delivers from the disk sends them only to the channels that did not take them yet. If the
process ends before that, the receipts are lost, and the notices that no channel took.
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
        channels: to the owner.
        clocks: time.
        seed: of the jitter.
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
        """Ids of the notices in memory."""
        return [notice.id for notice in self._box.all()]

    def find(self, notice_id: str) -> Notice | None:
        """A notice that is not on the disk yet; None if it is there or unknown."""
        return self._box.find(notice_id)

    def put(self, notice: Notice) -> bool:
        """Take a notice; returns False if it is in memory already."""
        is_new = self._box.put(notice)
        self._dispatcher.refresh()
        return is_new

    def deliver(self, name: str) -> Delivery | None:
        """Send what is due on a channel; waits for the transport. Returns None if nothing was due."""
        with self._sending[name]:
            return self._dispatcher.deliver(name)

    def learn(self, receipt: Receipt) -> None:
        """Note that a channel took something from the disk."""
        self._dispatcher.learn(receipt)

    def pause(self, name: str) -> float:
        """Time until `deliver` may have something to do [s]."""
        return self._dispatcher.pause(name)

    def settle(self, outbox: Outbox, receipts: Receipts) -> bool:
        """Write everything to the disk.

        While a channel is busy with a notice, nobody knows whether it takes it. Then nothing is written.

        Returns:
            Whether nothing is left in memory.

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
        """Write the receipts of what channels took from memory. Raises OSError."""
        added = self._dispatcher.receipts.added
        while added:
            receipts.add(added[0])
            added.pop(0)

    def statuses(self) -> list[ChannelStatus]:
        """States of the channels that have still something to take from memory."""
        return [status for status in self._dispatcher.statuses() if status.waiting]

    def nudge(self) -> None:
        """Try again soon: the network came back."""
        self._dispatcher.nudge()

    def tell_faults(self) -> None:
        """Tell of a channel that is down for long on the others."""
        self._dispatcher.tell_faults()
