"""Incidents that somebody marks as seen from a notification on the phone, also while their mission still runs."""

from __future__ import annotations

import asyncio
import logging

from rosbot_patrol.console.access.secret import is_seen_token
from rosbot_patrol.console.live.incident_desk import SEEN, IncidentDesk
from rosbot_patrol.errors import StoreError

log = logging.getLogger(__name__)

_WHO = "somebody, on a notification,"
_TRIES = 720


class Acknowledgements:
    """Marks incidents as seen.

    Args:
        incidents: on record.
        secret: of the tokens.
        period: between two tries while a mission runs, which takes no marks [s].
    """

    def __init__(self, incidents: IncidentDesk, secret: bytes, period: float = 5.0) -> None:
        self._incidents, self._secret, self._period = incidents, secret, period
        self._waiting: dict[str, asyncio.Task[None]] = {}

    async def take(self, incident_id: str, token: str) -> tuple[int, str]:
        """Answer an address of a notice: status of HTTP and a sentence."""
        if not is_seen_token(self._secret, incident_id, token):
            return 403, "This address is not one of a notice."
        if incident_id in self._waiting or not await self._is_waiting(incident_id):
            return 200, "The incident is marked as seen."
        self._waiting[incident_id] = asyncio.create_task(self._retry(incident_id))
        return 202, "The incident will be marked as seen once its mission is over."

    async def _is_waiting(self, incident_id: str) -> bool:
        """Mark one if that is possible; whether it has to wait."""
        try:
            details = await asyncio.to_thread(self._incidents.get, incident_id)
            if details is None or SEEN in details.marks:
                return False
            if details.incident.closed is None:
                return True
            await asyncio.to_thread(self._incidents.mark, incident_id, SEEN, _WHO)
        except StoreError as err:
            log.warning("the incident %s cannot be marked as seen: %s; trying on", incident_id, err)
            return True
        return False

    async def _retry(self, incident_id: str) -> None:
        for _ in range(_TRIES):
            await asyncio.sleep(self._period)
            if not await self._is_waiting(incident_id):
                break
        else:
            log.error("the incident %s could not be marked as seen", incident_id)
        del self._waiting[incident_id]
