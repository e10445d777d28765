"""Notices to the owner from any node: on disk when `put` returns, delivered by threads of the node that has the lock.

All nodes with the same state_dir share one outbox. One of them delivers for all, and another takes over when it ends.
If the disk fails, a node sends notices from its memory. The owner is told when the disk fails, and when it works again.
"""

from __future__ import annotations

import logging
import os
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import rospy

from rosbot_patrol.alerts.channels.config import Surroundings, make_channels
from rosbot_patrol.alerts.channels.network_state import network_mark
from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.channels.secrets_on_disk import refuse_secrets
from rosbot_patrol.alerts.dispatch.delivery import Clocks, Delivery, delivery_of
from rosbot_patrol.alerts.dispatch.dispatcher import Dispatcher
from rosbot_patrol.alerts.dispatch.safe_outbox import RETRY, SafeOutbox
from rosbot_patrol.alerts.dispatch.settings_file import Settings, write_settings
from rosbot_patrol.alerts.dispatch.spare_post import SparePost
from rosbot_patrol.alerts.outbox.damaged_notices import replacement
from rosbot_patrol.alerts.outbox.disk_watch import DiskWatch
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox
from rosbot_patrol.alerts.outbox.receipts import Receipt
from rosbot_patrol.console.access.secret import console_secret, seen_token
from rosbot_patrol.patrol.calls.repeats import Repeats
from rosbot_patrol.ros.post.health import PostHealth
from rosbot_patrol.ros.runtime.diagnostics import Health
from rosbot_patrol.ros.runtime.node import Worker, ros_home

log = logging.getLogger(__name__)

LOOK = 0.2  # time between checks of the folder for other programs' notices [s]
HOUSEKEEPING = 2.0  # [s]
STALLED = 15.0  # time without a check after which the post hangs [s]


