"""An outbox that refuses no notice: what the disk does not take leaves from memory, and is written once it can be."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from rosbot_patrol.alerts.dispatch.delivery import Clocks
from rosbot_patrol.alerts.dispatch.spare_post import SparePost
from rosbot_patrol.alerts.outbox.disk_watch import DiskWatch
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox
from rosbot_patrol.alerts.outbox.receipts import Receipts
from rosbot_patrol.files import DISK_FULL

log = logging.getLogger(__name__)

RETRY = 5.0  # [s] between attempts while the disk takes nothing
PROBE = 30.0  # [s] between tests of a disk that takes everything
RECENT = 50  # notices of this program that stay in memory, too, until they are delivered
RECENT_PERIOD = 2.0  # [s] between two looks at their files


class SafeOutbox:
    """The outbox as one program uses it, with its own memory behind the disk. Several threads may put.

    Args:
        outbox: on the disk.
        receipts: on the disk.
        spare: sends from memory.
        disk: hears whether the disk takes what is written.
        clocks: time.
        on_failure: hears of each failure of the disk, on any thread.
        on_spare: hears that something new is to be sent from memory, on any thread.

    Attributes:
        is_stuck: nothing can be delivered from the disk, since the lock cannot be used; set by the owner.
    """

    def __init__(
        self,
        outbox: Outbox,
        receipts: Receipts,
        spare: SparePost,
        disk: DiskWatch,
        *,
        clocks: Clocks,
        on_failure: Callable[[OSError], None],
        on_spare: Callable[[], None],
    ) -> None:
        self._outbox, self._receipts, self._spare, self._disk = outbox, receipts, spare, disk
        self._clocks, self._on_failure, self._on_spare = clocks, on_failure, on_spare
        self._recent: dict[str, Notice] = {}  # put on the disk by this program, and not known to be delivered
        self._putting = threading.Lock()
        self._probed = self._minded = float("-inf")
        self.is_stuck = False

    @property
    def is_written(self) -> bool:
        """Whether every notice that was put is on the disk."""
        return all(notice_id in self._recent for notice_id in self._spare.ids)

    @property
    def is_disk_full(self) -> bool:
        """Whether notices wait for room on the disk."""
        error = self._disk.error
        return not self.is_written and error is not None and error.errno in DISK_FULL

    def has(self, notice_id: str) -> bool:
        """Whether a notice of this id waits or was delivered, as far as memory and disk can tell."""
        if self._spare.find(notice_id) is not None:
            return True
        try:
            return self._outbox.has(notice_id)
        except OSError as err:
            self.failed(err)
            return False

    def find(self, notice_id: str) -> Notice | None:
        """A notice that waits or was delivered, None if there is none. Raises OSError, ValueError."""
        return self._spare.find(notice_id) or self._outbox.find(notice_id)

    def put(self, notice: Notice) -> bool:
        """Keep a notice until it is delivered.

        If the disk does not take it, it is sent from memory, and written as soon as that can be.

        Returns:
            Whether it is on the disk.
        """
        with self._putting:
            if self._spare.find(notice.id) is not None:
                return False
            try:
                self._outbox.put(notice)
            except OSError as err:
                place = self._outbox.folder
                log.error("notice %s cannot be written to %s: %s; it is sent from memory", notice.id, place, err)
                self.failed(err)
                self._send_from_memory(notice)
                return False
            self._recent[notice.id] = notice
            while len(self._recent) > RECENT:
                self._recent.pop(next(iter(self._recent)))
        return True

    def failed(self, err: OSError) -> None:
        """Note that the disk did not take or give something."""
        self._disk.failed(err, self._clocks.now(), self._clocks.wall())
        self._on_failure(err)

    def save(self) -> bool:
        """Write what is in memory only; if nothing is, test the disk now and then.

        Returns:
            Whether the disk took something.

        Raises:
            OSError: the disk does not take it.
        """
        waits = len(self._spare) or self._disk.error is not None
        now = self._clocks.now()
        if now - self._probed < (RETRY if waits else PROBE):
            return False
        self._probed = now
        if self.is_stuck:
            self._spare.write_receipts(self._receipts)
        elif not len(self._spare):
            self._outbox.probe()
        elif not self._settle():
            self._probed += 1.0 - RETRY  # a channel is busy
            return False
        return True

    def watch_recent(self) -> None:
        """Send this program's notices from memory if their files are gone or cannot be delivered. Raises OSError."""
        if self._clocks.now() - self._minded < RECENT_PERIOD:
            return
        self._minded = self._clocks.now()
        with self._putting:
            recent = list(self._recent.values())
        for notice in recent:
            waits = None if self.is_stuck else self._outbox.waits(notice.id)
            if not waits and not self.is_stuck:  # it was delivered, or is gone
                with self._putting:
                    self._recent.pop(notice.id, None)
            if waits is None and self._spare.find(notice.id) is None:
                place = self._outbox.folder
                log.error("notice %s cannot be delivered from %s: it is sent from memory", notice.id, place)
                self._send_from_memory(notice)

    def _send_from_memory(self, notice: Notice) -> None:
        self._spare.put(notice)
        self._on_spare()

    def _settle(self) -> bool:
        count = len(self._spare)
        with self._putting:
            if not self._spare.settle(self._outbox, self._receipts):
                return False
        place = self._outbox.folder
        log.warning("the disk takes notices again: %d that were in memory are in %s now", count, place)
        return True
