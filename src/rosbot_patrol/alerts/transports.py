"""How a mail leaves: sendmail, SMTP, or a Maildir on this disk.

A transport's `send` returns where the mail went, or raises `DeliveryError`; it never blocks longer than its time-out.
"""

from __future__ import annotations

import os
import smtplib
import socket
import ssl
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from email.message import EmailMessage
from email.policy import SMTP
from pathlib import Path
from typing import Protocol

from rosbot_patrol.alerts.mail import Envelope, token
from rosbot_patrol.errors import AlertError, ParamError
from rosbot_patrol.files import sync_folder
from rosbot_patrol.params import param

SENDMAILS = ("/usr/sbin/sendmail", "/usr/lib/sendmail")
PASSWORD_VARIABLE = "ROSBOT_PATROL_SMTP_PASSWORD"
_PERMANENT_EXITS = {65, 67, 68}  # sysexits.h: data error, no such user, no such host


class DeliveryError(AlertError):
    """A transport did not take a mail.

    Args:
        problem: what happened, and where.
        permanent: it is this mail's fault: others may pass.
    """

    def __init__(self, problem: str, *, permanent: bool = False) -> None:
        super().__init__(problem)
        self.permanent = permanent


class Transport(Protocol):
    """Takes mails."""

    name: str

    def describe(self) -> str:
        """Where its mails go, for people."""

    def send(self, incident_id: str, mail: EmailMessage) -> str:
        """Deliver; returns the place (a file or the addresses). Raises DeliveryError."""


@dataclass(frozen=True, kw_only=True)
class MailParams:
    """Whom to tell, and how."""

    email_to: str = param("", doc="recipients, with commas between (the tutorial's name)")
    email_from: str = param("", doc="sender (the tutorial's name)")
    transport: str = param(
        "auto",
        choices=("auto", "sendmail", "smtp", "maildir"),
        doc="auto: sendmail where email_to is a real address and a sendmail program is there, else maildir",
    )
    maildir: str = param("", doc="Maildir for mails on this disk; empty: rosbot_patrol/mail in ROS's home")
    sendmail: str = param("", doc="path of the sendmail program; empty: where it usually is")
    mail_interval: float = param(10.0, unit="s", lo=0.0, doc="least time between two mails; delays, never drops")
    mail_timeout: float = param(30.0, unit="s", lo=0.5, hi=600.0, doc="longest wait for a mail server or program")
    mail_retry: float = param(5.0, unit="s", lo=0.1, doc="wait after a failed delivery; doubles up to 900 s")
    smtp_host: str = param("localhost", doc="mail server")
    smtp_port: int = param(25, lo=1, hi=65535, doc="its port")
    smtp_security: str = param(
        "auto", choices=("auto", "none", "starttls", "tls"), doc="auto: starttls where it is offered"
    )
    smtp_user: str = param("", doc="login; empty: none")
    smtp_password_file: str = param(
        "", doc="file with the password, readable by its owner only; else the environment's " + PASSWORD_VARIABLE
    )


class MaildirTransport:
    """A Maildir on this disk: each mail is one file under new/, whole or not there, once for each incident."""

    name = "maildir"

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def describe(self) -> str:
        """Where its mails go."""
        return f"the Maildir {self.folder}"

    def send(self, incident_id: str, mail: EmailMessage) -> str:
        """Store the mail; the one that lies there already where a crash came between sending and crossing out."""
        try:
            for part in ("tmp", "new", "cur"):
                (self.folder / part).mkdir(parents=True, exist_ok=True)
            for part in ("new", "cur"):
                for path in (self.folder / part).glob(f"{token(incident_id)}.*"):
                    return str(path)
            return self._store(incident_id, mail.as_bytes(policy=SMTP.clone(linesep="\n")))
        except OSError as err:
            raise DeliveryError(f"{self.describe()} does not take the mail: {err}") from err

    def _store(self, incident_id: str, data: bytes) -> str:
        host = socket.gethostname().replace("/", "_").replace(":", "_") or "localhost"
        # the id starts with the time in UTC, so names sort by it; ":" and "/" are not in it
        name = f"{token(incident_id)}.P{os.getpid()}.{host}"
        scratch, final = self.folder / "tmp" / name, self.folder / "new" / name
        with scratch.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        scratch.replace(final)
        sync_folder(final.parent)
        return str(final)