class OwnerPost:
    """The post of a node: its outbox, and the threads that deliver.

    Args:
        mail: channels to the owner.
        state_dir: folder of the outbox.
        health: receives the post's health.
        clocks: wall and monotonic time.

    Raises:
        ParamError: a channel is invalid.
    """

    def __init__(self, mail: MailParams, state_dir: Path, health: Health, *, clocks: Clocks | None = None) -> None:
        self._who, self._mail, self._state_dir = rospy.get_name(), mail, state_dir
        self._clocks = clocks or Clocks()
        around = Surroundings(home=ros_home(), environ=os.environ, host=socket.gethostname())
        channels = make_channels(mail, around, prefix=rospy.get_name() + "/")
        self._outbox = Outbox(state_dir / "outbox")
        self._dispatcher = Dispatcher(self._outbox, channels, who=self._who, clocks=self._clocks)
        self._spare = SparePost(channels, clocks=self._clocks)
        self._disk = DiskWatch(state_dir)
        self._box = SafeOutbox(
            self._outbox,
            self._dispatcher.receipts,
            self._spare,
            self._disk,
            clocks=self._clocks,
            on_failure=self._say_failure,
            on_spare=self._wake_all,
        )
        self._wakes = {channel.name: threading.Event() for channel in channels}
        self._wake = threading.Event()
        self._listeners: list[Callable[[Delivery], None]] = []
        self._kept: deque[Notice] = deque()
        self._has_other = False  # another program delivers
        self._failures = Repeats(60.0)
        self._seen_mtime = 0
        self._passed_at = time.monotonic()
        self._housekept = float("-inf")
        self._network = network_mark()
        self._reporter = PostHealth(self._who, mail, self._dispatcher, health)

    @property
    def place(self) -> str:
        """The outbox's folder."""
        return str(self._outbox.folder)

    @property
    def is_written(self) -> bool:
        """Whether every notice put so far is on the disk."""
        return self._box.is_written

    @property
    def is_at_work(self) -> bool:
        """Whether the thread that checks the outbox has done so lately."""
        return time.monotonic() - self._passed_at < STALLED

    @property
    def is_disk_full(self) -> bool:
        """Whether notices wait for room on the disk."""
        return self._box.is_disk_full

    @property
    def notify_verdicts(self) -> tuple[str, ...]:
        """Verdicts that the owner wants notices about, besides confirmed intruders."""
        return tuple(self._mail.notify_verdicts)

    def describe(self) -> str:
        """Description of the channels, for people."""
        return "; ".join(f"{c.name}: {c.transport.describe()}" for c in self._dispatcher.channels.values())

    def on_delivery(self, listener: Callable[[Delivery], None]) -> None:
        """Register a listener for every delivery, by whichever program; called on threads of this object."""
        self._listeners.append(listener)

    def has(self, notice_id: str) -> bool:
        """Whether a notice of this id waits or was delivered, as far as memory and disk show."""
        return self._box.has(notice_id)

    def find(self, notice_id: str) -> Notice | None:
        """Find a waiting or delivered notice, None if there is none. Raises OSError, ValueError."""
        return self._box.find(notice_id)

    def put(self, notice: Notice) -> bool:
        """Keep a notice until it is delivered, even if the disk fails. Returns whether it is on the disk."""
        is_on_disk = self._box.put(self._with_links(notice))
        if is_on_disk:
            self._wake.set()
        return is_on_disk

    def _with_links(self, notice: Notice) -> Notice:
        """A notice about an incident with the address of its page, if the console's is known."""
        base = self._mail.console_url.rstrip("/")
        if not base or not notice.incident or notice.link:
            return notice
        name = quote(notice.incident, safe="")
        linked = replace(notice, link=f"{base}/incidents/{name}")
        try:
            token = seen_token(console_secret(self._state_dir), notice.incident)
        except OSError as err:
            log.warning("the notice cannot be acknowledged on the phone: %s", err)
            return linked
        return replace(linked, seen_link=f"{base}/seen/{name}/{token}")

    def keep(self, notice: Notice) -> None:
        """Put a notice as in `put`, on another thread; returns at once."""
        self._kept.append(notice)
        self._wake.set()

    def start(self) -> None:
        """Start to deliver, or to wait for the turn."""
        settings = Settings(who=self._who, pid=os.getpid(), wall=self._clocks.wall(), mail=self._mail)
        waiting = 0
        try:
            waiting = len(self._outbox.waiting())
            self._dispatcher.receipts.read_new()
            write_settings(self._outbox.folder, settings)
        except OSError as err:
            self._box.failed(err)
        log.info("notices go to %s%s", self.describe(), f"; {waiting} wait from before" if waiting else "")
        Worker(self._supervise, name="post").start()
        for name in self._dispatcher.channels:
            Worker(partial(self._carry, name), name=f"post: {name}").start()

    # -- the thread that checks the outbox

    def _supervise(self) -> None:
        while not rospy.is_shutdown():
            self._wake.wait(self._pass())
            self._wake.clear()

    def _pass(self) -> float:
        """Check everything once; returns the time until the next check [s]."""
        self._passed_at = time.monotonic()
        has_written, has_failed = False, False
        for part in (self._write, self._look, self._box.watch_recent, self._keep_house):
            try:
                has_written = bool(part()) or has_written
            except OSError as err:
                self._box.failed(err)
                has_failed = True
        if has_written and not has_failed:
            self._disk.worked()
        self._tell_of_disk()
        return RETRY if has_failed else LOOK

    def _write(self) -> bool:
        while self._kept:
            self.put(self._kept[0])
            self._kept.popleft()
        return self._box.save()

    def _look(self) -> None:
        """Deliver new notices of the outbox, or read what another program delivers."""
        was_delivering = self._dispatcher.is_delivering
        if not was_delivering:
            self._hear_others()
        self._has_other, self._box.is_stuck = False, True  # stays so if the lock cannot be used
        self._has_other, self._box.is_stuck = not self._dispatcher.take_over(), False
        if not self._has_other and (not was_delivering or self._has_changed()):
            self._dispatcher.refresh()
            self._wake_all()

    def _hear_others(self) -> None:
        try:
            receipts = self._dispatcher.receipts.read_new()
        except OSError as err:  # this must not prevent delivery
            self._box.failed(err)
            return
        for receipt in receipts:
            self._tell(delivery_of(receipt))

    def _has_changed(self) -> bool:
        mtime = os.stat(self._outbox.folder).st_mtime_ns
        if mtime == self._seen_mtime:
            return False
        # A change within the clock's resolution leaves no other mark: check again.
        is_settled = time.time_ns() - mtime > 50_000_000
        self._seen_mtime = mtime if is_settled else 0
        return True

    def _say_failure(self, err: OSError) -> None:
        if self._failures.is_news(err.errno or 0, self._clocks.now()):
            log.error("the outbox %s cannot be used: %s; trying on every %.0f s", self.place, err, RETRY)
        self._reporter.say_trouble(f"the outbox cannot be written: {err}; notices are sent from memory")

    def _tell_of_disk(self) -> None:
        if self._disk.error is None:
            self._reporter.trouble = ""
        notice = self._disk.notice(self._clocks.now(), self._clocks.wall())
        if notice is not None and not self._has_other:
            log.warning("notice to the owner: %s", notice.subject)
            self.put(notice)

    # -- housekeeping

    def _keep_house(self) -> None:
        if self._clocks.now() - self._housekept < HOUSEKEEPING:
            return
        self._housekept = self._clocks.now()
        self._spare.tell_faults()
        self._reporter.report_spare(self._spare.statuses())
        self._try_again_where_it_helps()
        if self._dispatcher.is_delivering:
            self._mend()
            self._dispatcher.tell_faults()
        self._reporter.report()

    def _mend(self) -> None:
        """Restore notices that were damaged on the disk, or report that they are lost."""
        for name, notice_id in self._outbox.broken():
            log.error("notice %s was damaged on the disk: it is made again of what its record tells", notice_id)
            self.put(replacement(self._state_dir, notice_id, self._clocks.wall()))
            self._outbox.mended(name)

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

    def _wake_all(self) -> None:
        for wake in self._wakes.values():
            wake.set()

    # -- a thread for each channel

    def _carry(self, name: str) -> None:
        wake = self._wakes[name]
        while not rospy.is_shutdown():
            done, pause = self._send(name)
            if done is not None:
                self._tell(done)
                self._housekept = float("-inf")  # report it
                self._wake.set()
            else:
                wake.wait(pause)
                wake.clear()

    def _send(self, name: str) -> tuple[Delivery | None, float]:
        """Send a due notice on a channel; returns its delivery, and the time to wait if none is due [s]."""
        done = self._spare.deliver(name)
        pause = self._spare.pause(name)
        try:
            done = done or self._dispatcher.deliver(name)
            pause = min(pause, self._dispatcher.pause(name))
        except OSError as err:
            self._box.failed(err)
            pause = min(pause, RETRY)
        if done is not None and done.delivered:
            wall = self._clocks.wall()
            receipt = Receipt(channel=name, transport=done.transport, ids=done.ids, wall=wall, where=done.where)
            self._spare.learn(receipt)
            self._dispatcher.learn(receipt)
        return done, pause

    def _tell(self, delivery: Delivery) -> None:
        for listener in self._listeners:
            listener(delivery)


def refuse_passwords(tree: dict[str, Any]) -> None:
    """Refuse a node's parameters with a password among them; raises ParamError."""
    refuse_secrets(tree, name=rospy.get_name() + "/", place="on the parameter server, where every node reads it")
