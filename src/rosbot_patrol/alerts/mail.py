"""The mail about an incident: proper MIME, and nothing that a parameter or a room's name can inject.

Matches the tutorial's subject and first sentence. Differs: Date, Message-ID, character set, room, time, verdict and
the picture (the original writes three header lines and one sentence).
"""

from __future__ import annotations

import re
import time
from dataclasses import dataclass
from email.errors import HeaderParseError
from email.headerregistry import Address
from email.message import EmailMessage
from email.policy import SMTP
from email.utils import formatdate, getaddresses

from rosbot_patrol.alerts.incident import Incident
from rosbot_patrol.errors import ParamError

SUBJECT = "rosbot patrol node"
FIRST_SENTENCE = "I have found something strange it could be invader"

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


def build_mail(
    incident: Incident, envelope: Envelope, picture: bytes | None, *, picture_note: str = ""
) -> EmailMessage:
    """The mail about an incident.

    Args:
        incident: what happened.
        envelope: who to tell.
        picture: JPEG, None where there is none.
        picture_note: what to say about the picture, or why there is none.
    """
    mail = _empty_mail(SUBJECT, incident.id, incident.wall, envelope)
    mail["X-Rosbot-Patrol-Incident"] = token(incident.id)
    mail.set_content(_body(incident, picture_note), charset="utf-8")
    if picture is not None:
        name = f"room{incident.room_id}-{token(incident.id)}.jpg"
        mail.add_attachment(picture, maintype="image", subtype="jpeg", filename=name)
    return mail


def build_notice(notice_id: str, subject: str, text: str, envelope: Envelope, *, wall: float) -> EmailMessage:
    """A mail of plain text about something that is no incident.

    Args:
        notice_id: unlike any other's.
        subject: is made one line of at most 200 characters.
        text: as it is.
        envelope: who to tell.
        wall: when, seconds since 1970.
    """
    mail = _empty_mail(one_line(subject)[:200], notice_id, wall, envelope)
    mail["X-Rosbot-Patrol-Notice"] = token(notice_id)
    mail.set_content(text, charset="utf-8")
    return mail


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


def _body(incident: Incident, picture_note: str) -> str:
    when = time.strftime("%Y-%m-%d %H:%M:%S %Z", time.localtime(incident.wall))
    rows = [
        ("Room", f"{incident.room_id} ({incident.room_name})"),
        ("Time", f"{when} (robot's clock {incident.ros_time:.1f} s)"),
        ("Verdict", incident.verdict),
        (
            "Seen",
            f"{incident.object_class}, probability {incident.probability:.2f}, in {incident.pictures} pictures",
        ),
        ("Why", incident.reason),
    ]
    if incident.pose is not None:
        x, y, yaw = incident.pose
        rows.append(("Robot", f"x {x:.2f} m, y {y:.2f} m, heading {yaw:.2f} rad in the map"))
    rows.append(("Picture", picture_note or "attached"))
    rows.append(("Incident", incident.id))
    table = "\n".join(f"{key + ':':10}{one_line(value)}" for key, value in rows)
    return f"{FIRST_SENTENCE}.\n\n{table}\n"
