"""Notices to the owner from any node: on disk when `put` returns, delivered by threads of the node that has the lock.

All nodes with the same state_dir share one outbox; one of them delivers for all, and another takes over when it ends.
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

from rosbot_patrol.alerts.channels import MailParams, Surroundings, make_channels
from rosbot_patrol.alerts.network_state import network_mark
from rosbot_patrol.alerts.notice import Notice
from rosbot_patrol.alerts.outbox import Outbox
from rosbot_patrol.alerts.postman import ChannelStatus, Delivery, Postman
from rosbot_patrol.alerts.secrets_on_disk import refuse_secrets
from rosbot_patrol.alerts.settings_file import Settings, differences, state_of, write_settings
from rosbot_patrol.ros.diagnostics import ERROR, OK, WARN, Health
from rosbot_patrol.ros.node import Worker, ros_home

log = logging.getLogger(__name__)

LOOK = 0.2  # [s] between looks at the folder, in which other programs put
RETRY = 5.0  # [s] where the disk does not take something
HOUSEKEEPING = 2.0  # [s]
OVERDUE = 120.0  # [s] after which a notice that nobody delivers is a fault


class OwnerPost:
    """The outbox of a node.

    Args:
        mail: whom to tell, and how; raises ParamError where that cannot be.
        state_dir: in which the outbox lies.
        health: where to say how it goes.
    """

    def __init__(self, mail: MailParams, state_dir: Path, health: Health) -> None:
        self._who, self._mail, self._health = rospy.get_name(), mail, health
        around = Surroundings(home=ros_home(), environ=os.environ, host=socket.gethostname())
        channels = make_channels(mail, around, prefix=rospy.get_name() + "/")
        self._outbox = Outbox(state_dir / "outbox")
        legacy = (self._outbox.folder, state_dir / "sensor_outbox")
        self._postman = Postman(self._outbox, channels, who=self._who, legacy=legacy)
        self._wakes = {channel.name: threading.Event() for channel in channels}
        self._wake = threading.Event()
        self._listeners: list[Callable[[Delivery], None]] = []
        self._putting = threading.Lock()
        self._kept: deque[Notice] = deque()
        self._seen_mtime = 0
        self._housekept = float("-inf")
        self._network = network_mark()
        self._parts: set[str] = set()

    @property
    def place(self) -> str:
        """The outbox's folder."""
        return str(self._outbox.folder)

    def describe(self) -> str:
        """Where notices go."""
        return "; ".join(f"{c.name}: {c.transport.describe()}" for c in self._postman.channels.values())

    def on_delivery(self, listener: Callable[[Delivery], None]) -> None:
        """Have deliveries told, whichever program does them; on threads of this object."""
        self._listeners.append(listener)

    def has(self, notice_id: str) -> bool:
        """Whether a notice of this id waits or was delivered."""
        return self._outbox.has(notice_id)

    def put(self, notice: Notice) -> None:
        """Keep a notice until it is delivered.

        Raises:
            OSError: the disk does not take it; said on /diagnostics.
        """
        try:
            with self._putting:
                self._outbox.put(notice)
        except OSError as err:
            self._health.set("outbox", ERROR, f"the outbox cannot be written: {err}")
            raise
        self._wake.set()

    def keep(self, notice: Notice) -> None:
        """Put a notice as soon as the disk takes it; returns at once."""
        self._kept.append(notice)
        self._wake.set()

    @property
    def notify_verdicts(self) -> tuple[str, ...]:
        """Verdicts that the owner wants to be told, besides that somebody was seen."""
        return tuple(self._mail.notify_verdicts)

    def start(self) -> None:
        """Begin to deliver, or to wait for the turn."""
        waiting = len(self._outbox.waiting())
        log.info("notices go to %s%s", self.describe(), f"; {waiting} wait from before" if waiting else "")
        settings = Settings(who=self._who, pid=os.getpid(), wall=time.time(), mail=self._mail)
        try:
            write_settings(self._outbox.folder, settings)
            self._postman.receipts.read_new()
        except OSError as err:
            log.error("%s: %s", self.place, err)
        Worker(self._supervise, name="post").start()
        for name in self._postman.channels:
            Worker(lambda name=name: self._carry(name), name=f"post: {name}").start()  # type: ignore[misc]

    # -- the thread that looks

    def _supervise(self) -> None:
        while not rospy.is_shutdown():
            try:
                self._look()
                pause = LOOK
            except OSError as err:
                log.error("the outbox %s cannot be used: %s", self.place, err)
                self._health.set("outbox", ERROR, f"the outbox cannot be used: {err}")
                pause = RETRY
            self._wake.wait(pause)
            self._wake.clear()

    def _look(self) -> None:
        while self._kept:
            self.put(self._kept[0])
            self._kept.popleft()
        was_delivering = self._postman.is_delivering
        if not self._postman.take_over():
            self._look_on()
        elif not was_delivering or self._has_changed():
            self._postman.refresh()
            self._wake_all()
        if time.monotonic() - self._housekept >= HOUSEKEEPING:
            self._housekept = time.monotonic()
            self._keep_house()

    def _has_changed(self) -> bool:
        mtime = os.stat(self._outbox.folder).st_mtime_ns
        if mtime == self._seen_mtime:
            return False
        is_settled = time.time_ns() - mtime > 50_000_000  # what comes within the clock's grain leaves no other mark
        self._seen_mtime = mtime if is_settled else 0
        return True

    def _look_on(self) -> None:
        """Another program delivers: hear what it delivered."""
        for receipt in self._postman.receipts.read_new():
            self._tell(
                Delivery(
                    channel=receipt.channel,
                    transport=receipt.transport,
                    ids=receipt.ids,
                    delivered=True,
                    where=receipt.where,
                    text=f"notice {', '.join(receipt.ids)} delivered by {receipt.transport}: {receipt.where}",
                )
            )

    def _wake_all(self) -> None:
        for wake in self._wakes.values():
            wake.set()

    def _keep_house(self) -> None:
        if not self._postman.is_delivering:
            self._report_from_afar()
            return
        flush = self._outbox.folder / "flush"
        mark = network_mark()
        if flush.exists() or mark != self._network:
            self._postman.nudge(all_=flush.exists())
            flush.unlink(missing_ok=True)
            self._network = mark
            self._wake_all()
        self._postman.tell_faults()
        self._postman.write_status()
        for status in self._postman.statuses():
            level, text = judge(status)
            self._set(status.name, level, text, {"waiting": status.waiting, "refused": status.refused})
        self._report_differences(f"{self._who} delivers")

    def _report_from_afar(self) -> None:
        holder = self._postman.lock.holder()
        late = [entry for entry in self._outbox.waiting() if time.time() - entry.wall > OVERDUE]
        told = state_of(self._outbox.folder) or {}
        is_stale = time.time() - float(str(told.get("wall", 0.0))) > OVERDUE
        for part in self._parts - {"outbox"}:
            self._health.drop(part)
        self._parts &= {"outbox"}
        if late and is_stale:
            self._set(
                "outbox", ERROR, f"{len(late)} notices wait, and {holder}, which has to deliver them, does nothing"
            )
        else:
            self._report_differences(f"{holder} delivers")

    def _report_differences(self, text: str) -> None:
        found = differences(self._outbox.folder, self._who, self._mail)
        self._set("outbox", WARN if found else OK, "; ".join(found) or text)

    def _set(self, part: str, level: int, text: str, values: dict[str, Any] | None = None) -> None:
        self._parts.add(part)
        self._health.set(part, level, text, values)

    # -- a thread for each channel

    def _carry(self, name: str) -> None:
        wake = self._wakes[name]
        while not rospy.is_shutdown():
            try:
                done = self._postman.deliver(name)
                pause = self._postman.pause(name)
            except OSError as err:
                log.error("the outbox %s cannot be used: %s", self.place, err)
                done, pause = None, RETRY
            if done is not None:
                self._tell(done)
                self._housekept = float("-inf")  # say it
                self._wake.set()
            else:
                wake.wait(pause)
                wake.clear()

    def _tell(self, delivery: Delivery) -> None:
        for listener in self._listeners:
            listener(delivery)


def judge(status: ChannelStatus) -> tuple[int, str]:
    """Level and sentence about a channel for /diagnostics."""
    if not status.waiting:
        return OK, f"notices go to {status.describe}"
    since = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(status.since))
    waits = f"{status.waiting} notices wait" if status.waiting > 1 else "1 notice waits"
    if not status.error:
        return OK, f"{waits} for {status.describe}, since {since}"
    refused = f", {status.refused} of them refused for good" if status.refused else ""
    return WARN, f"{waits} since {since}{refused}: {status.error}"


def refuse_passwords(tree: dict[str, Any]) -> None:
    """Refuse a node's parameters with a password among them; raises ParamError."""
    refuse_secrets(tree, name=rospy.get_name() + "/", place="on the parameter server, where every node reads it")
