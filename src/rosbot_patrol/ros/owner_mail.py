"""Mails to the owner from a node of its own: on disk at once, delivered by a thread, its health told."""

from __future__ import annotations

import logging
import os
import socket
import threading
import time
from pathlib import Path

import rospy

from rosbot_patrol.alerts.mail import make_envelope
from rosbot_patrol.alerts.notice import Notice
from rosbot_patrol.alerts.outbox import Outbox
from rosbot_patrol.alerts.postman import Postman
from rosbot_patrol.alerts.transports import MailParams, make_transport
from rosbot_patrol.ros.diagnostics import OK, WARN, Health
from rosbot_patrol.ros.node import Worker, ros_home

log = logging.getLogger(__name__)

RETRY = 5.0  # [s] where the disk does not take something


class OwnerMail:
    """Keeps notices until they are delivered.

    Args:
        mail: whom to tell, and how; raises ParamError where that cannot be.
        folder: of the outbox; no other program may use it.
        health: where to say how it goes.
    """

    def __init__(self, mail: MailParams, folder: Path, health: Health) -> None:
        prefix = rospy.get_name() + "/"
        self._envelope = make_envelope(mail.email_to, mail.email_from, prefix=prefix, host=socket.getfqdn())
        transport = make_transport(mail, self._envelope, home=ros_home(), environ=os.environ, prefix=prefix)
        outbox = Outbox(folder, interval=mail.mail_interval, first_delay=mail.mail_retry)
        self._postman = Postman(outbox, transport, self._envelope)
        self._health = health
        self._wake = threading.Event()

    def start(self) -> None:
        """Begin to deliver."""
        transport, waiting = self._postman.transport, len(self._postman)
        more = f", {waiting} wait from before" if waiting else ""
        log.info("notices go to %s (transport %s)%s", transport.describe(), transport.name, more)
        self._health.set("mail", OK, f"notices go to {transport.describe()}")
        Worker(self._run, name="deliver").start()

    def put(self, notice_id: str, subject: str, text: str) -> bool:
        """Keep a notice; returns whether the disk took it."""
        try:
            self._postman.put(Notice(id=notice_id, wall=time.time(), kind="sensor", subject=subject, text=text))
        except OSError as err:
            log.error("the notice '%s' cannot be written to %s: %s; trying on", subject, self._postman.place, err)
            self._health.set("mail", WARN, f"the outbox cannot be written: {err}")
            return False
        self._wake.set()
        return True

    def _run(self) -> None:
        while not rospy.is_shutdown():
            try:
                pause = self._deliver()
            except OSError as err:
                log.error("%s: %s", self._postman.place, err)
                self._health.set("mail", WARN, f"the outbox cannot be used: {err}")
                pause = RETRY
            if pause > 0.0:
                self._wake.wait(min(pause, 60.0))
                self._wake.clear()

    def _deliver(self) -> float:
        """Deliver one mail; returns how long to wait for the next [s]."""
        done = self._postman.deliver()
        if done is None:
            return self._postman.pause()
        if done.delivered:
            self._health.set("mail", OK, f"notices go to {self._postman.transport.describe()}")
        else:
            self._health.set("mail", WARN, f"{len(self._postman)} notices wait: {done.text}")
        return 0.0
