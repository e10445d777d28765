"""What the version before left waiting: whole mails (.eml) in one outbox for each program. They become notices."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable
from email import message_from_bytes
from email.message import EmailMessage
from email.policy import default
from email.utils import parsedate_to_datetime
from pathlib import Path

from rosbot_patrol.alerts.post.notice import Notice
from rosbot_patrol.alerts.post.outbox import Outbox
from rosbot_patrol.counts import count_of

log = logging.getLogger(__name__)

_NAME = re.compile(r"\d{12}-(?P<id>[A-Za-z0-9._+-]+)\.(?:eml|adopting)")


def adopt_mails(outbox: Outbox, folders: Iterable[Path]) -> int:
    """Make notices of the mails that wait in `folders`, in order; returns how many. Raises OSError.

    A mail is removed once its notice is on disk, so that a crash at any point loses none and doubles none.
    """
    count = 0
    for folder in folders:
        for path in sorted((*folder.glob("*.eml"), *folder.glob("*.adopting"))):
            found = _NAME.fullmatch(path.name)
            if found is None:
                log.warning("%s does not look like a waiting mail and is left alone", path)
                continue
            try:
                notice = _notice_of(found["id"], path)
            except (ValueError, LookupError) as err:
                aside = path.replace(path.with_suffix(".broken"))
                log.error("%s is no mail (%s), set aside as %s", path, err, aside)
                continue
            hidden = path.replace(path.with_suffix(".adopting"))  # as .eml it counts as known, and would not be put
            outbox.put(notice)
            hidden.unlink()
            count += 1
    if count:
        one, many = "mail that the version before left waiting is", "mails that the version before left waiting are"
        log.info("%s in the outbox now", count_of(count, one, many))
    return count


def _notice_of(notice_id: str, path: Path) -> Notice:
    mail = message_from_bytes(path.read_bytes(), policy=default)
    if not isinstance(mail, EmailMessage) or not mail["Message-ID"] or not mail["From"]:
        raise ValueError("it has no Message-ID or no sender")
    body = mail.get_body(("plain",))
    pictures = [part for part in mail.iter_attachments() if part.get_content_type() == "image/jpeg"]
    incident = str(mail["X-Rosbot-Patrol-Incident"] or "")
    return Notice(
        id=notice_id,
        wall=parsedate_to_datetime(str(mail["Date"])).timestamp(),
        kind="incident" if incident else "sensor",
        subject=str(mail["Subject"]),
        text=body.get_content() if body else "",
        incident=incident,
        verdict="confirmed" if incident else "",
        picture=pictures[0].get_content() if pictures else None,
        picture_name=pictures[0].get_filename() or "picture.jpg" if pictures else "picture.jpg",
    )