class SendmailTransport:
    """A sendmail program (Postfix, sendmail, msmtp, ...); recipients are arguments, never read from the text."""

    name = "sendmail"

    def __init__(self, program: str, envelope: Envelope, timeout: float) -> None:
        self.program = program
        self._sender = envelope.sender.addr_spec
        self._to = [address.addr_spec for address in envelope.to]
        self._timeout = timeout

    def describe(self) -> str:
        """Where its mails go."""
        return f"{', '.join(self._to)} through {self.program}"

    def send(self, incident_id: str, mail: EmailMessage) -> str:
        """Hand the mail to the program."""
        command = [self.program, "-i", "-f", self._sender, "--", *self._to]
        data = mail.as_bytes(policy=SMTP.clone(linesep="\n"))
        try:
            done = subprocess.run(command, input=data, capture_output=True, timeout=self._timeout, check=False)
        except subprocess.TimeoutExpired as err:
            raise DeliveryError(f"{self.program} did not end within {self._timeout:g} s") from err
        except OSError as err:
            raise DeliveryError(f"{self.program} cannot be run: {err.strerror}") from err
        if done.returncode != 0:
            said = " ".join(done.stderr.decode("utf-8", "replace").split())[-300:] or "without a word"
            raise DeliveryError(
                f"{self.program} ended with {done.returncode}: {said}", permanent=done.returncode in _PERMANENT_EXITS
            )
        return ", ".join(self._to)


class SmtpTransport:
    """A mail server, with TLS and login where asked for."""

    name = "smtp"

    def __init__(self, params: MailParams, envelope: Envelope, password: str = "") -> None:
        self._params = params
        self._sender = envelope.sender.addr_spec
        self._to = [address.addr_spec for address in envelope.to]
        self._password = password
        self._where = f"{params.smtp_host}:{params.smtp_port}"

    def describe(self) -> str:
        """Where its mails go."""
        return f"{', '.join(self._to)} through the mail server {self._where}"

    def send(self, incident_id: str, mail: EmailMessage) -> str:
        """Send the mail over a new connection."""
        try:
            server = self._connect()
            try:
                refused = server.send_message(mail, from_addr=self._sender, to_addrs=self._to)
            finally:
                _hang_up(server)
        except smtplib.SMTPRecipientsRefused as err:
            code, text = next(iter(err.recipients.values()))
            raise DeliveryError(
                f"{self._where} refused every recipient: {_said(code, text)}", permanent=code >= 500
            ) from err
        except smtplib.SMTPAuthenticationError as err:
            raise DeliveryError(f"{self._where} refused the login: {_said(err.smtp_code, err.smtp_error)}") from err
        except (smtplib.SMTPSenderRefused, smtplib.SMTPDataError) as err:
            said = _said(err.smtp_code, err.smtp_error)
            raise DeliveryError(f"{self._where} refused the mail: {said}", permanent=err.smtp_code >= 500) from err
        except (OSError, smtplib.SMTPException) as err:
            raise DeliveryError(f"the mail server {self._where} cannot be used: {self._problem(err)}") from err
        if refused:
            taken = ", ".join(address for address in self._to if address not in refused)
            return f"{taken} (refused: {', '.join(refused)})"
        return ", ".join(self._to)

    def _problem(self, err: Exception) -> str:
        if isinstance(err, TimeoutError) or isinstance(err.__context__, TimeoutError):  # smtplib says "closed"
            return f"no answer within {self._params.mail_timeout:g} s"
        return str(err) or type(err).__name__

    def _connect(self) -> smtplib.SMTP:
        p = self._params
        context = ssl.create_default_context()
        server: smtplib.SMTP
        if p.smtp_security == "tls":
            server = smtplib.SMTP_SSL(p.smtp_host, p.smtp_port, timeout=p.mail_timeout, context=context)
        else:
            server = smtplib.SMTP(p.smtp_host, p.smtp_port, timeout=p.mail_timeout)
        try:
            server.ehlo_or_helo_if_needed()
            offered = server.has_extn("starttls")
            if p.smtp_security == "starttls" or (p.smtp_security == "auto" and offered):
                server.starttls(context=context if p.smtp_security == "starttls" else _any_certificate())
            if p.smtp_user:
                server.login(p.smtp_user, self._password)
        except (OSError, smtplib.SMTPException):
            server.close()
            raise
        return server


