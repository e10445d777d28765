"""The dispatcher brings what waits in the outbox to the channels. Of all programs that could, one does at a time.

The holder of the outbox's lock delivers for all programs. The system takes the lock back when that program ends, and
the next one that asks has it. A program that hangs loses the lock to the next one after a while without a sign of life.
If it goes on, it sees that before it sends anything more.

A notice is crossed out for a channel once that took it. After a crash or a hang between the two, the notice goes to
that channel again, with the same id (as Message-ID, file name or idempotency key).
"""

from __future__ import annotations

import logging
import random
import threading
from collections.abc import Sequence

from rosbot_patrol.alerts.channels.channel import Channel, DeliveryError
from rosbot_patrol.alerts.dispatch.channel_queue import ChannelQueue
from rosbot_patrol.alerts.dispatch.delivery import ChannelStatus, Clocks, Delivery, send, title_of
from rosbot_patrol.alerts.dispatch.fault_notices import down_notice, refused_notice
from rosbot_patrol.alerts.dispatch.file_lock import STALE, FileLock, NoLock
from rosbot_patrol.alerts.dispatch.status_file import write_status
from rosbot_patrol.alerts.outbox.digest import merge
from rosbot_patrol.alerts.outbox.memory_outbox import MemoryOutbox
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox, Waiting
from rosbot_patrol.alerts.outbox.receipts import Receipt, Receipts

log = logging.getLogger(__name__)


