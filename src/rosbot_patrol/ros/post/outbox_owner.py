"""Notices to the owner from any node: on disk when `put` returns, delivered by threads of the node that has the lock.

All nodes with the same state_dir share one outbox; one of them delivers for all, and another takes over when it ends.
What the disk does not take is sent from memory by the node that has it. The owner is told that the disk is gone, and
when it is back.
"""

from __future__ import annotations

import logging
import os
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rospy

from rosbot_patrol.alerts.channels.config import MailParams, Surroundings, make_channels
from rosbot_patrol.alerts.channels.network_state import network_mark
from rosbot_patrol.alerts.channels.secrets_on_disk import refuse_secrets
from rosbot_patrol.alerts.dispatch.delivery import Delivery
from rosbot_patrol.alerts.dispatch.dispatcher import Dispatcher
from rosbot_patrol.alerts.dispatch.settings_file import Settings, write_settings
from rosbot_patrol.alerts.dispatch.spare_post import SparePost
from rosbot_patrol.alerts.outbox.damaged_notices import replacement
from rosbot_patrol.alerts.outbox.disk_watch import DiskWatch
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox
from rosbot_patrol.alerts.outbox.receipts import Receipt
from rosbot_patrol.files import DISK_FULL
from rosbot_patrol.patrol.calls.repeats import Repeats
from rosbot_patrol.ros.post.health import PostHealth
from rosbot_patrol.ros.runtime.diagnostics import Health
from rosbot_patrol.ros.runtime.node import Worker, ros_home

log = logging.getLogger(__name__)

LOOK = 0.2  # [s] between looks at the folder, in which other programs put
RETRY = 5.0  # [s] where the disk does not take something
RECENT = 50  # notices of this program that are in memory, too, until they are delivered
PROBE = 30.0  # [s] between two looks whether it would
HOUSEKEEPING = 2.0  # [s]