def _hang_up(server: smtplib.SMTP) -> None:
    # The mail is taken, or refused, by now: a peer that does not say good-bye changes nothing.
    try:
        server.quit()
    except (OSError, smtplib.SMTPException):
        server.close()


def _any_certificate() -> ssl.SSLContext:
    # Opportunistic: better than clear text, which is what "auto" means without it. Never with a login (make_transport).
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context


def _said(code: int, text: bytes | str) -> str:
    words = text.decode("utf-8", "replace") if isinstance(text, bytes) else text
    return f"{code} {' '.join(words.split())}"


def find_sendmail(params: MailParams) -> str | None:
    """The sendmail program, None where there is none."""
    candidates = (params.sendmail,) if params.sendmail else SENDMAILS
    return next((path for path in candidates if os.access(path, os.X_OK)), None)


def make_transport(
    params: MailParams, envelope: Envelope, *, home: Path, environ: Mapping[str, str], prefix: str = "~"
) -> Transport:
    """The transport that the parameters name.

    Args:
        params: checked.
        envelope: who is told.
        home: of ROS on this machine, for the default Maildir.
        environ: for the password.
        prefix: of the parameters' names in messages.

    Raises:
        ParamError: what it needs is not there.
    """
    kind = params.transport
    sendmail = find_sendmail(params)
    if kind == "auto":
        kind = "sendmail" if envelope.is_real and sendmail else "maildir"
    if kind == "maildir":
        folder = Path(params.maildir).expanduser() if params.maildir else home / "rosbot_patrol" / "mail"
        return MaildirTransport(folder)
    if not envelope.is_real:
        raise ParamError(prefix + "email_to", f"expected a real address for {kind}, got {params.email_to!r}")
    if kind == "sendmail":
        if sendmail is None:
            raise ParamError(prefix + "sendmail", f"no program at {params.sendmail or ' or '.join(SENDMAILS)}")
        return SendmailTransport(sendmail, envelope, params.mail_timeout)
    if params.smtp_user and params.smtp_security not in ("starttls", "tls"):
        raise ParamError(prefix + "smtp_security", "expected starttls or tls where smtp_user is given")
    return SmtpTransport(params, envelope, read_password(params, environ, prefix=prefix) if params.smtp_user else "")


def read_password(params: MailParams, environ: Mapping[str, str], *, prefix: str = "~") -> str:
    """The password from its file or the environment; raises ParamError."""
    name = prefix + "smtp_password_file"
    if not params.smtp_password_file:
        if not environ.get(PASSWORD_VARIABLE):
            raise ParamError(name, f"smtp_user needs a password, from this file or the variable {PASSWORD_VARIABLE}")
        return environ[PASSWORD_VARIABLE]
    path = Path(params.smtp_password_file).expanduser()
    try:
        if path.stat().st_mode & 0o077:
            raise ParamError(name, f"{path} can be read by others, expected mode 600")
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as err:
        raise ParamError(name, f"{path} cannot be read: {err}") from err
    if not lines or not lines[0]:
        raise ParamError(name, f"{path} is empty")
    return lines[0]
