"""A notice as a JSON document, sent by POST to a web address (Home Assistant, ntfy, Node-RED, your own).

    POST /path                                     Content-Type: application/json
    Idempotency-Key: ID                            the same when a notice goes again: take it once
    X-Rosbot-Patrol-Timestamp: SECONDS
    X-Rosbot-Patrol-Signature: sha256=HEX          HMAC-SHA256 with the secret over "SECONDS." and the body

An answer of 2xx means that the receiver has accepted the notice. Redirects are not followed: the notice, its picture
and the signature go to the address that was named, and to no other.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import http.client
import json
import logging
import ssl
import time
from collections.abc import Callable
from dataclasses import dataclass
from urllib.parse import urlsplit

from rosbot_patrol.alerts.channels.channel import DeliveryError, FailureCause, Pace
from rosbot_patrol.alerts.channels.mail import plain_text
from rosbot_patrol.alerts.channels.masking import Mask, masked_url, url_secrets
from rosbot_patrol.alerts.channels.network_words import WHOLE_EXCHANGE, Deadline, explain
from rosbot_patrol.alerts.channels.retry_after import parse_retry_after
from rosbot_patrol.alerts.outbox.notice import Notice

log = logging.getLogger(__name__)

SHOWN = 300  # [characters] of an answer
_THIS_NOTICES_FAULT = {400, 409, 411, 413, 415, 422, 431}
_CAUSES = {401: FailureCause.UNAUTHORIZED, 403: FailureCause.FORBIDDEN, 404: FailureCause.NOT_FOUND}


@dataclass(frozen=True, kw_only=True)
class WebAddress:
    """Address of a webhook, and what is sent along.

    Attributes:
        url: http or https; its path and query are secrets, and are shown nowhere.
        name: of the channel, shown in place of the secret path.
        secret: of the signature; "" for none.
        token: for `Authorization: Bearer`; "" for none.
        with_picture: send the picture, in base64.
        timeout: for each answer [s].
        ca_file: certificates to trust besides the system's; "" for none.
    """

    url: str
    name: str = ""
    secret: str = ""
    token: str = ""
    with_picture: bool = True
    timeout: float = 30.0
    ca_file: str = ""


def check_url(url: str) -> str | None:
    """What is wrong with a web address, None if nothing is."""
    if any(c.isspace() or not c.isprintable() for c in url) or not url.isascii():
        return "has a blank, a line break or a letter that a web address cannot have"
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:  # the error repeats a part of the address
        return "is no web address: its host or port cannot be read"
    if parts.scheme not in ("http", "https") or not parts.hostname:
        return "is no web address, expected http://... or https://..."
    if parts.username is not None or parts.password is not None:
        return "has a user or password in it: use token_file or token_env"
    return "has no port 0" if port == 0 else None


class WebhookTransport:
    """Posts notices.

    Args:
        address: of the webhook.
        wall: seconds since 1970, for the signature.
    """

    name = "webhook"

    def __init__(
        self, address: WebAddress, wall: Callable[[], float] = lambda: time.clock_gettime(time.CLOCK_REALTIME)
    ) -> None:
        self._address, self._wall = address, wall
        self._parts = urlsplit(address.url)
        self._tls = self._parts.scheme == "https"
        self._where = f"{self._parts.hostname}:{self._parts.port or (443 if self._tls else 80)}"
        self._has_warned_of_pause = False
        self._mask = Mask([*url_secrets(address.url), address.token, address.secret])

    def describe(self) -> str:
        """Where its notices go; without path and query, which are often the key."""
        name = f" '{self._address.name}'" if self._address.name else ""
        return f"the webhook{name} at {masked_url(self._address.url)}"

    def send(self, notice: Notice) -> str:
        """Post the notice."""
        body = document(notice, with_picture=self._address.with_picture)
        try:
            status, reason, said, pause = self._post(notice.id, body)
        except (OSError, http.client.HTTPException, ValueError) as err:
            cause, problem = explain(err, self._where, self._address.timeout, mask=self._mask)
            raise DeliveryError(f"{self.describe()} cannot be used: {problem}", cause=cause) from None
        answer = " ".join(f"{status} {reason} {said}".split())
        if 200 <= status < 300:
            return f"{self.describe()} ({status} {reason})".replace(" )", ")")
        delay = self._delay(pause)
        if 300 <= status < 400:
            answer += ": redirects are not followed, name the final url"
        if delay is not None and delay > Pace.max_delay:
            answer += f"; it asks for a pause of {delay:.0f} s, the longest one here is {Pace.max_delay:.0f} s"
        is_for_now = status == 413 and delay is not None  # too large for the moment (RFC 9110, 15.5.14)
        raise DeliveryError(
            f"{self.describe()} answered {answer}",
            permanent=status in _THIS_NOTICES_FAULT and not is_for_now,
            answered=status >= 500 or is_for_now,
            delay=delay,
            cause=_CAUSES.get(status, FailureCause.REDIRECT if 300 <= status < 400 else FailureCause.OTHER),
        )

    def _delay(self, pause: str) -> float | None:
        try:
            return parse_retry_after(pause, self._wall())
        except ValueError:
            if not self._has_warned_of_pause:
                self._has_warned_of_pause = True
                words = "asks for a pause (Retry-After) that is neither seconds nor a date, using our own: %r"
                log.warning(f"%s {words}", self.describe(), self._mask(pause)[:80])
            return None

    def _post(self, notice_id: str, body: bytes) -> tuple[int, str, str, str]:
        connection = self._connection()
        with Deadline(WHOLE_EXCHANGE * self._address.timeout, lambda: connection.sock):
            try:
                path = self._parts.path or "/"
                target = f"{path}?{self._parts.query}" if self._parts.query else path
                connection.request("POST", target, body, self._headers(notice_id, body))
                answer = connection.getresponse()
                data = answer.read(SHOWN + 4 * self._mask.longest)  # so that no secret is cut and then not found
                said = self._mask(data.decode("utf-8", "replace"))[:SHOWN]
                pause = answer.headers.get("Retry-After", "")  # the first of several
                return answer.status, self._mask(answer.reason), _printable(said), pause
            finally:
                connection.close()

    def _connection(self) -> http.client.HTTPConnection:
        host, port = self._parts.hostname or "", self._parts.port
        if not self._tls:
            return http.client.HTTPConnection(host, port, timeout=self._address.timeout)
        context = ssl.create_default_context()
        if self._address.ca_file:
            context.load_verify_locations(self._address.ca_file)
        return http.client.HTTPSConnection(host, port, timeout=self._address.timeout, context=context)

    def _headers(self, notice_id: str, body: bytes) -> dict[str, str]:
        stamp = str(int(self._wall()))
        headers = {
            "Content-Type": "application/json",
            "User-Agent": "rosbot_patrol",
            "Idempotency-Key": notice_id,
            "X-Rosbot-Patrol-Timestamp": stamp,
        }
        if self._address.secret:
            headers["X-Rosbot-Patrol-Signature"] = sign(self._address.secret, stamp, body)
        if self._address.token:
            headers["Authorization"] = f"Bearer {self._address.token}"
        return headers


def sign(secret: str, stamp: str, body: bytes) -> str:
    """The signature header: a receiver that knows the secret can check that body and time are ours."""
    digest = hmac.new(secret.encode(), stamp.encode() + b"." + body, hashlib.sha256)
    return f"sha256={digest.hexdigest()}"


def document(notice: Notice, *, with_picture: bool = True) -> bytes:
    """The body that is posted."""
    tree = {
        "id": notice.id,
        "time": notice.wall,
        "kind": notice.kind,
        "subject": notice.subject,
        "text": plain_text(notice),
        "facts": dict(notice.facts),
        "verdict": notice.verdict,
        "incident": notice.incident,
    }
    if notice.link:
        tree["link"] = notice.link
    if notice.room_id >= 0:
        tree["room"] = {"id": notice.room_id, "name": notice.room_name}
    if notice.place:
        tree["place"] = notice.place
    if notice.called_id >= 0:
        tree["called_by"] = {"id": notice.called_id, "name": notice.called_name}
    if notice.picture is not None and with_picture:
        data = base64.b64encode(notice.picture).decode("ascii")
        tree["picture"] = {"name": notice.picture_name, "type": "image/jpeg", "base64": data}
    return json.dumps(tree).encode("ascii")


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)
