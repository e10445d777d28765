"""Parameters of the channels: the tutorial's own with its relatives, and the keys of the file of channels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

from rosbot_patrol.alerts.channels.transports.webhook import check_url
from rosbot_patrol.params import param

KINDS = ("incident", "verdict", "sensor", "fault", "test")
PASSWORD_VARIABLE = "ROSBOT_PATROL_SMTP_PASSWORD"
MAIL_STYLES = ("plain", "tutorial")
_SECURITY = ("auto", "none", "starttls", "tls")


def _check_console(value: str) -> str | None:
    """Problem of the console's address, None if it is one or empty."""
    parts = urlsplit(value)
    if not value or (parts.scheme in ("http", "https") and parts.netloc and value.isprintable() and " " not in value):
        return None
    return f"is {value!r}, expected an address such as http://robot.local:8420"


@dataclass(frozen=True, kw_only=True)
class MailParams:
    """Recipients of the notices, and how mail is sent."""

    email_to: str = param("", doc="recipients, separated by commas (the tutorial's name)")
    email_from: str = param("", doc="sender (the tutorial's name)")
    transport: str = param(
        "auto",
        choices=("auto", "sendmail", "smtp", "maildir"),
        doc="way of sending; auto: sendmail if email_to is a real address and sendmail is installed, else maildir",
    )
    maildir: str = param("", doc="Maildir for mails on this disk; empty: rosbot_patrol/mail in ROS's home")
    sendmail: str = param("", doc="path of the sendmail program; empty: the usual places")
    mail_style: str = param(
        "plain", choices=MAIL_STYLES, doc="plain: subject says what and where; tutorial: its own subject and sentence"
    )
    mail_interval: float = param(10.0, unit="s", lo=0.0, doc="minimum time between two mails; delays mails, drops none")
    mail_timeout: float = param(
        30.0, unit="s", lo=0.5, hi=600.0, doc="longest wait for an answer of a mail server or program"
    )
    mail_retry: float = param(5.0, unit="s", lo=0.1, hi=900.0, doc="wait after a failed delivery; doubles up to 900 s")
    smtp_host: str = param("localhost", doc="mail server")
    smtp_port: int = param(25, lo=1, hi=65535, doc="port of the mail server")
    smtp_security: str = param("auto", choices=_SECURITY, doc="encryption; auto: STARTTLS if the server offers it")
    smtp_user: str = param("", doc="login; empty: none")
    smtp_password_file: str = param(
        "", doc="file with the password, readable only by its owner; empty: environment variable " + PASSWORD_VARIABLE
    )
    smtp_ca_file: str = param("", doc="CA file for a server certificate that the system does not trust")
    smtp_allow_plaintext: bool = param(
        False, doc="allow sending the login without TLS (smtp_security: none) to another machine"
    )
    channels: str = param("", doc="file of further channels (docs/alerts.md); empty: none")
    console_url: str = param(
        "",
        doc="address of the console as the owner's phone reaches it, for links in notices; empty: no links",
        check=_check_console,
    )
    notify_verdicts: list[str] = param(
        [],
        choices=("clear", "unreachable", "unverified"),
        doc="verdicts that notify the owner; a confirmed sighting always does (patrol_robot)",
    )


@dataclass(frozen=True, kw_only=True)
class ChannelSpec:
    """Keys that every channel of the file has."""

    type: str = param(choices=("sendmail", "smtp", "maildir", "webhook", "apprise"), doc="type of the channel")
    kinds: list[str] = param([], choices=KINDS, doc="kinds of notices it sends; empty: all")
    interval: float = param(
        10.0, unit="s", lo=0.0, doc="minimum time between two messages; delays messages, drops none"
    )
    retry: float = param(5.0, unit="s", lo=0.1, hi=900.0, doc="wait after a failed delivery; doubles up to 900 s")
    timeout: float = param(30.0, unit="s", lo=0.5, hi=600.0, doc="longest wait for an answer")


@dataclass(frozen=True, kw_only=True)
class MaildirSpec(ChannelSpec):
    """A Maildir on this disk."""

    folder: str = param("", doc="folder of the Maildir; empty: rosbot_patrol/mail in ROS's home")
    to: str = param("", doc="recipients in the mail headers")
    sender: str = param("", name="from", doc="sender in the mail headers")
    style: str = param("plain", choices=MAIL_STYLES, doc="plain: subject says what and where; tutorial: its own")


@dataclass(frozen=True, kw_only=True)
class SendmailSpec(ChannelSpec):
    """A sendmail program."""

    to: str = param(doc="recipients, separated by commas")
    sender: str = param("", name="from", doc="sender")
    style: str = param("plain", choices=MAIL_STYLES, doc="plain: subject says what and where; tutorial: its own")
    program: str = param("", doc="path of the program; empty: the usual places")


@dataclass(frozen=True, kw_only=True)
class SmtpSpec(ChannelSpec):
    """A mail server."""

    to: str = param(doc="recipients, separated by commas")
    sender: str = param("", name="from", doc="sender")
    style: str = param("plain", choices=MAIL_STYLES, doc="plain: subject says what and where; tutorial: its own")
    host: str = param("localhost", doc="mail server")
    port: int = param(25, lo=1, hi=65535, doc="port of the mail server")
    security: str = param("auto", choices=_SECURITY, doc="encryption; auto: STARTTLS if the server offers it")
    user: str = param("", doc="login; empty: none")
    password_file: str = param("", doc="file with the password, of mode 600")
    password_env: str = param("", doc="environment variable with the password")
    ca_file: str = param("", doc="CA file for a server certificate that the system does not trust")
    allow_plaintext: bool = param(False, doc="allow sending the login without TLS (security: none) to another machine")


@dataclass(frozen=True, kw_only=True)
class WebhookSpec(ChannelSpec):
    """A web address that accepts JSON."""

    url: str = param(doc="http or https address; path and query are kept secret", check=check_url)
    picture: bool = param(True, doc="send the picture, in base64")
    secret_file: str = param("", doc="file with the signing secret, of mode 600")
    secret_env: str = param("", doc="environment variable with the signing secret")
    token_file: str = param("", doc="file with a bearer token, of mode 600")
    token_env: str = param("", doc="environment variable with the bearer token")
    ca_file: str = param("", doc="CA file for a server certificate that the system does not trust")
    allow_plaintext: bool = param(False, doc="allow sending the token over plain http to another machine")


@dataclass(frozen=True, kw_only=True)
class AppriseSpec(ChannelSpec):
    """A service that Apprise knows, such as ntfy, Pushover, Telegram, Signal, Matrix or Slack."""

    url_file: str = param("", doc="file with the service's Apprise address, of mode 600")
    url_env: str = param("", doc="environment variable with the service's Apprise address")
    picture: bool = param(True, doc="send the picture, if the service takes one")


SPECS: Mapping[str, type[ChannelSpec]] = {
    "apprise": AppriseSpec,
    "maildir": MaildirSpec,
    "sendmail": SendmailSpec,
    "smtp": SmtpSpec,
    "webhook": WebhookSpec,
}
