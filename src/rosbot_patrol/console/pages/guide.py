"""The set-up guide for a new house, step by step: devices, map, rooms, sensors, notices, guard."""

from __future__ import annotations

import asyncio

from nicegui import ui
from starlette.requests import Request

from rosbot_patrol.console.house import edit
from rosbot_patrol.console.live.guide import Guide
from rosbot_patrol.console.pages.camera_view import camera_view
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View, follow, frame, say, say_problem, sure
from rosbot_patrol.console.pages.house.channels import channels_part
from rosbot_patrol.console.pages.house.map_editor import MapEditor
from rosbot_patrol.console.pages.house.sensors import sensors_part
from rosbot_patrol.console.pages.map_view import map_plan
from rosbot_patrol.errors import ParamError

_FEWEST = 2  # rooms: the base and another one


def guide_page(context: Context, request: Request) -> None:
    """Draw the page."""
    with frame(context, request, "/guide") as view:
        _, guide = view.words, context.guide
        if guide is None or not view.account.role.may_manage:
            ui.label(_("The guide is for the owner of a new house.")).classes("text-xl").props('role="alert"')
            return
        ui.label(_("A new house")).classes("text-2xl").props('role="heading" aria-level="1"')
        with ui.stepper().props("vertical header-nav animated").classes("w-full") as stepper:
            with ui.step("devices", title=_("Devices"), icon="cable"):
                _devices(context, view)
                _next(view, stepper)
            with ui.step("map", title=_("Map"), icon="map"):
                _map(context, view, guide)
                _next(view, stepper)
            with ui.step("rooms", title=_("Rooms"), icon="meeting_room"):
                ui.label(_("First the base, where the robot stands and waits. Then a point in each room."))
                MapEditor(context, view).draw()
                _next(view, stepper)
            with ui.step("sensors", title=_("Motion sensors"), icon="sensors"):
                sensors_part(context, view)
                _next(view, stepper)
            with ui.step("channels", title=_("Notices"), icon="outgoing_mail"):
                channels_part(context, view)
                _next(view, stepper)
            with ui.step("guard", title=_("On guard"), icon="verified_user"):
                _guard(context, view, guide)


def _next(view: View, stepper: ui.stepper) -> None:
    with ui.stepper_navigation():
        ui.button(view.words("Next"), on_click=stepper.next).props("unelevated no-caps")


def _devices(context: Context, view: View) -> None:
    _ = view.words
    names = {"lidar": _("Lidar"), "base": _("Wheels"), "camera": _("Camera")}
    advice = {
        "lidar": _("It is silent. Is it plugged in, and does it turn?"),
        "base": _("It is silent. Is the base switched on, and its cable in?"),
        "camera": _("It is silent. Is it plugged in?"),
    }
    with ui.column().classes("w-full gap-1") as box:
        pass
    with ui.card().classes("w-full max-w-md p-0 overflow-hidden"):
        camera_view(context, view)

    def refresh() -> None:
        box.clear()
        with box:
            for key, name in names.items():
                is_heard = key in context.hub.state.devices
                with ui.row().classes("items-center no-wrap"):
                    icon, colour = ("check_circle", "positive") if is_heard else ("error", "negative")
                    ui.icon(icon, size="22px", color=colour).props('aria-hidden="true"')
                    ui.label(f"{name}: {_('works') if is_heard else advice[key]}")

    follow(context.hub, refresh)


def _map(context: Context, view: View, guide: Guide) -> None:
    _, exploration = view.words, guide.exploration
    ui.label(_("Open the doors, and put the robot where it will wait. It drives through the house, and back."))

    async def start() -> None:
        question = _("Explore again? The map and the rooms on it will change.")
        if guide.map_file.exists() and not await sure(view, question, _("Explore")):
            return
        say(view, await asyncio.to_thread(exploration.start))
        context.desk.note(view.visitor, "explore the house")

    async def stop() -> None:
        say(view, await asyncio.to_thread(exploration.stop))
        context.desk.note(view.visitor, "stop exploring")

    async def nothing(_x: float, _y: float) -> None:
        """A tap on this map does nothing."""

    with ui.row().classes("items-center gap-2"):
        begin = ui.button(_("Explore"), icon="travel_explore", on_click=start).props("unelevated no-caps")
        end = ui.button(_("Stop exploring"), icon="close", on_click=stop).props("outline no-caps")
        text = ui.label().props('role="status"')
    with ui.card().classes("w-full max-w-2xl"):
        map_plan(context, view, nothing)

    def refresh() -> None:
        now = exploration.now
        states = {"done": _("The map is ready."), "failed": _("Exploring failed: {text}").format(text=now.text)}
        text.text = states.get(now.state, now.text)
        begin.set_visibility(now.state != "running")
        end.set_visibility(now.state == "running")

    refresh()
    ui.timer(0.5, refresh)


def _guard(context: Context, view: View, guide: Guide) -> None:
    _ = view.words
    missing = ui.column().classes("gap-1")

    async def finish() -> None:
        try:
            await asyncio.to_thread(edit.spell_out_sensors, context.house)
        except (ParamError, OSError) as err:
            say_problem(view, err)
            return
        context.desk.note(view.visitor, "end the set-up and start the guard")
        ui.notify(_("The guard starts. This page comes back in a minute."), type="positive", position="top", timeout=0)
        ui.run_javascript(_BACK)
        ui.timer(0.5, guide.finish, once=True)

    start = ui.button(_("Start the guard"), icon="verified_user", on_click=finish).props("unelevated no-caps")
    ui.label(_("Then press 'Look at all rooms': the robot's first patrol.")).classes("opacity-80")

    def refresh() -> None:
        found = []
        if not guide.map_file.exists():
            found.append(_("The map is missing: let the robot explore first."))
        if len(context.hub.rooms) < _FEWEST:
            found.append(_("The base and one room at least are missing."))
        missing.clear()
        with missing:
            for sentence in found:
                ui.label(sentence).classes("console-problem console-warning")
        start.set_enabled(not found)

    refresh()
    ui.timer(1.0, refresh)


_BACK = """
const wait = async () => {
  try { if ((await fetch('/sign-in', {cache: 'no-store'})).ok && window.gone) { location.href = '/'; return; } }
  catch (e) { window.gone = true; }
  setTimeout(wait, 1000);
};
wait();
"""
