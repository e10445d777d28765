"""The mail of a notice: proper MIME, and nothing that a parameter or a room's name can inject.

Differs from the tutorial: subject and first line say what was seen and where (`mail_style: tutorial` gives the
original's); Date, Message-ID, character set, room, time, verdict and the picture (the original writes three header
lines and one sentence).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from email.errors import HeaderParseError
from email.headerregistry import Address
from email.message import EmailMessage
from email.policy import SMTP
from email.utils import formatdate, getaddresses

from rosbot_patrol.alerts.channels.mail_html import html_page
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.safe_text import one_line, token
from rosbot_patrol.errors import ParamError

SUBJECT = "rosbot patrol node"  # the tutorial's own
FIRST_SENTENCE = "I have found something strange it could be invader"

_POLICY = SMTP.clone(cte_type="7bit")  # for servers that do not know 8BITMIME
_USER = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._+-]*")  # a user of this machine
_HOST = re.compile(r"(?!-)[A-Za-z0-9-]{1,63}(?<!-)(\.(?!-)[A-Za-z0-9-]{1,63}(?<!-))*")


@dataclass(frozen=True, kw_only=True)
class Envelope:
    """Sender and recipients, checked.

    Attributes:
        sender: of the mail.
        to: all recipients, for the mail's header; nobody twice.
        only: recipient of this copy; None if there is only one recipient.
        is_tutorial: mails about incidents begin with the tutorial's subject and sentence.
    """

    sender: Address
    to: tuple[Address, ...]
    only: Address | None = None
    is_tutorial: bool = False

    def copies(self) -> list[Envelope]:
        """One envelope for each recipient, so that a refusal or delay by one concerns no other."""
        return [replace(self, only=address) for address in self.to]

    @property
    def recipient(self) -> str:
        """Address of the one recipient of this copy.

        Raises:
            ValueError: there are several, and none was chosen.
        """
        if self.only is None and len(self.to) != 1:
            raise ValueError(f"expected one recipient, got {len(self.to)}: use `copies`")
        return (self.only or self.to[0]).addr_spec

    @property
    def is_real(self) -> bool:
        """Whether every recipient could be someone's, other than the tutorial's `*****@****.***`."""
        return bool(self.to) and all(map(_is_real, self.to))


def parse_addresses(name: str, text: str) -> tuple[Address, ...]:
    """The addresses of a parameter: one or several, with commas between; each once.

    Args:
        name: of the parameter, for the message.
        text: "" gives none.

    Raises:
        ParamError: a line break, a control character, or something that is no address.
    """
    if not text.isprintable():
        raise ParamError(name, f"has a line break or control character: {text!r}")
    if not text.strip():
        return ()
    parts = [part.strip() for part in text.split(",")]
    found: dict[tuple[str, str], Address] = {}
    for display, spec in getaddresses([text]):
        if not spec.isascii():
            hint = "only ASCII letters are possible in it; a domain with others is written as xn--..."
            raise ParamError(name, f"expected a mail address, got {text!r}: {hint}")
        try:
            is_local = spec in parts and _USER.fullmatch(spec)
            address = Address(display, spec) if is_local else Address(display, addr_spec=spec)
        except (HeaderParseError, ValueError, IndexError) as err:
            raise ParamError(name, f"expected a mail address, got {text!r}") from err
        if not address.username or address.username.startswith("-"):
            raise ParamError(name, f"expected a mail address, got {text!r}")
        # the domain has no case (RFC 5321, 2.4); the part before it may have
        found.setdefault((address.username, address.domain.lower()), address)
    return tuple(found.values())


def make_envelope(
    to_text: str, from_text: str, *, names: tuple[str, str] = ("~email_to", "~email_from"), host: str = "localhost"
) -> Envelope:
    """Sender and recipients.

    Args:
        to_text: recipients, with commas between.
        from_text: sender; if it is no real address, one that servers take replaces it.
        names: of the two parameters, for messages.
        host: of this machine.

    Raises:
        ParamError: something that is no address.
    """
    to = parse_addresses(names[0], to_text)
    sender = parse_addresses(names[1], from_text)
    if len(sender) > 1:
        raise ParamError(names[1], f"expected one address, got {from_text!r}")
    domain = host if _HOST.fullmatch(host) else "localhost"
    fallback = Address("rosbot patrol", "rosbot_patrol", domain)
    return Envelope(sender=sender[0] if sender and _is_real(sender[0]) else fallback, to=to)


def build_mail(notice: Notice, envelope: Envelope) -> EmailMessage:
    """The mail that tells a notice: plain text, the same as a page for phones, and the picture shown in it.

    Args:
        notice: the content; nothing in it can add a header or a line to the table of facts.
        envelope: sender and recipients.
    """
    if envelope.is_tutorial and notice.kind == "incident":
        notice = replace(notice, subject=SUBJECT, text=f"{FIRST_SENTENCE}.\n\n{notice.text}")
    mail = _empty_mail(one_line(notice.subject)[:200], notice.id, notice.wall, envelope)
    mail["X-Rosbot-Patrol-Kind"] = token(notice.kind)
    if notice.incident:
        mail["X-Rosbot-Patrol-Incident"] = token(notice.incident)
    else:
        mail["X-Rosbot-Patrol-Notice"] = token(notice.id)
    mail["MIME-Version"] = "1.0"
    if notice.picture is None:
        _set_texts(mail, notice)
        return mail
    cid = f"picture.{token(notice.id)}@{envelope.sender.domain or 'localhost'}"
    texts = EmailMessage(policy=_POLICY)
    _set_texts(texts, notice, picture_cid=cid)
    del texts["MIME-Version"]  # it is said at the top
    mail.make_related()
    mail.set_param("type", "multipart/alternative")
    mail.attach(texts)
    name = token(notice.picture_name)[:100]
    mail.add_related(
        notice.picture, maintype="image", subtype="jpeg", filename=name, cid=f"<{cid}>", disposition="inline"
    )
    return mail


def _set_texts(part: EmailMessage, notice: Notice, picture_cid: str = "") -> None:
    part.set_content(plain_text(notice), charset="utf-8")
    part.add_alternative(html_page(notice, picture_cid), subtype="html", charset="utf-8")


def plain_text(notice: Notice) -> str:
    """What a notice says, for a reader of plain text."""
    text = "\n".join("".join(c if c.isprintable() else " " for c in line) for line in _lines(notice.text)).rstrip()
    table = "\n".join(f"{one_line(key) + ':':10}{one_line(value)}" for key, value in notice.facts)
    return "\n\n".join(part for part in (text, one_line(notice.link), table) if part) + "\n"


def _empty_mail(subject: str, mail_id: str, wall: float, envelope: Envelope) -> EmailMessage:
    mail = EmailMessage(policy=_POLICY)
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


def _lines(text: str) -> list[str]:
    return text.replace("\r\n", "\n").split("\n")


def _is_real(address: Address) -> bool:
    return "*" not in address.addr_spec and (not address.domain or bool(_HOST.fullmatch(address.domain)))
