"""Network failures: their cause, a clause that says what to look at, and a limit on the whole exchange."""

from __future__ import annotations

import errno
import http.client
import ipaddress
import smtplib
import socket
import ssl
import threading
from collections.abc import Callable
from types import TracebackType

from rosbot_patrol.alerts.channels.channel import FailureCause

WHOLE_EXCHANGE = 4.0  # limit of a whole exchange, in time-outs of one answer


class StarttlsMissing(smtplib.SMTPNotSupportedError):
    """The server does not offer STARTTLS, which the configuration demands."""


def explain(
    err: BaseException, where: str, timeout: float, *, mask: Callable[[str], str] = str
) -> tuple[FailureCause, str]:
    """Cause of a network failure, and one clause about it, without a full stop.

    Args:
        err: the failure.
        where: host and port.
        timeout: that was given for each answer [s].
        mask: hides secrets in the other side's words.
    """
    host = where.rpartition(":")[0]
    if isinstance(err, socket.gaierror):
        text = f"the name '{host}' cannot be found (DNS: {err.strerror}); is it right, and is the network up?"
        return FailureCause.UNKNOWN_HOST, text
    if isinstance(err, ssl.SSLCertVerificationError):
        return FailureCause.CERTIFICATE, f"its TLS certificate is not to be trusted: {err.verify_message}"
    if isinstance(err, TimeoutError) or isinstance(err.__context__, TimeoutError):  # smtplib says "closed"
        return FailureCause.NO_ANSWER, f"no answer within {timeout:g} s"
    if isinstance(err, ssl.SSLError):
        said = err.reason or mask(str(err))
        return FailureCause.NO_TLS, f"it does not speak TLS as it should ({said}); is that its TLS port?"
    if isinstance(err, ConnectionRefusedError):
        text = f"[Errno {errno.ECONNREFUSED}] Connection refused: nothing listens there"
        return FailureCause.CONNECTION_REFUSED, text
    if isinstance(err, smtplib.SMTPNotSupportedError):
        cause = FailureCause.NO_STARTTLS if isinstance(err, StarttlsMissing) else FailureCause.OTHER
        return cause, f"it does not offer what is asked for: {_tidy(err, mask)}"
    if isinstance(err, (smtplib.SMTPServerDisconnected, http.client.RemoteDisconnected, ConnectionResetError)):
        return FailureCause.OTHER, f"it closed the connection ({_tidy(err, mask)})"
    return FailureCause.OTHER, _tidy(err, mask)


def is_loopback(host: str) -> bool:
    """Whether data for a host stays on this machine."""
    name = host.strip("[]").rstrip(".").lower()
    if name == "localhost" or name.endswith(".localhost"):  # RFC 6761, 6.3
        return True
    try:
        address = ipaddress.ip_address(name)
    except ValueError:
        return False
    mapped = getattr(address, "ipv4_mapped", None)
    return bool((mapped or address).is_loopback)


class Deadline:
    """Cuts a connection off that has taken too long in all, as one does that sends a byte now and then.

    Args:
        seconds: for the whole exchange.
        socket_of: gives the socket, None before there is one.
    """

    def __init__(self, seconds: float, socket_of: Callable[[], socket.socket | None]) -> None:
        self._seconds, self._socket_of = seconds, socket_of
        self._timer = threading.Timer(seconds, self._cut)
        self._timer.daemon = True
        self._is_over = False

    def __enter__(self) -> Deadline:
        self._timer.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._timer.cancel()
        if self._is_over and isinstance(value, Exception):
            raise TimeoutError(f"not done within {self._seconds:g} s") from value

    def _cut(self) -> None:
        self._is_over = True
        connection = self._socket_of()
        if connection is not None:
            try:
                connection.shutdown(socket.SHUT_RDWR)
            except OSError:
                return  # it is closed already


def _tidy(err: BaseException, mask: Callable[[str], str]) -> str:
    return mask(" ".join(str(err).split()))[:300] or type(err).__name__
