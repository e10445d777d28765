"""A notice by one of Apprise's hundred services: ntfy, Pushover, Telegram, Signal, Matrix, Slack, Home Assistant, ...

Apprise (PyPI) is loaded when a channel of this type is made, because it takes some 20 MB. It tells success or failure,
and why only in its log, which becomes the reason here. Its web address holds keys: it is shown nowhere.
"""

from __future__ import annotations

import importlib
import logging
import threading
from typing import Any
from urllib.parse import quote

from rosbot_patrol.alerts.channels.channel import DeliveryError
from rosbot_patrol.alerts.channels.masking import Mask, url_secrets
from rosbot_patrol.alerts.channels.network_words import WHOLE_EXCHANGE
from rosbot_patrol.alerts.channels.short_text import body_of, title_of
from rosbot_patrol.alerts.outbox.notice import Notice

_LOGGER = "apprise"
_SHOWN = 300  # letters of a reason


class NoService(ValueError):
    """A web address that Apprise does not know."""


class _Words(logging.Handler):
    """Collects what Apprise logs on one thread."""

    def __init__(self, thread: threading.Thread) -> None:
        super().__init__(logging.WARNING)
        self._thread, self.lines = thread, list[str]()

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a line of that thread."""
        if record.thread == self._thread.ident:
            self.lines.append(record.getMessage())


class AppriseTransport:
    """Sends notices by one service.

    Args:
        url: Apprise's web address of the service.
        name: of the channel.
        timeout: for each answer [s].
        with_picture: send the picture, where the service takes one.

    Raises:
        NoService: Apprise does not know the address; says no part of it.
        ImportError: Apprise is not installed.
    """

    name = "apprise"

    def __init__(self, url: str, name: str, timeout: float, *, with_picture: bool = True) -> None:
        self._apprise = importlib.import_module("apprise")
        self._channel, self._timeout, self._with_picture = name, timeout, with_picture
        self._mask = Mask([url, *url_secrets(url), *_user_and_password(url)])
        joint = "&" if "?" in url else "?"
        self._url = f"{url}{joint}cto={timeout:g}&rto={timeout:g}"
        logging.getLogger(_LOGGER).propagate = False  # its words may repeat the address
        self._service = self._make("")
        if self._service is None:
            raise NoService

    def _make(self, more: str) -> Any:
        """The service with more parameters in its address, None if Apprise does not know it."""
        service = self._apprise.Apprise.instantiate(self._url + more, suppress_exceptions=True)
        if service is not None:
            service.request_rate_per_sec = 0.0  # the channel has a pace of its own
        return service

    def describe(self) -> str:
        """Which service; its address is secret."""
        return f"the service {self._service.service_name} of the channel '{self._channel}'"

    def send(self, notice: Notice) -> str:
        """Send the notice; on a thread of its own, so that a server that says nothing does not hold the post."""
        done: list[bool] = []
        thread = threading.Thread(target=lambda: done.append(self._notify(notice)), name="apprise", daemon=True)
        words = _Words(thread)
        logger = logging.getLogger(_LOGGER)
        logger.addHandler(words)
        try:
            thread.start()
            thread.join(WHOLE_EXCHANGE * self._timeout)
        finally:
            logger.removeHandler(words)
        if done and done[0]:
            return self.describe()
        limit = WHOLE_EXCHANGE * self._timeout
        said = "; ".join(words.lines) if not thread.is_alive() else f"no answer within {limit:g} s"
        reason = self._mask(" ".join(said.split()))[:_SHOWN] or "it said no reason"
        raise DeliveryError(f"{self.describe()} did not take it: {reason}", answered=not thread.is_alive())

    def _notify(self, notice: Notice) -> bool:
        target = self._apprise.Apprise()
        target.add(self._service if not notice.link else self._make(_links(self._url, notice)) or self._service)
        attached = None
        if notice.picture is not None and self._with_picture:
            memory = importlib.import_module("apprise.attachment.memory")
            attached = memory.AttachMemory(notice.picture, name=notice.picture_name, mimetype="image/jpeg")
        return bool(target.notify(title=title_of(notice), body=body_of(notice), attach=attached))


def _links(url: str, notice: Notice) -> str:
    """Parameters of a service that opens a link, or has a button, beside the text."""
    schema, link = url.partition("://")[0].lower(), quote(notice.link, safe="")
    if schema in ("ntfy", "ntfys"):
        ack = f"http, Seen, {notice.seen_link}, method=POST, clear=true" if notice.seen_link else ""
        return f"&click={link}" + (f"&actions={quote(ack, safe='')}" if ack else "")
    return f"&supplemental_url={link}&supplemental_url_title=Open" if schema == "pover" else ""


def _user_and_password(url: str) -> list[str]:
    """The part before the host, which often is the key: pover://USER@TOKEN."""
    place = url.partition("://")[2].partition("/")[0]
    return [part for part in place.replace("@", ":").split(":") if len(part) > 3] if "@" in place else []
