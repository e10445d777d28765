"""The list of incidents: cards with picture, room, time and verdict, and filters."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from datetime import datetime, timedelta
from urllib.parse import quote

from nicegui import ui
from starlette.requests import Request

from rosbot_patrol.alerts.records.incident import VERDICTS
from rosbot_patrol.alerts.records.query import Query
from rosbot_patrol.console.live.incident_desk import FALSE_ALARM, SEEN, Card
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View, frame, say_problem
from rosbot_patrol.console.sentences import title_of, verdict_colour, verdict_name
from rosbot_patrol.errors import StoreError

_PAGE = 24


def incidents_page(context: Context, request: Request) -> None:
    """Draw the page."""
    with frame(context, request, "/incidents") as view:
        _List(context, view).draw()


class _List:
    def __init__(self, context: Context, view: View) -> None:
        self._context, self._view = context, view
        self._until: float | None = None  # of the next page

    def draw(self) -> None:
        """Draw filters and cards."""
        _ = self._view.words
        rooms: dict[int | None, str] = {
            None: _("All rooms"),
            **{room.id: room.name for room in self._context.hub.rooms},
        }
        verdicts: dict[str | None, str] = {
            None: _("All outcomes"),
            **{each: verdict_name(each, _) for each in VERDICTS},
        }
        with ui.row().classes("w-full items-end gap-3"):
            self._room = ui.select(rooms, value=None, label=_("Room"), on_change=self._anew).classes("w-40")
            self._verdict = ui.select(verdicts, value=None, label=_("Outcome"), on_change=self._anew).classes("w-40")
            self._day = ui.input(_("Day"), on_change=self._anew).props('type="date" stack-label').classes("w-40")
            self._text = ui.input(_("Words"), on_change=self._anew).props("clearable debounce=300").classes("w-48")
        self._cards = ui.element("div").classes("console-cards")
        self._empty = ui.label(_("Nothing on record that fits.")).classes("opacity-70 py-8")
        self._more = ui.button(_("Older ones"), icon="expand_more", on_click=self._older).props("flat no-caps")
        _follow(self._context, self._anew)

    async def _anew(self) -> None:
        self._until = None
        cards = await self._fetch()
        self._cards.clear()
        self._add(cards)

    async def _older(self) -> None:
        self._add(await self._fetch())

    async def _fetch(self) -> list[Card]:
        since, until = _day(self._day.value)
        query = Query(
            room=self._room.value,
            verdict=self._verdict.value,
            since=since,
            until=until if self._until is None else self._until,
            text=self._text.value or "",
            limit=_PAGE + 1,
        )
        try:
            return await asyncio.to_thread(self._context.incidents.find, query)
        except StoreError as err:
            say_problem(self._view, err)
            return []

    def _add(self, cards: list[Card]) -> None:
        shown = cards[:_PAGE]
        self._more.set_visibility(len(cards) > _PAGE)
        self._until = shown[-1].found.wall if shown else None
        with self._cards:
            for card in shown:
                _draw_card(card, self._view)
        self._empty.set_visibility(not self._cards.default_slot.children)


def _draw_card(card: Card, view: View) -> None:
    _ = view.words
    found = card.found
    with ui.element("a").props(f'href="/incidents/{quote(found.id)}"').classes("console-card").mark("incident"):
        if card.picture:
            ui.element("img").props(
                f'src="/incidents/{quote(found.id)}/files/{quote(card.picture)}" alt="" loading="lazy"'
            )
        else:
            with ui.element("div").classes("console-no-picture"):
                ui.icon("image_not_supported", size="32px").props('aria-hidden="true"')
        with ui.column().classes("gap-1 p-3"):
            ui.label(title_of(found, _)).classes("font-medium")
            ui.label(view.time(found.wall, "EEE d MMM y, HH:mm")).classes("text-sm opacity-80")
            with ui.row().classes("gap-1"):
                ui.badge(verdict_name(found.verdict, _), color=verdict_colour(found.verdict))
                if FALSE_ALARM in card.marks:
                    ui.badge(_("False alarm"), color="grey-8")
                if SEEN in card.marks:
                    ui.badge(_("Seen"), color="grey-8")


def _day(text: str | None) -> tuple[float | None, float | None]:
    """Begin and end of a day, seconds since 1970; None and None where the text is no day."""
    try:
        begin = datetime.strptime(text or "", "%Y-%m-%d").astimezone()
    except ValueError:
        return None, None
    return begin.timestamp(), (begin + timedelta(days=1)).timestamp()


def _follow(context: Context, refresh: Callable[[], Awaitable[None]]) -> None:
    """Draw anew whenever the incidents on record change."""
    drawn = -1

    async def look() -> None:
        nonlocal drawn
        count = context.hub.state.incidents
        if count != drawn:
            drawn = count
            await refresh()

    ui.timer(0.3, look)
