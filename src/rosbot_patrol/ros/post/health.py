"""Health of the post, on /diagnostics and on the disk: each channel, the delivering node, undelivered notices."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.dispatch.delivery import ChannelStatus
from rosbot_patrol.alerts.dispatch.dispatcher import Dispatcher
from rosbot_patrol.alerts.dispatch.settings_file import differences
from rosbot_patrol.alerts.dispatch.status_file import read_status
from rosbot_patrol.counts import count_of
from rosbot_patrol.ros.runtime.diagnostics import ERROR, OK, WARN, Health

OVERDUE = 120.0  # age after which an undelivered notice is a fault [s]
COMPARE = 30.0  # time between comparisons with the channels of other programs [s]
STATUS = 60.0  # time between writes of an unchanged status [s]


class PostHealth:
    """Report of the post's health.

    Args:
        who: name of this program.
        mail: its channels.
        dispatcher: delivers, or waits for its turn.
        health: receives the report.

    Attributes:
        trouble: reason why the outbox accepts nothing, "" if it does.
    """

    def __init__(self, who: str, mail: MailParams, dispatcher: Dispatcher, health: Health) -> None:
        self._who, self._mail, self._dispatcher, self._health = who, mail, dispatcher, health
        self._parts: set[str] = set()
        self._spare_parts: set[str] = set()
        self._differ = ""
        self._compared = self._written = float("-inf")
        self._status: list[object] = []
        self.trouble = ""

    def report(self) -> None:
        """Report the state now. Raises OSError."""
        if time.monotonic() - self._compared >= COMPARE:
            self._compared = time.monotonic()
            self._differ = "; ".join(differences(self._dispatcher.outbox.folder, self._who, self._mail))
        if self._dispatcher.is_delivering:
            self._report_channels()
        else:
            self._report_from_afar()

    def say_trouble(self, what: str) -> None:
        """Report that the outbox accepts nothing, until `trouble` is "" again."""
        self.trouble = what
        self._set("outbox", ERROR, what)

    def report_spare(self, statuses: Sequence[ChannelStatus]) -> None:
        """Report the channels that have notices to send from memory."""
        found = {f"{status.name} (from memory)": status for status in statuses}
        for part in self._spare_parts - set(found):
            self._health.drop(part)
        self._spare_parts = set(found)
        for part, status in found.items():
            level, text = level_and_text(status)
            self._health.set(part, level, text, {"waiting": status.waiting, "refused": status.refused})

    def _report_channels(self) -> None:
        statuses = self._dispatcher.statuses()
        for status in statuses:
            level, text = level_and_text(status)
            self._set(status.name, level, text, {"waiting": status.waiting, "refused": status.refused})
        self._outbox_is(f"{self._who} delivers")
        state: list[object] = [(s.name, s.waiting, s.since, s.refused, s.error, s.refusal) for s in statuses]
        if state != self._status or time.monotonic() - self._written >= STATUS:
            self._dispatcher.write_status()
            self._status, self._written = state, time.monotonic()

    def _report_from_afar(self) -> None:
        outbox, holder = self._dispatcher.outbox, self._dispatcher.lock.holder()
        for part in self._parts - {"outbox"}:  # from the time when this program delivered
            self._health.drop(part)
        self._parts &= {"outbox"}
        late = [entry for entry in outbox.waiting() if time.time() - entry.wall > OVERDUE]
        status = read_status(outbox.folder) if late else None
        if late and (status is None or time.time() - status.wall > OVERDUE):
            waits = count_of(len(late), "notice waits", "notices wait")
            text = f"{waits}, and {holder}, which has to deliver them, does nothing"
            self._set("outbox", ERROR, text)
        else:
            self._outbox_is(f"{holder} delivers")

    def _outbox_is(self, text: str) -> None:
        if self.trouble:
            self._set("outbox", ERROR, self.trouble)
        else:
            self._set("outbox", WARN if self._differ else OK, self._differ or text)

    def _set(self, part: str, level: int, text: str, values: dict[str, Any] | None = None) -> None:
        self._parts.add(part)
        self._health.set(part, level, text, values)


def level_and_text(status: ChannelStatus) -> tuple[int, str]:
    """Level and sentence about a channel for /diagnostics."""
    if not status.waiting and status.refusal:
        return WARN, f"the last notice was refused for good: {status.refusal}"
    if not status.waiting:
        return OK, f"notices go to {status.describe}"
    since = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(status.since))
    waits = count_of(status.waiting, "notice waits", "notices wait")
    if not status.error:
        return OK, f"{waits} for {status.describe}, since {since}"
    refused = f", {status.refused} of them refused for good" if status.refused else ""
    return WARN, f"{waits} since {since}{refused}: {status.error}"