class OwnerPost:
    """The outbox of a node.

    Args:
        mail: whom to tell, and how; raises ParamError where that cannot be.
        state_dir: in which the outbox lies.
        health: where to say how it goes.
    """

    def __init__(self, mail: MailParams, state_dir: Path, health: Health) -> None:
        self._who, self._mail, self._state_dir = rospy.get_name(), mail, state_dir
        around = Surroundings(home=ros_home(), environ=os.environ, host=socket.gethostname())
        channels = make_channels(mail, around, prefix=rospy.get_name() + "/")
        self._outbox = Outbox(state_dir / "outbox")
        self._dispatcher = Dispatcher(self._outbox, channels, who=self._who)
        self._wakes = {channel.name: threading.Event() for channel in channels}
        self._wake = threading.Event()
        self._listeners: list[Callable[[Delivery], None]] = []
        self._spare = SparePost(channels)
        self._disk = DiskWatch(state_dir)
        self._probed = float("-inf")
        self._is_others = self._is_proved = self._is_stuck = False
        self._recent: dict[str, Notice] = {}  # put on the disk by this program, and not known to be delivered
        self._minded = float("-inf")
        self._refused = Repeats(60.0)
        self._putting = threading.Lock()
        self._kept: deque[Notice] = deque()
        self._seen_mtime = 0
        self._housekept = float("-inf")
        self._network = network_mark()
        self._reporter = PostHealth(self._who, mail, self._dispatcher, health)

    @property
    def place(self) -> str:
        """The outbox's folder."""
        return str(self._outbox.folder)

    def describe(self) -> str:
        """Where notices go."""
        return "; ".join(f"{c.name}: {c.transport.describe()}" for c in self._dispatcher.channels.values())

    def on_delivery(self, listener: Callable[[Delivery], None]) -> None:
        """Have deliveries told, whichever program does them; on threads of this object."""
        self._listeners.append(listener)

    def has(self, notice_id: str) -> bool:
        """Whether a notice of this id waits or was delivered, as far as memory and disk can tell."""
        if self._spare.find(notice_id) is not None:
            return True
        try:
            return self._outbox.has(notice_id)
        except OSError as err:
            self._disk_failed(err)
            return False

    def find(self, notice_id: str) -> Notice | None:
        """A notice that waits or was delivered, None where there is none. Raises OSError, ValueError."""
        return self._spare.find(notice_id) or self._outbox.find(notice_id)

    def put(self, notice: Notice) -> bool:
        """Keep a notice until it is delivered.

        Where the disk does not take it, it is sent from memory, and written as soon as that can be.

        Returns:
            Whether it is on the disk.
        """
        with self._putting:
            if self._spare.find(notice.id) is not None:
                return False
            try:
                self._outbox.put(notice)
            except OSError as err:
                log.error("notice %s cannot be written to %s: %s; it is sent from memory", notice.id, self.place, err)
                self._disk_failed(err)
                self._spare.put(notice)
                self._wake_all()
                return False
            self._recent[notice.id] = notice
            while len(self._recent) > RECENT:
                self._recent.pop(next(iter(self._recent)))
        self._wake.set()
        return True

    @property
    def is_written(self) -> bool:
        """Whether every notice that was put is on the disk."""
        return all(notice_id in self._recent for notice_id in self._spare.ids)

    @property
    def is_disk_full(self) -> bool:
        """Whether notices wait for room on the disk."""
        error = self._disk.error
        return not self.is_written and error is not None and error.errno in DISK_FULL

    def keep(self, notice: Notice) -> None:
        """As `put`, on another thread; returns at once."""
        self._kept.append(notice)
        self._wake.set()

    @property
    def notify_verdicts(self) -> tuple[str, ...]:
        """Verdicts that the owner wants to be told, besides that somebody was seen."""
        return tuple(self._mail.notify_verdicts)

    def start(self) -> None:
        """Begin to deliver, or to wait for the turn."""
        settings = Settings(who=self._who, pid=os.getpid(), wall=time.time(), mail=self._mail)
        waiting = 0
        try:
            waiting = len(self._outbox.waiting())
            self._dispatcher.receipts.read_new()
            write_settings(self._outbox.folder, settings)
        except OSError as err:
            self._disk_failed(err)
        log.info("notices go to %s%s", self.describe(), f"; {waiting} wait from before" if waiting else "")
        Worker(self._supervise, name="post").start()
        for name in self._dispatcher.channels:
            Worker(lambda name=name: self._carry(name), name=f"post: {name}").start()  # type: ignore[misc]

    # -- the thread that looks

    def _supervise(self) -> None:
        while not rospy.is_shutdown():
            self._wake.wait(self._pass())
            self._wake.clear()

    def _pass(self) -> float:
        """Look at everything once; returns how long to wait for the next time [s]."""
        pause, self._is_proved = LOOK, False
        for part in (self._look_at_disk, self._look, self._mind_recent, self._keep_house):
            try:
                part()
            except OSError as err:
                self._disk_failed(err)
                pause, self._is_proved = RETRY, False
        if self._is_proved:
            self._disk.worked()
        self._tell_of_disk()
        return pause

    def _look_at_disk(self) -> None:
        """Write what is in memory only; where there is nothing, see now and then whether something could be written."""
        while self._kept:
            self.put(self._kept[0])
            self._kept.popleft()
        waits = len(self._spare) or self._disk.error is not None
        if time.monotonic() - self._probed < (RETRY if waits else PROBE):
            return
        self._probed = time.monotonic()
        if self._is_stuck:
            self._spare.write_receipts(self._dispatcher.receipts)
        elif not len(self._spare):
            self._outbox.probe()
        elif not self._settle():
            self._probed += 1.0 - RETRY  # a channel is busy
            return
        self._is_proved = True

    def _settle(self) -> bool:
        count = len(self._spare)
        with self._putting:
            if not self._spare.settle(self._outbox, self._dispatcher.receipts):
                return False
        log.warning("the disk takes notices again: %d that were in memory are in %s now", count, self.place)
        return True

    def _disk_failed(self, err: OSError) -> None:
        self._disk.failed(err, time.monotonic(), time.time())
        if self._refused.is_news(err.errno or 0, time.monotonic()):
            log.error("the outbox %s cannot be used: %s; trying on every %.0f s", self.place, err, RETRY)
        self._reporter.say_trouble(f"the outbox cannot be written: {err}; notices are sent from memory")

    def _tell_of_disk(self) -> None:
        if self._disk.error is None:
            self._reporter.trouble = ""
        notice = self._disk.notice(time.monotonic(), time.time())
        if notice is not None and not self._is_others:
            log.warning("notice to the owner: %s", notice.subject)
            self.put(notice)

    def _look(self) -> None:
        was_delivering = self._dispatcher.is_delivering
        if not was_delivering:
            self._look_on()
        self._is_others, self._is_stuck = False, True  # where the lock cannot be used
        self._is_others, self._is_stuck = not self._dispatcher.take_over(), False
        if self._is_others:
            pass
        elif not was_delivering or self._has_changed():
            self._dispatcher.refresh()
            self._wake_all()

    def _mind_recent(self) -> None:
        """Send this program's notices from memory where they cannot be delivered from the disk after all."""
        if time.monotonic() - self._minded < HOUSEKEEPING:
            return
        self._minded = time.monotonic()
        with self._putting:
            recent = list(self._recent.values())
        for notice in recent:
            waits = None if self._is_stuck else self._outbox.waits(notice.id)
            if not waits and not self._is_stuck:  # it was delivered, or is gone
                with self._putting:
                    self._recent.pop(notice.id, None)
            if waits is None and self._spare.find(notice.id) is None:
                log.error("notice %s cannot be delivered from %s: it is sent from memory", notice.id, self.place)
                self._spare.put(notice)
                self._wake_all()

    def _mend(self) -> None:
        """Make notices that were damaged on the disk again, or tell that they are lost."""
        for name, notice_id in self._outbox.broken():
            log.error("notice %s was damaged on the disk: it is made again of what its record tells", notice_id)
            self.put(replacement(self._state_dir, notice_id, time.time()))
            self._outbox.mended(name)

    def _has_changed(self) -> bool:
        mtime = os.stat(self._outbox.folder).st_mtime_ns
        if mtime == self._seen_mtime:
            return False
        is_settled = time.time_ns() - mtime > 50_000_000  # what comes within the clock's grain leaves no other mark
        self._seen_mtime = mtime if is_settled else 0
        return True

    def _look_on(self) -> None:
        """Another program delivers: hear what it delivered."""
        try:
            receipts = self._dispatcher.receipts.read_new()
        except OSError as err:  # it is no reason not to deliver
            self._disk_failed(err)
            return
        for receipt in receipts:
            became = f"refused for good by '{receipt.channel}': {receipt.refused}"
            if not receipt.refused:
                became = f"delivered by {receipt.transport}: {receipt.where}"
            self._tell(
                Delivery(
                    channel=receipt.channel,
                    transport=receipt.transport,
                    ids=receipt.ids,
                    delivered=not receipt.refused,
                    permanent=bool(receipt.refused),
                    where=receipt.where,
                    text=f"notice {', '.join(receipt.ids)} {became}",
                )
            )

    def _wake_all(self) -> None:
        for wake in self._wakes.values():
            wake.set()

    def _keep_house(self) -> None:
        if time.monotonic() - self._housekept < HOUSEKEEPING:
            return
        self._housekept = time.monotonic()
        self._spare.tell_faults()
        self._reporter.report_spare(self._spare.statuses())
        self._try_again_where_it_helps()
        if self._dispatcher.is_delivering:
            self._mend()
            self._dispatcher.tell_faults()
        self._reporter.report()

    def _try_again_where_it_helps(self) -> None:
        flush = self._outbox.folder / "flush"
        is_asked = self._dispatcher.is_delivering and flush.exists()
        has_trouble = self._dispatcher.has_trouble or len(self._spare) > 0
        mark = network_mark() if has_trouble else self._network
        if is_asked or mark != self._network:
            self._spare.nudge()
            self._dispatcher.nudge(all_=is_asked)
            self._network = mark
            self._wake_all()
            flush.unlink(missing_ok=True)

    # -- a thread for each channel

    def _carry(self, name: str) -> None:
        wake = self._wakes[name]
        while not rospy.is_shutdown():
            done, pause = self._send(name)
            if done is not None:
                self._tell(done)
                self._housekept = float("-inf")  # say it
                self._wake.set()
            else:
                wake.wait(pause)
                wake.clear()

    def _send(self, name: str) -> tuple[Delivery | None, float]:
        """Send what is due on a channel; returns what it was, and how long to wait where nothing is [s]."""
        done = self._spare.deliver(name)
        pause = self._spare.pause(name)
        try:
            done = done or self._dispatcher.deliver(name)
            pause = min(pause, self._dispatcher.pause(name))
        except OSError as err:
            self._disk_failed(err)
            pause = min(pause, RETRY)
        if done is not None and done.delivered:
            receipt = Receipt(channel=name, transport=done.transport, ids=done.ids, wall=time.time(), where=done.where)
            self._spare.learn(receipt)
            self._dispatcher.learn(receipt)
        return done, pause

    def _tell(self, delivery: Delivery) -> None:
        for listener in self._listeners:
            listener(delivery)


def refuse_passwords(tree: dict[str, Any]) -> None:
    """Refuse a node's parameters with a password among them; raises ParamError."""
    refuse_secrets(tree, name=rospy.get_name() + "/", place="on the parameter server, where every node reads it")
