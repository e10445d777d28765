"""SMTP transport: a mail server, with TLS and login if asked for."""

from __future__ import annotations

import base64
import smtplib
import socket
import ssl
from dataclasses import dataclass

from rosbot_patrol.alerts.channels.channel import DeliveryError, FailureCause
from rosbot_patrol.alerts.channels.mail import Envelope, build_mail
from rosbot_patrol.alerts.channels.masking import Mask
from rosbot_patrol.alerts.channels.network_words import WHOLE_EXCHANGE, Deadline, StarttlsMissing, explain
from rosbot_patrol.alerts.outbox.notice import Notice


@dataclass(frozen=True, kw_only=True)
class SmtpServer:
    """Where the server is and how it is spoken to.

    Attributes:
        host, port: of the server.
        security: "auto" (STARTTLS if it is offered), "none", "starttls", "tls".
        user, password: of the login; an empty user for none.
        timeout: for each answer [s].
        ca_file: certificates to trust besides the system's; "" for none.
    """

    host: str = "localhost"
    port: int = 25
    security: str = "auto"
    user: str = ""
    password: str = ""
    timeout: float = 30.0
    ca_file: str = ""


class SmtpTransport:
    """Sends mails over a new connection each.

    Args:
        server: where.
        envelope: sender and one recipient, since SMTP answers for each recipient by itself.
    """

    name = "smtp"

    def __init__(self, server: SmtpServer, envelope: Envelope) -> None:
        self._server, self._envelope = server, envelope
        self._sender, self._to = envelope.sender.addr_spec, envelope.recipient
        self._where = f"{server.host}:{server.port}"
        self._mask = Mask([server.password, *map(_coded, (server.password, _plain(server.user, server.password)))])

    def describe(self) -> str:
        """Where its mails go."""
        return f"{self._to} through the mail server {self._where}"

    def send(self, notice: Notice) -> str:
        """Send the mail."""
        try:
            self._send(notice)
        except smtplib.SMTPRecipientsRefused as err:
            code, text = err.recipients[self._to]
            problem = f"{self._where} refused the recipient {self._to}: {self._said(code, text)}"
            raise DeliveryError(
                problem, permanent=code >= 500, answered=True, of_recipient=True, cause=FailureCause.RECIPIENT
            ) from err
        except smtplib.SMTPAuthenticationError as err:
            said = self._said(err.smtp_code, err.smtp_error)
            raise DeliveryError(f"{self._where} refused the login: {said}", cause=FailureCause.LOGIN) from err
        except (smtplib.SMTPSenderRefused, smtplib.SMTPDataError) as err:
            said = self._said(err.smtp_code, err.smtp_error)
            permanent = err.smtp_code >= 500
            raise DeliveryError(f"{self._where} refused the mail: {said}", permanent=permanent, answered=True) from err
        except (OSError, smtplib.SMTPException, ValueError) as err:
            cause, problem = explain(err, self._where, self._server.timeout, mask=self._mask)
            raise DeliveryError(f"the mail server {self._where} cannot be used: {problem}", cause=cause) from err
        return self._to

    def _said(self, code: int, text: bytes | str) -> str:
        words = text.decode("utf-8", "replace") if isinstance(text, bytes) else text
        return f"{code} {self._mask(' '.join(words.split()))}"

    def _send(self, notice: Notice) -> None:
        mail = build_mail(notice, self._envelope)
        server = self._client()
        with Deadline(WHOLE_EXCHANGE * self._server.timeout, lambda: server.sock):
            try:
                self._greet(server)
                server.send_message(mail, from_addr=self._sender, to_addrs=[self._to])
            except (OSError, smtplib.SMTPException, ValueError):
                server.close()
                raise
        _hang_up(server)

    def _client(self) -> smtplib.SMTP:
        name = self._envelope.sender.domain or "localhost"  # smtplib itself would ask the DNS for ours
        if self._server.security == "tls":
            return smtplib.SMTP_SSL(timeout=self._server.timeout, context=self._context(), local_hostname=name)
        return smtplib.SMTP(timeout=self._server.timeout, local_hostname=name)

    def _greet(self, server: smtplib.SMTP) -> None:
        s = self._server
        server._host = s.host  # type: ignore[attr-defined]  # noqa: SLF001 - the name that starttls() verifies
        code, text = server.connect(s.host, s.port)
        if code != 220:
            raise smtplib.SMTPConnectError(code, text)
        server.ehlo_or_helo_if_needed()
        has_starttls = server.has_extn("starttls")
        if s.security == "starttls" and not has_starttls:
            raise StarttlsMissing("STARTTLS extension not supported by server.")
        if s.security in ("starttls", "auto") and has_starttls:
            server.starttls(context=self._context() if s.security == "starttls" else _any_certificate())
            server.ehlo_or_helo_if_needed()
        if s.user:
            _login(server, s.user, s.password)

    def _context(self) -> ssl.SSLContext:
        context = ssl.create_default_context()
        if self._server.ca_file:
            context.load_verify_locations(self._server.ca_file)
        return context


def _login(server: smtplib.SMTP, user: str, password: str) -> None:
    # smtplib's own takes ASCII only, and after a refusal goes on with other mechanisms, which servers count as attacks
    if "PLAIN" not in server.esmtp_features.get("auth", "").upper().split():
        server.login(user, password)
        return
    code, text = server.docmd("AUTH", f"PLAIN {_coded(_plain(user, password))}")
    if code not in (235, 503):  # 503: it takes us for logged in already
        raise smtplib.SMTPAuthenticationError(code, text)


def _plain(user: str, password: str) -> str:
    return f"\0{user}\0{password}" if user else ""


def _coded(text: str) -> str:
    return base64.b64encode(text.encode()).decode("ascii")


def _hang_up(server: smtplib.SMTP) -> None:
    # The mail is taken by now: a peer that does not say good-bye changes nothing, and is not waited for.
    try:
        if server.sock is not None:
            server.sock.settimeout(min(1.0, server.sock.gettimeout() or 1.0))
        server.quit()
    except (OSError, smtplib.SMTPException):
        server.close()


def _any_certificate() -> ssl.SSLContext:
    # Opportunistic: better than the clear text that "auto" would send otherwise. Never with a login.
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context


def resolve(host: str, port: int) -> list[str]:
    """The addresses of a host, for people. Raises OSError."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    return sorted({str(entry[4][0]) for entry in found})
