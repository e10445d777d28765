"""A Maildir on this disk: each notice is one mail under new/, whole or not there, once for each id."""

from __future__ import annotations

import os
import socket
from email.policy import SMTP
from pathlib import Path

from rosbot_patrol.alerts.channels.channel import DeliveryError
from rosbot_patrol.alerts.channels.mail import Envelope, build_mail
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.safe_text import token
from rosbot_patrol.files import sync_folder


class MaildirTransport:
    """Stores mails.

    Args:
        folder: of the Maildir; made if it is missing.
        envelope: for the mails' headers.
    """

    name = "maildir"

    def __init__(self, folder: Path, envelope: Envelope) -> None:
        self.folder, self._envelope = folder, envelope

    def describe(self) -> str:
        """Where its mails go."""
        return f"the Maildir {self.folder}"

    def send(self, notice: Notice) -> str:
        """Store the mail, unless it is there already because a crash prevented the receipt; returns its path."""
        try:
            for part in ("tmp", "new", "cur"):
                (self.folder / part).mkdir(parents=True, exist_ok=True)
            for part in ("new", "cur"):
                for path in (self.folder / part).glob(f"{token(notice.id)}.P*"):
                    return str(path)
            mail = build_mail(notice, self._envelope)
            return self._store(notice.id, mail.as_bytes(policy=SMTP.clone(linesep="\n")))
        except OSError as err:
            raise DeliveryError(f"{self.describe()} does not take the mail: {err}") from err

    def _store(self, notice_id: str, data: bytes) -> str:
        host = socket.gethostname().replace("/", "_").replace(":", "_") or "localhost"
        # the id starts with the time in UTC, so names sort by it; ":" and "/" are not in it
        name = f"{token(notice_id)}.P{os.getpid()}.{host}"
        scratch, final = self.folder / "tmp" / name, self.folder / "new" / name
        with scratch.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        scratch.replace(final)
        sync_folder(final.parent)
        return str(final)
