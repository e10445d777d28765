"""The page of one incident: pictures, what happened and when, why it was believed, and what can be said of it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from urllib.parse import quote

from nicegui import ui
from starlette.requests import Request

from rosbot_patrol.alerts.pictures.clip import CLIP
from rosbot_patrol.alerts.records.incident import Event, Incident
from rosbot_patrol.console.house import edit
from rosbot_patrol.console.live.incident_desk import FALSE_ALARM, SEEN, Details, pictures_of
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View, frame, say, say_problem
from rosbot_patrol.console.sentences import origin_text, title_of, verdict_colour, verdict_name
from rosbot_patrol.errors import AccessError, ParamError, StoreError
from rosbot_patrol.patrol.intruder.known_objects import KnownObject

_KNOWN_RADIUS = 0.6  # [m] around a false alarm's place within which nothing alarms
_MOST = 15  # pictures
_MUTED_H = 4  # [h] that a room is left alone after a false alarm
_PERIOD = 2.0  # [s] between two looks at a mission that still runs
_KINDS = {
    "sensor": "sensors",
    "state": "directions_run",
    "seen": "visibility",
    "suspect": "help",
    "notice": "mail",
    "verdict": "gavel",
    "fault": "error",
}


async def incident_page(context: Context, request: Request, incident_id: str) -> None:
    """Draw the page."""
    with frame(context, request, "/incidents") as view:
        _ = view.words
        try:
            details = await asyncio.to_thread(context.incidents.get, incident_id)
        except StoreError as err:
            ui.label(str(err)).props('role="alert"')
            return
        if details is None:
            ui.label(_("There is no such incident on record.")).classes("text-xl").props('role="alert"')
            ui.link(_("All incidents"), "/incidents")
            return
        _Page(context, view, details).draw()


class _Page:
    def __init__(self, context: Context, view: View, details: Details) -> None:
        self._context, self._view, self._details = context, view, details
        self._incident: Incident = details.incident

    def draw(self) -> None:
        """Draw everything."""
        _, incident = self._view.words, self._incident
        with ui.row().classes("items-center gap-2"):
            ui.label(title_of(incident, _)).classes("text-2xl").props('role="heading" aria-level="1"')
            ui.badge(verdict_name(incident.verdict, _), color=verdict_colour(incident.verdict)).classes("text-base")
        when = self._view.time(incident.wall, "EEEE d MMMM y, HH:mm:ss")
        ui.label(f"{when} · {origin_text(incident.origin, _)}").classes("opacity-80")
        ui.label(incident.reason or incident.sentence)
        with ui.element("div").classes("console-columns"):
            with ui.column().classes("gap-3"):
                self._pictures()
            with ui.column().classes("gap-3"):
                self._actions()
                self._timeline()
        if incident.closed is None:
            ui.timer(_PERIOD, self._wait_for_more)

    async def _wait_for_more(self) -> None:
        """Draw the page anew once the mission has gone on."""
        try:
            now = await asyncio.to_thread(self._context.incidents.get, self._incident.id)
        except StoreError:  # it is being written
            return
        if now is not None and now.incident != self._incident:
            ui.navigate.reload()

    def _pictures(self) -> None:
        _ = self._view.words
        base = f"/incidents/{quote(self._incident.id)}/files"
        files = pictures_of(self._incident)
        if not files:
            ui.label(_("No picture was kept.")).classes("opacity-70")
        if any(file.role == "clip" for file in self._incident.files):
            poster = f' poster="{base}/{quote(files[0].name)}"' if files else ""
            clip = ui.element("video").props(f'controls playsinline preload="metadata" src="{base}/{CLIP}"{poster}')
            clip.classes("console-clip").props["aria-label"] = _("The seconds around the sighting")
        with ui.element("div").classes("console-figures"):
            for file in files[:_MOST]:
                with ui.element("figure").classes("console-figure"):
                    picture = ui.element("img").props('loading="lazy"')
                    picture.props["src"] = f"{base}/{quote(file.name)}"
                    picture.props["alt"] = file.caption or _("Picture of this incident")
                    with ui.element("figcaption"):
                        ui.label(file.caption)

    def _actions(self) -> None:
        _, view = self._view.words, self._view
        with ui.row().classes("w-full gap-2"):
            link = f"/incidents/{quote(self._incident.id)}/export.zip"
            ui.button(_("Export"), icon="download", on_click=lambda: ui.navigate.to(link)).props("outline no-caps")
            if not view.account.role.may_order or self._incident.closed is None:
                return
            if SEEN not in self._details.marks:
                ui.button(_("Mark as seen"), icon="done", on_click=lambda: self._mark(SEEN)).props("outline no-caps")
            if FALSE_ALARM not in self._details.marks and self._incident.object_class:
                ui.button(_("False alarm"), icon="thumb_down", on_click=self._false_alarm).props("outline no-caps")
            if view.account.role.may_manage:
                ui.button(_("Delete"), icon="delete", color="negative", on_click=self._remove).props("outline no-caps")

    async def _mark(self, mark: str) -> None:
        what = f"mark the incident {self._incident.id}: {mark}"
        await self._do(what, lambda who: self._context.incidents.mark(self._incident.id, mark, who))

    async def _false_alarm(self) -> None:
        _ = self._view.words
        place = self._incident.person
        with ui.dialog() as dialog, ui.card().classes("max-w-md"):
            ui.label(_("False alarm")).classes("text-lg")
            known = ui.checkbox(_("Something stands there that looks like a person: do not alarm there again."))
            mute = ui.checkbox(_("Leave the room alone for {n} hours.").format(n=_MUTED_H))
            known.set_enabled(place is not None)
            if place is None:
                ui.label(_("Its place is not known, so it cannot be remembered.")).classes("text-sm opacity-80")
            name = ui.input(_("What is it?"), placeholder=_("coat stand")).props("maxlength=60").classes("w-full")
            name.bind_visibility_from(known, "value")
            with ui.row().classes("w-full justify-end"):
                ui.button(_("Not now"), on_click=lambda: dialog.submit(None)).props("flat no-caps")
                save = ui.button(_("Save"), on_click=lambda: dialog.submit((known.value, mute.value, name.value)))
                save.props("unelevated no-caps").mark("save-false-alarm")
        choice = await dialog
        dialog.delete()
        if choice is None:
            return
        is_known, is_muted, called = choice
        if is_known and place is not None:
            thing = KnownObject(
                x=round(place[0], 2), y=round(place[1], 2), radius=_KNOWN_RADIUS, name=called or _("a known object")
            )
            if not await self._do(
                f"know '{thing.name}' at ({thing.x}, {thing.y})",
                lambda _who: edit.add_object(self._context.house, thing),
                is_last=False,
            ):
                return
        if is_muted:
            room = self._incident.room_id, self._incident.room_name
            answer = await self._context.desk.mute(self._view.visitor, *room, _MUTED_H * 3600.0)
            say(self._view, answer)
            if not answer.accepted:
                return
        await self._mark(FALSE_ALARM)

    async def _remove(self) -> None:
        _ = self._view.words
        with ui.dialog() as dialog, ui.card():
            ui.label(_("Delete this incident and its pictures?")).classes("text-lg")
            why = ui.input(_("Reason, which stays on record")).props("maxlength=200").classes("w-full")
            with ui.row().classes("w-full justify-end"):
                ui.button(_("Not now"), on_click=lambda: dialog.submit(None)).props("flat no-caps")
                ui.button(_("Delete"), color="negative", on_click=lambda: dialog.submit(why.value)).props("no-caps")
        reason = await dialog
        dialog.delete()
        if reason is None:
            return
        remove = self._context.incidents.remove
        if await self._do(
            f"delete {self._incident.id}", lambda who: remove(self._incident.id, reason, who), manage=True
        ):
            ui.navigate.to("/incidents")

    async def _do(
        self, what: str, change: Callable[[str], None], *, manage: bool = False, is_last: bool = True
    ) -> bool:
        """Change something on record, if the visitor still may; after the last change the page is drawn anew."""
        desk, visitor = self._context.desk, self._view.visitor
        if not desk.may(visitor, manage=manage):
            say_problem(self._view, self._view.words("You may not do that, or are signed out."))
            return False
        try:
            await asyncio.to_thread(change, visitor.account.name)
        except (StoreError, ParamError, AccessError, OSError) as err:
            say_problem(self._view, err)
            return False
        desk.note(visitor, what)
        self._context.hub.count_incident()
        if is_last:
            ui.navigate.reload()
        return True

    def _timeline(self) -> None:
        _ = self._view.words
        with ui.card().classes("w-full"):
            ui.label(_("What happened")).classes("text-lg").props('role="heading" aria-level="2"')
            with ui.element("ol").classes("console-timeline"):
                for event in (*self._incident.events, *self._details.amendments):
                    _draw_event(event, self._view)


def _draw_event(event: Event, view: View) -> None:
    with ui.element("li"):
        ui.icon(_KINDS.get(event.kind, "notes"), size="20px").props('aria-hidden="true"')
        ui.label(view.time(event.wall, "HH:mm:ss")).classes("opacity-80 text-sm")
        ui.label(event.text)
