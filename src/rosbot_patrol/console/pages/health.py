"""How everything is: problems, motion sensors, battery, disk, the ways to the owner, and the last orders."""

from __future__ import annotations

import asyncio
import shutil

from nicegui import ui
from starlette.requests import Request

from rosbot_patrol.alerts.dispatch.status_file import PostStatus, read_status
from rosbot_patrol.console.live.house_state import BatteryNow, SensorNow
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View, follow, frame
from rosbot_patrol.console.sentences import ago, day_line

_SHOWN = 60  # entries of the last day
_SLOW = 5.0  # [s] between two looks at disk and channels


def health_page(context: Context, request: Request) -> None:
    """Draw the page."""
    with frame(context, request, "/health") as view, ui.element("div").classes("console-columns"):
        with ui.column().classes("gap-3"):
            _problems(context, view)
            _machine(context, view)
            if view.account.role.may_manage:
                _report(context, view)
        with ui.column().classes("gap-3"):
            _sensors(context, view)
            if view.account.role.may_order:
                _day(context, view)
                _last_orders(context, view)


def _heading(text: str) -> None:
    ui.label(text).classes("text-lg").props('role="heading" aria-level="2"')


def _problems(context: Context, view: View) -> None:
    _ = view.words
    with ui.card().classes("w-full"):
        _heading(_("Problems"))
        box = ui.column().classes("w-full gap-2").mark("problems")

    def refresh() -> None:
        found = context.hub.state.worst_first
        box.clear()
        with box:
            if not found:
                ui.label(
                    _("None: everything works.") if context.hub.state.is_heard else _("The guard does not answer.")
                )
            for problem in found:
                kind = "console-error" if problem.is_error else "console-warning"
                with ui.column().classes(f"console-problem {kind} gap-0 w-full"):
                    ui.label(problem.text)
                    ui.label(problem.name).classes("text-xs opacity-80")

    follow(context.hub, refresh)


def _machine(context: Context, view: View) -> None:
    _ = view.words
    with ui.card().classes("w-full"):
        _heading(_("Robot"))
        battery = ui.label()
        disk = ui.label()
        channels = ui.column().classes("gap-1")
    follow(context.hub, lambda: battery.set_text(_battery_text(context.hub.state.battery, view)))

    async def look() -> None:
        free = await asyncio.to_thread(shutil.disk_usage, _existing(context))
        disk.text = _("Disk: {n} GB free").format(n=round(free.free / 1e9, 1))
        status = await asyncio.to_thread(read_status, context.state_dir / "outbox")
        channels.clear()
        with channels:
            for line in _channel_lines(status, view):
                ui.label(line)

    ui.timer(0.1, look, once=True)
    ui.timer(_SLOW, look)


def _existing(context: Context) -> str:
    found = context.state_dir
    while not found.exists():
        found = found.parent
    return str(found)


def _battery_text(battery: BatteryNow | None, view: View) -> str:
    _ = view.words
    if battery is None:
        return _("Battery: not heard")
    parts = []
    if battery.share is not None:
        parts.append(f"{battery.share:.0%}")
    if battery.voltage is not None:
        parts.append(f"{battery.voltage:.1f} V")
    if battery.is_charging:
        parts.append(_("charging"))
    return _("Battery: {text}").format(text=", ".join(parts))


def _channel_lines(status: PostStatus | None, view: View) -> list[str]:
    _ = view.words
    if status is None:
        return [_("No way to the owner has been used yet.")]
    lines = []
    for channel in status.channels:
        waits = _("{n} wait").format(n=channel.waiting) if channel.waiting else _("took all")
        lines.append(f"{channel.name}: {waits}{f' ({channel.error})' if channel.error else ''}")
    return lines


def _sensors(context: Context, view: View) -> None:
    _ = view.words
    with ui.card().classes("w-full"):
        _heading(_("Motion sensors"))
        box = ui.column().classes("w-full gap-1")

    def refresh() -> None:
        box.clear()
        with box:
            if not context.hub.state.sensors:
                ui.label(_("None is watched."))
            for sensor in context.hub.state.sensors:
                _draw_sensor(sensor, view)

    follow(context.hub, refresh)


def _draw_sensor(sensor: SensorNow, view: View) -> None:
    _ = view.words
    is_well = sensor.state in ("ok", "unwatched")
    with ui.row().classes("items-center no-wrap w-full"):
        icon, colour = ("check_circle", "positive") if is_well else ("error", "negative")
        ui.icon(icon, size="20px", color=colour).props(f'role="img" aria-label="{sensor.state}"')
        with ui.column().classes("gap-0"):
            ui.label(sensor.name)
            moved = _("motion: {when}").format(when=ago(sensor.motion, _))
            ui.label(f"{moved}{'' if is_well else f' · {sensor.text}'}").classes("text-sm opacity-80")


def _report(context: Context, view: View) -> None:
    _ = view.words
    with ui.card().classes("w-full"):
        _heading(_("Something is wrong?"))
        ui.label(_("A file for the developers: logs and settings, without passwords, addresses and pictures."))
        ui.button(_("Bug report"), icon="bug_report", on_click=lambda: ui.navigate.to("/report.zip")).props(
            "outline no-caps"
        )


def _day(context: Context, view: View) -> None:
    _ = view.words
    with ui.card().classes("w-full"):
        _heading(_("The last day"))
        box = ui.element("ol").classes("console-timeline")

    def refresh() -> None:
        entries = context.day_log.newest_first[:_SHOWN]
        box.clear()
        with box:
            if not entries:
                ui.label(_("Nothing has happened."))
            for entry in entries:
                icon, text = day_line(entry, _)
                with ui.element("li"):
                    ui.icon(icon, size="20px").props('aria-hidden="true"')
                    ui.label(view.time(entry.wall, "HH:mm")).classes("opacity-80 text-sm")
                    ui.label(text)

    follow(context.hub, refresh)


def _last_orders(context: Context, view: View) -> None:
    _ = view.words
    with ui.card().classes("w-full"):
        _heading(_("Last orders"))
        with ui.element("ol").classes("console-timeline"):
            for order in context.desk.order_log.newest[:20]:
                with ui.element("li"):
                    icon = "check" if order.accepted else "block"
                    ui.icon(icon, size="20px").props('aria-hidden="true"')
                    ui.label(view.time(order.wall, "d MMM, HH:mm")).classes("opacity-80 text-sm")
                    ui.label(f"{order.who}: {order.what}. {order.answer}")
