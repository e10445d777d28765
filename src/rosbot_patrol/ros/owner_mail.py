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
from rosbot_patrol.alerts.postman import Delivery, Postman
from rosbot_patrol.alerts.secrets_on_disk import refuse_secrets
from rosbot_patrol.alerts.settings_file import Settings, write_settings
from rosbot_patrol.ros.diagnostics import Health
from rosbot_patrol.ros.node import Worker, ros_home
from rosbot_patrol.ros.post_health import PostHealth

log = logging.getLogger(__name__)

LOOK = 0.2  # [s] between looks at the folder, in which other programs put
RETRY = 5.0  # [s] where the disk does not take something
HOUSEKEEPING = 2.0  # [s]


class OwnerPost:
    """The outbox of a node.

    Args:
        mail: whom to tell, and how; raises ParamError where that cannot be.
        state_dir: in which the outbox lies.
        health: where to say how it goes.
    """

    def __init__(self, mail: MailParams, state_dir: Path, health: Health) -> None:
        self._who, self._mail = rospy.get_name(), mail
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
        self._reporter = PostHealth(self._who, mail, self._postman, health)

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

    def find(self, notice_id: str) -> Notice | None:
        """A notice that waits or was delivered, None where there is none. Raises OSError, ValueError."""
        return self._outbox.find(notice_id)

    def put(self, notice: Notice) -> None:
        """Keep a notice until it is delivered.

        Raises:
            OSError: the disk does not take it; said on /diagnostics.
        """
        try:
            with self._putting:
                self._outbox.put(notice)
        except OSError as err:
            self._reporter.say_trouble(f"the outbox cannot be written: {err}")
            raise
        self._reporter.trouble = ""
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
        is_unwell = False
        while not rospy.is_shutdown():
            try:
                self._look()
                if is_unwell:
                    is_unwell, self._reporter.trouble = False, ""
                pause = LOOK
            except OSError as err:
                log.error("the outbox %s cannot be used: %s", self.place, err)
                self._reporter.say_trouble(f"the outbox cannot be used: {err}")
                is_unwell, pause = True, RETRY
            self._wake.wait(pause)
            self._wake.clear()

    def _look(self) -> None:
        while self._kept:
            self.put(self._kept[0])
            self._kept.popleft()
        was_delivering = self._postman.is_delivering
        if not was_delivering:
            self._look_on()
        if not self._postman.take_over():
            pass
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
        if self._postman.is_delivering:
            self._try_again_where_it_helps()
            self._postman.tell_faults()
        self._reporter.report()

    def _try_again_where_it_helps(self) -> None:
        flush = self._outbox.folder / "flush"
        is_asked = flush.exists()
        mark = network_mark() if self._postman.has_trouble else self._network
        if is_asked or mark != self._network:
            self._postman.nudge(all_=is_asked)
            flush.unlink(missing_ok=True)
            self._network = mark
            self._wake_all()

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


def refuse_passwords(tree: dict[str, Any]) -> None:
    """Refuse a node's parameters with a password among them; raises ParamError."""
    refuse_secrets(tree, name=rospy.get_name() + "/", place="on the parameter server, where every node reads it")
