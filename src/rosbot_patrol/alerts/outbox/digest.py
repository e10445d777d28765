"""Digests: several notices in one message."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence

from rosbot_patrol.alerts.outbox.notice import Notice

WHOLE = 10  # largest number of notices that are told in full
LISTED = 300  # largest number of notices that are listed


def merge(notices: Sequence[Notice]) -> Notice:
    """One notice that tells several, oldest first; the same notices always give the same id."""
    names = hashlib.sha256("\n".join(notice.id for notice in notices).encode()).hexdigest()[:12]
    return Notice(
        id=f"{notices[-1].id[:120]}-digest-{names}",
        wall=notices[-1].wall,
        kind="digest",
        subject=f"rosbot patrol: {len(notices)} notices",
        text=_text(notices),
    )


def _text(notices: Sequence[Notice]) -> str:
    head = f"{len(notices)} notices came close together, so they are told in one."
    if len(notices) <= WHOLE:
        parts = [f"{_when(notice)}  {notice.subject}\n\n{notice.text.strip()}" for notice in notices]
        return "\n\n\n".join([head, *parts])
    lines = [f"{_when(notice)}  {notice.subject}" for notice in notices[:LISTED]]
    if len(notices) > LISTED:
        lines.append(f"... and {len(notices) - LISTED} more, which lie in the folder 'sent' of the outbox.")
    return "\n".join([head, "", *lines])


def _when(notice: Notice) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(notice.wall))
