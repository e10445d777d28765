"""Rooms, keep-out zones and known objects on the map: a tap says where."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable
from functools import partial

from nicegui import ui

from rosbot_patrol.console.house import edit
from rosbot_patrol.console.live.map_picture import MapPicture
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View, say_problem
from rosbot_patrol.console.pages.house.form import Form, change, follow_house, icon_button
from rosbot_patrol.console.pages.map_view import map_plan, points_text
from rosbot_patrol.errors import MapError, ParamError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.house.floor import floor_of
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.patrol.intruder.known_objects import KnownObject
from rosbot_patrol.patrol.visibility.marking import Marks

_ROOM, _ZONE, _OBJECT, _NONE = "room", "zone", "object", ""
_RADIUS = 0.5  # [m] of a known object

_Click = Callable[[], Awaitable[None]]


class MapEditor:
    """Draws the map and the lists, and takes the taps."""

    def __init__(self, context: Context, view: View) -> None:
        self._context, self._view = context, view
        self._tool = _NONE
        self._moved: int | None = None  # room that the next tap moves
        self._corners: list[tuple[float, float]] = []

    def draw(self) -> None:
        """Draw everything."""
        _ = self._view.words
        with ui.element("div").classes("console-columns"):
            with ui.card().classes("w-full"):
                with ui.row().classes("w-full gap-2"):
                    for tool, icon, text in (
                        (_ROOM, "add_location", _("Add a room")),
                        (_ZONE, "block", _("Add a keep-out zone")),
                        (_OBJECT, "chair", _("Add a known object")),
                    ):
                        ui.button(text, icon=icon, on_click=lambda tool=tool: self._choose(tool)).props(
                            "outline no-caps dense"
                        )
                with ui.row().classes("console-problem console-note w-full items-center") as self._hint:
                    self._hint_text = ui.label().props('role="status"')
                    ui.space()
                    self._done = ui.button(_("Done"), on_click=self._finish_zone).props("unelevated dense no-caps")
                    ui.button(_("Not now"), on_click=lambda: self._choose(_NONE)).props("flat dense no-caps")
                self._refresh = map_plan(self._context, self._view, self._tap, self._draft)
            with ui.column().classes("gap-3"):
                self._list = ui.column().classes("w-full gap-3")
        self._choose(_NONE)
        follow_house(self._context, self._draw_lists)

    def _choose(self, tool: str, moved: int | None = None) -> None:
        _ = self._view.words
        self._tool, self._moved, self._corners = tool, moved, []
        hints = {
            _ROOM: _("Tap the place that the robot looks from."),
            _ZONE: _("Tap the corners of the zone, then press Done."),
            _OBJECT: _("Tap the thing that looks like a person."),
        }
        self._hint_text.text = hints.get(tool, "")
        self._hint.set_visibility(bool(tool))
        self._done.set_visibility(tool == _ZONE)
        self._refresh()

    def _draft(self, found: MapPicture) -> str:
        """The corners of a new zone so far."""
        places = points_text(self._corners, found)
        spots = (found.pixel(*corner) for corner in self._corners)
        size = 0.2 / found.resolution
        dots = "".join(f'<circle cx="{x:.0f}" cy="{y:.0f}" r="{size:.1f}" class="draft-point"/>' for x, y in spots)
        return f'<polyline points="{places}" class="draft"/>{dots}' if self._corners else ""

    async def _tap(self, x: float, y: float) -> None:
        if self._tool == _ZONE:
            self._corners.append((x, y))
            self._refresh()
        elif self._tool == _OBJECT:
            self._choose(_NONE)
            await self._add_object(x, y)
        elif self._tool == _ROOM:
            moved = self._moved
            self._choose(_NONE)
            await self._place_room(moved, x, y)

    # -- rooms

    async def _place_room(self, number: int | None, x: float, y: float) -> None:
        """Open the form of a room at a place where the robot can stand."""
        try:
            rooms = self._context.house.rooms
            problem = await asyncio.to_thread(self._problem, rooms, number, x, y)
        except (ParamError, MapError) as err:
            say_problem(self._view, err)
            return
        if problem:
            say_problem(self._view, problem)
            return
        before = rooms.find(number) if rooms is not None and number is not None else None
        next_id = len(rooms) if rooms is not None else 0
        name, yaw = (before.name, before.pose.yaw) if before is not None else ("", 0.0)
        await self._edit_room(Room(id=next_id if number is None else number, name=name, pose=Pose2D(x, y, yaw)))

    def _problem(self, rooms: Rooms | None, number: int | None, x: float, y: float) -> str:
        grid = self._context.hub.grid
        if grid is None:
            raise MapError("the map", "was not heard yet")
        others = Rooms(tuple(room for room in rooms if room.id != number)) if rooms and number != 0 else None
        return Marks(others).problem(floor_of(grid, zones=self._context.hub.state.zones), x, y)

    async def _edit_room(self, room: Room) -> None:
        _, files = self._view.words, self._context.house
        is_new = all(each.id != room.id for each in self._context.hub.rooms)
        title = _("Base, where the robot waits") if room.id == 0 else _("Room {number}").format(number=room.id)
        form = Form(self._context, self._view, title)
        with form.body:
            form.add("name", ui.input(_("Name"), value=room.name).props("maxlength=60 autofocus"))
            ui.label(f"x {room.pose.x:.2f} m, y {room.pose.y:.2f} m").classes("opacity-80")
            degrees = round(math.degrees(room.pose.yaw))
            form.add("angle", ui.number(_("Looks towards (degrees, 0: right, 90: up)"), value=degrees, format="%.0f"))
            if not is_new:

                def move() -> None:
                    form.close()
                    self._choose(_ROOM, room.id)

                ui.button(_("Move it on the map"), icon="open_with", on_click=move).props("outline no-caps")

        def save() -> None:
            pose = Pose2D(room.pose.x, room.pose.y, math.radians(form.number("angle")))
            edit.save_room(files, Room(id=room.id, name=str(form.value("name") or ""), pose=pose))

        def remove() -> None:
            edit.remove_room(files, room.id)

        await form.run(f"change room {room.id}", save, None if is_new or room.id == 0 else remove)

    # -- zones and objects

    async def _finish_zone(self) -> None:
        _, corners = self._view.words, list(self._corners)
        if len(corners) < 3:
            say_problem(self._view, _("A zone needs three corners at least."))
            return
        form = Form(self._context, self._view, _("Keep-out zone"))
        with form.body:
            form.add("name", ui.input(_("Name"), placeholder=_("dog's corner")).props("maxlength=60 autofocus"))

        def save() -> None:
            edit.add_zone(self._context.house, str(form.value("name") or ""), corners)

        if await form.run("add a keep-out zone", save):
            self._choose(_NONE)

    async def _add_object(self, x: float, y: float) -> None:
        _ = self._view.words
        form = Form(self._context, self._view, _("Known object"))
        with form.body:
            ui.label(_("Nothing that looks like a person alarms there.")).classes("opacity-80")
            form.add("name", ui.input(_("What is it?"), placeholder=_("coat stand")).props("maxlength=60 autofocus"))
            form.add("radius", ui.number(_("Radius [m]"), value=_RADIUS, step=0.1))

        def save() -> None:
            thing = KnownObject(x=x, y=y, radius=form.number("radius"), name=str(form.value("name") or ""))
            edit.add_object(self._context.house, thing)

        await form.run("add a known object", save)

    # -- lists

    def _draw_lists(self) -> None:
        _, state = self._view.words, self._context.hub.state
        self._list.clear()
        with self._list:
            with ui.card().classes("w-full gap-1"):
                ui.label(_("Rooms")).classes("text-lg").props('role="heading" aria-level="2"')
                if not state.rooms:
                    ui.label(_("None yet. The first one is the base, where the robot waits."))
                for room in state.rooms:
                    self._line("meeting_room" if room.id else "home", f"{room.id}  {room.name}", self._opener(room.id))
            with ui.card().classes("w-full gap-1"):
                ui.label(_("Keep-out zones")).classes("text-lg").props('role="heading" aria-level="2"')
                if not state.zones:
                    ui.label(_("None: the robot may drive everywhere."))
                for zone in state.zones:
                    self._line("block", zone.name, None, partial(self._remove_zone, zone.name))
            with ui.card().classes("w-full gap-1"):
                ui.label(_("Known objects")).classes("text-lg").props('role="heading" aria-level="2"')
                if not state.known:
                    ui.label(_("None."))
                for i, thing in enumerate(state.known):
                    self._line("chair", thing.name, None, partial(self._remove_object, i))

    def _line(self, icon: str, text: str, edit_it: _Click | None, remove: _Click | None = None) -> None:
        _ = self._view.words
        with ui.row().classes("w-full items-center no-wrap"):
            ui.icon(icon, size="22px").props('aria-hidden="true"')
            ui.label(text)
            ui.space()
            if edit_it is not None:
                icon_button("edit", _("Change {name}").format(name=text), edit_it)
            if remove is not None:
                icon_button("delete", _("Remove {name}").format(name=text), remove)

    def _opener(self, number: int) -> _Click:
        async def open_it() -> None:
            try:
                rooms = self._context.house.rooms
            except ParamError as err:
                say_problem(self._view, err)
                return
            room = rooms.find(number) if rooms is not None else None
            if room is not None:
                await self._edit_room(room)

        return open_it

    async def _remove_zone(self, name: str) -> None:
        remove = lambda: edit.remove_zone(self._context.house, name)  # noqa: E731
        await change(self._context, self._view, f"remove the zone {name}", remove)

    async def _remove_object(self, index: int) -> None:
        remove = lambda: edit.remove_object(self._context.house, index)  # noqa: E731
        await change(self._context, self._view, f"remove the known object {index}", remove)
