"""The mail of a notice: proper MIME, and nothing that a parameter or a room's name can inject.

Differs from the tutorial: Date, Message-ID, character set, room, time, verdict and the picture (the original writes
three header lines and one sentence).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from email.errors import HeaderParseError
from email.headerregistry import Address
from email.message import EmailMessage
from email.policy import SMTP
from email.utils import formatdate, getaddresses

from rosbot_patrol.alerts.notice import Notice
from rosbot_patrol.errors import ParamError

_USER = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._+-]*")  # a user of this machine
_HOST = re.compile(r"(?!-)[A-Za-z0-9-]{1,63}(?<!-)(\.(?!-)[A-Za-z0-9-]{1,63}(?<!-))*")


@dataclass(frozen=True, kw_only=True)
class Envelope:
    """Sender and recipients, checked."""

    sender: Address
    to: tuple[Address, ...]

    @property
    def is_real(self) -> bool:
        """Whether every recipient could be someone's, other than the tutorial's `*****@****.***`."""
        return bool(self.to) and all(map(_is_real, self.to))


def parse_addresses(name: str, text: str) -> tuple[Address, ...]:
    """The addresses of a parameter: one or several, with commas between.

    Args:
        name: of the parameter, for the message.
        text: "" gives none.

    Raises:
        ParamError: a line break, a control character, or something that is no address.
    """
    if any(ord(c) < 32 or ord(c) == 127 for c in text):
        raise ParamError(name, f"has a line break or control character: {text!r}")
    if not text.strip():
        return ()
    parts = [part.strip() for part in text.split(",")]
    found = []
    for display, spec in getaddresses([text]):
        try:
            is_local = spec in parts and _USER.fullmatch(spec)
            address = Address(display, spec) if is_local else Address(display, addr_spec=spec)
        except (HeaderParseError, ValueError, IndexError) as err:
            raise ParamError(name, f"expected a mail address, got {text!r}") from err
        if not address.username or address.username.startswith("-") or not address.addr_spec.isascii():
            raise ParamError(name, f"expected a mail address, got {text!r}")
        found.append(address)
    return tuple(found)


def make_envelope(email_to: str, email_from: str, *, prefix: str = "~", host: str = "localhost") -> Envelope:
    """Sender and recipients from the tutorial's two parameters; raises ParamError."""
    to = parse_addresses(prefix + "email_to", email_to)
    sender = parse_addresses(prefix + "email_from", email_from)
    if len(sender) > 1:
        raise ParamError(prefix + "email_from", f"expected one address, got {email_from!r}")
    domain = host if _HOST.fullmatch(host) else "localhost"
    fallback = Address("rosbot patrol", "rosbot_patrol", domain)
    return Envelope(sender=sender[0] if sender and _is_real(sender[0]) else fallback, to=to)


def build_mail(notice: Notice, envelope: Envelope) -> EmailMessage:
    """The mail that tells a notice.

    Args:
        notice: what happened; nothing in it can add a header or a line to the table of facts.
        envelope: who to tell.
    """
    mail = _empty_mail(one_line(notice.subject)[:200], notice.id, notice.wall, envelope)
    if notice.incident:
        mail["X-Rosbot-Patrol-Incident"] = token(notice.incident)
    else:
        mail["X-Rosbot-Patrol-Notice"] = token(notice.id)
    mail.set_content(plain_text(notice), charset="utf-8")
    if notice.picture is not None:
        name = token(notice.picture_name)
        mail.add_attachment(notice.picture, maintype="image", subtype="jpeg", filename=name)
    return mail


def plain_text(notice: Notice) -> str:
    """What a notice says, for a reader of plain text."""
    text = notice.text.rstrip("\n")
    table = "\n".join(f"{one_line(key) + ':':10}{one_line(value)}" for key, value in notice.facts)
    return f"{text}\n\n{table}\n" if table else f"{text}\n"


def _empty_mail(subject: str, mail_id: str, wall: float, envelope: Envelope) -> EmailMessage:
    mail = EmailMessage(policy=SMTP)
    mail["Subject"] = subject
    mail["From"] = envelope.sender
    if envelope.to:
        mail["To"] = envelope.to
    else:
        mail["To"] = "undisclosed-recipients:;"
    mail["Date"] = formatdate(wall, localtime=True)
    mail["Message-ID"] = f"<{token(mail_id)}@{envelope.sender.domain or 'localhost'}>"
    mail["Auto-Submitted"] = "auto-generated"
    return mail


def token(text: str) -> str:
    """The text as something that a header or a file's name may hold."""
    return re.sub(r"[^A-Za-z0-9.+-]", "_", text).strip(".") or "none"


def one_line(text: str) -> str:
    """The text without line breaks and control characters."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _is_real(address: Address) -> bool:
    return "*" not in address.addr_spec and (not address.domain or bool(_HOST.fullmatch(address.domain)))