class Dispatcher:
    """Owns the channels, and delivers while it holds the lock.

    Args:
        outbox: notices on disk, or this process's own in memory.
        channels: to the owner.
        who: name of this process, for people.
        clocks: time.
        seed: of the jitter.
        down_after: time after which a channel that is down is told on the others [s].
        stale_after: time without a sign of life after which another process takes over [s].
    """

    def __init__(
        self,
        outbox: Outbox | MemoryOutbox,
        channels: Sequence[Channel],
        *,
        who: str = "",
        clocks: Clocks | None = None,
        seed: int | None = None,
        down_after: float = 1800.0,
        stale_after: float = STALE,
    ) -> None:
        self.outbox = outbox
        self.channels = {channel.name: channel for channel in channels}
        self._clocks = clocks or Clocks()
        self.receipts = Receipts(None)
        self.lock: FileLock | NoLock = NoLock()
        if isinstance(outbox, Outbox):
            self.receipts = Receipts(outbox.folder / "taken.jsonl")
            self.lock = FileLock(outbox.folder / "lock", who, stale_after=stale_after, clock=self._clocks.now)
        self._rng = random.Random(seed)
        self._down_after, self._stale_after = down_after, stale_after
        self._queues: dict[str, ChannelQueue] = {}
        self._unwritten: list[Receipt] = []
        self._waiting: list[Waiting] = []
        self._guard = threading.RLock()

    @property
    def is_delivering(self) -> bool:
        """Whether this process is the one that delivers."""
        return self.lock.is_held and bool(self._queues)

    @property
    def has_trouble(self) -> bool:
        """Whether a channel does not take what it should."""
        with self._guard:
            return any(queue.down_since is not None for queue in self._queues.values())

    def take_over(self) -> bool:
        """Take the lock if nobody has it or its holder hangs; give a sign of life if this process has it.

        Call it again and again.

        Returns:
            Whether this process delivers.

        Raises:
            OSError: the disk does not take it, or files cannot be locked there.
        """
        with self._guard:
            self._mind_the_lock()
            if self.is_delivering:
                self.lock.beat()
                return True
            self.outbox.make()
            if not self.lock.take():
                return False
            if self.lock.seized_from:
                who, silent = self.lock.seized_from, self._stale_after
                log.error("%s, which delivered the notices, gave no sign of life for %.0f s: taking over", who, silent)
            self._read_receipts()
            now, wall = self._clocks.now(), self._clocks.wall()
            for name, channel in self.channels.items():
                ago = max(wall - self.receipts.last.get(name, float("-inf")), 0.0)
                self._queues[name] = ChannelQueue(channel.pace, self._rng, last=now - ago)
            self.refresh()
            self.receipts.compact(entry.id for entry in self._waiting)
            return True

    def hand_over(self) -> None:
        """Stop delivering and give the lock back."""
        with self._guard:
            self._queues.clear()
            self.lock.release()

    def refresh(self) -> None:
        """Look at what waits on disk; for the process that delivers. Raises OSError."""
        with self._guard:
            before = {entry.name for entry in self._waiting}
            self._waiting = self.outbox.waiting()
            self._read_receipts()  # after the look at the folder, as others write receipts before the notice
            for name, queue in self._queues.items():
                self._offer(name)
                if any(entry.name not in before for entry in self._waiting):
                    queue.nudge(self._clocks.now())
            self._write_receipts()  # after the queues, which do without the disk
            self._settle_refusals()
            self._finish()
            self.outbox.tidy()

    def learn(self, receipt: Receipt) -> None:
        """Note that notices went to a channel past this object."""
        with self._guard:
            self.receipts.note(receipt)
            if queue := self._queues.get(receipt.channel):
                queue.offer(e for e in self._waiting if self._is_open(e, receipt.channel))

    def deliver(self, name: str) -> Delivery | None:
        """Send what is due on a channel; waits for the transport.

        Returns:
            The outcome, None if nothing was due.

        Raises:
            OSError: the disk cannot be read.
        """
        with self._guard:
            self._mind_the_lock()
            queue = self._queues.get(name)
            batch = queue.due(self._clocks.now()) if queue else []
            if not queue or not batch:
                return None
            notice = self._compose(batch)
        if notice is None:
            self.refresh()
            return None
        channel = self.channels[name]
        try:
            where = send(channel, notice)
        except DeliveryError as err:
            return self._note_failure(channel, queue, batch, err)
        return self._note_success(channel, queue, batch, where)

    def pause(self, name: str, most: float = 60.0) -> float:
        """Time until `deliver` may have something to do, `most` at most [s]."""
        with self._guard:
            queue = self._queues.get(name)
            wait = queue.wait(self._clocks.now()) if queue else None
        return most if wait is None else min(wait + 0.01, most)

    def nudge(self, *, all_: bool = False) -> None:
        """Try again soon, as the network came back; with `all_` at once and refused notices too, as somebody asked."""
        with self._guard:
            for queue in self._queues.values():
                queue.nudge(self._clocks.now(), all_=all_)

    def statuses(self) -> list[ChannelStatus]:
        """States of the channels; for the process that delivers."""
        with self._guard:
            return [self._status(name, queue) for name, queue in self._queues.items()]

    def tell_faults(self) -> None:
        """Tell of a channel that is down for long, or refuses a notice for good, on the others. Raises OSError."""
        with self._guard:
            for name, queue in self._queues.items():
                others = self._others(name)
                if not others:
                    continue
                if queue.oldest is not None and self._is_down(name):
                    self._tell(down_notice(self.channels[name], queue, queue.oldest, others, self._clocks.wall()))
                for entry, error in queue.refused:
                    self._tell_refused(name, entry, error, others)

    def write_status(self) -> None:
        """Leave the states of the channels for other programs. Raises OSError."""
        write_status(self.outbox.folder, wall=self._clocks.wall(), who=self.lock.holder(), channels=self.statuses())

    # -- inside

    def _mind_the_lock(self) -> None:
        """Deliver no more if another process took over while this one hung, or if the lock's file was removed."""
        if not self.lock.is_lost:
            return
        if holder := self.lock.holder():
            log.error("this program hung: %s delivers now", holder)
        else:
            log.error("%s was removed, by which others know who delivers: making it anew", self.lock.path)
        self.hand_over()

    def _read_receipts(self) -> None:
        try:
            self.receipts.read_new()
        except OSError as err:  # a notice twice is better than none
            log.error("%s cannot be read: %s; what was taken before may be sent again", self.receipts.path, err)

    def _is_open(self, entry: Waiting, name: str) -> bool:
        channel = self.channels[name]
        return channel.takes(entry) and channel.names.isdisjoint(self.receipts.done(entry.id))

    def _offer(self, name: str) -> None:
        self._queues[name].offer(e for e in self._waiting if self._is_open(e, name))

    def _what_next(self, name: str, ids: tuple[str, ...], put_off: float, err: DeliveryError) -> str:
        try:
            self._settle_refusals()
            self._finish()
        except OSError as problem:
            log.error("that '%s' refused %s cannot be written down: %s; trying on", name, ", ".join(ids), problem)
        if all(name in self.receipts.refused.get(notice_id, ()) for notice_id in ids):
            return " for good, and not tried there again"
        rest = " for good; it stays in" if err.permanent else "; it waits in"
        return f"{rest} {self.outbox.folder}, next try in {put_off:.0f} s"

    def _settle_refusals(self) -> None:
        """Give up a notice for a recipient that refused it for good, once another of the same channel has it."""
        if self._unwritten:  # the disk takes nothing: what is known already goes first
            return
        for name, queue in self._queues.items():
            channel = self.channels[name]
            beside = {other.name for other in self.channels.values() if other.is_beside(channel)}
            for entry, error in queue.refused_for_good:
                if beside.isdisjoint(self.receipts.taken.get(entry.id, ())):
                    continue
                if others := self._others(name):
                    self._tell_refused(name, entry, error, others)
                log.error("notice %s is given up for '%s', others of '%s' have it", entry.id, name, channel.group)
                self._unwritten.append(self._receipt(channel, [entry], refused=error))
            self._write_receipts()
            self._offer(name)

    def _others(self, name: str) -> tuple[str, ...]:
        """Names of the channels that can tell of this one's fault, since they take something at the moment."""
        return tuple(
            other
            for other in self._queues
            if other != name and not self._is_down(other) and not self._is_refusing_recipient(other)
        )

    def _is_refusing_recipient(self, name: str) -> bool:
        refuses = name in self.receipts.refusals or bool(self._queues[name].refused_for_good)
        return bool(self.channels[name].group) and refuses

    def _finish(self) -> None:
        """Move each notice that every channel took to the delivered ones."""
        for entry in list(self._waiting):
            if not any(self._is_open(entry, name) for name in self.channels):
                if not self.receipts.done(entry.id):
                    log.warning("notice %s is of kind '%s', which no channel takes", entry.id, entry.kind)
                self.outbox.finish(entry)
                self._waiting.remove(entry)

    def _compose(self, batch: list[Waiting]) -> Notice | None:
        try:
            notices = [self.outbox.read(entry) for entry in batch]
        except (OSError, ValueError) as err:
            log.error("%s: a notice cannot be read: %s", self.outbox.folder, err)
            self.outbox.doubt(batch)
            return None
        return notices[0] if len(notices) == 1 else merge(notices)

    def _note_success(self, channel: Channel, queue: ChannelQueue, batch: list[Waiting], where: str) -> Delivery:
        with self._guard:
            receipt = self._receipt(channel, batch, where=where)
            queue.delivered(batch, self._clocks.now())
            self.receipts.note(receipt)
            self._unwritten.append(receipt)
            try:
                self._write_receipts()
                self._settle_refusals()
                self._finish()
            except OSError as err:
                log.error("the delivery of %s cannot be written down: %s; trying on", ", ".join(receipt.ids), err)
        text = f"{title_of(batch)} delivered by {channel.transport.name}: {where}"
        log.info("%s", text)
        return Delivery(
            channel=channel.name,
            transport=channel.transport.name,
            ids=receipt.ids,
            delivered=True,
            where=where,
            text=text,
        )

    def _note_failure(
        self, channel: Channel, queue: ChannelQueue, batch: list[Waiting], err: DeliveryError
    ) -> Delivery:
        ids = tuple(entry.id for entry in batch)
        with self._guard:
            put_off = queue.failed(batch, self._clocks.now(), err)
            rest = self._what_next(channel.name, ids, put_off, err)
        text = f"{title_of(batch)} not taken by '{channel.name}'{rest}: {err}"
        log.error("%s", text)
        return Delivery(
            channel=channel.name,
            transport=channel.transport.name,
            ids=ids,
            delivered=False,
            permanent=err.permanent,
            text=text,
        )

    def _receipt(self, channel: Channel, batch: Sequence[Waiting], *, where: str = "", refused: str = "") -> Receipt:
        return Receipt(
            channel=channel.name,
            transport=channel.transport.name,
            ids=tuple(entry.id for entry in batch),
            wall=self._clocks.wall(),
            where=where,
            refused=refused,
        )

    def _write_receipts(self) -> None:
        while self._unwritten:
            self.receipts.add(self._unwritten[0])
            self._unwritten.pop(0)

    def _status(self, name: str, queue: ChannelQueue) -> ChannelStatus:
        now, oldest = self._clocks.now(), queue.oldest
        return ChannelStatus(
            name=name,
            describe=self.channels[name].transport.describe(),
            waiting=len(queue),
            since=oldest.wall if oldest else None,
            refused=len(queue.refused),
            down_for=None if queue.down_since is None else now - queue.down_since,
            error=queue.error or (queue.refused[0][1] if queue.refused else ""),
            next_try=queue.wait(now),
            refusal=self.receipts.refusals.get(name, ""),
        )

    def _is_down(self, name: str) -> bool:
        since = self._queues[name].down_since
        return since is not None and self._clocks.now() - since >= self._down_after

    def _tell_refused(self, name: str, entry: Waiting, error: str, others: tuple[str, ...]) -> None:
        if name not in self.receipts.refusals:  # the first one was told, and the channel has taken nothing since
            self._tell(refused_notice(self.channels[name], entry, error, others, self._clocks.wall()))

    def _tell(self, notice: Notice) -> None:
        if self.outbox.put(notice):
            log.error("told on %s: %s", ", ".join(notice.channels), notice.subject)
