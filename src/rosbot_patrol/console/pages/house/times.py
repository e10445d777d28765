"""What the modes guard, quiet hours, and the rounds that the guard makes by itself."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial
from typing import Any

from nicegui import ui

from rosbot_patrol.console.house import edit
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View
from rosbot_patrol.console.pages.house.form import Form, follow_house, icon_button
from rosbot_patrol.console.sentences import MODES, mode_name
from rosbot_patrol.console.words import Words
from rosbot_patrol.errors import ParamError
from rosbot_patrol.patrol.guard.modes import DISARMED
from rosbot_patrol.patrol.guard.schedule import Round
from rosbot_patrol.patrol.guard.wall_times import DAYS, Window


def times_part(context: Context, view: View) -> None:
    """Draw the part."""
    box = ui.element("div").classes("console-columns")

    def refresh() -> None:
        box.clear()
        with box:
            try:
                _modes(context, view)
                _rounds(context, view)
            except ParamError as err:
                ui.label(str(err)).classes("console-problem console-error").props('role="alert"')

    follow_house(context, refresh)


def _heading(text: str) -> None:
    ui.label(text).classes("text-lg").props('role="heading" aria-level="2"')


def day_names(_: Words) -> dict[str, str]:
    """Names of the days, by their keys in the files."""
    names = (_("Mon"), _("Tue"), _("Wed"), _("Thu"), _("Fri"), _("Sat"), _("Sun"))
    return dict(zip(DAYS, names, strict=True))


def _clock(minutes: int) -> str:
    return f"{minutes // 60:02}:{minutes % 60:02}"


def _days_text(days: frozenset[int], _: Words) -> str:
    names = list(day_names(_).values())
    return "" if len(days) == len(DAYS) else ", ".join(names[day] for day in sorted(days))


def _rooms_text(context: Context, rooms: frozenset[int] | tuple[int, ...] | None, _: Words) -> str:
    if rooms is None or set(rooms) >= {room.id for room in context.hub.rooms}:
        return _("all rooms")
    return ", ".join(room.name for room in context.hub.rooms if room.id in rooms) or _("no room")


# -- modes


def _modes(context: Context, view: View) -> None:
    _, rules = view.words, context.house.rules
    with ui.card().classes("w-full gap-2"):
        _heading(_("Modes"))
        for mode in MODES:
            if mode == DISARMED:
                continue
            given = rules.modes[mode]
            parts = [_rooms_text(context, given.rooms, _)]
            if given.exit_delay:
                parts.append(_("{n} s to leave").format(n=round(given.exit_delay)))
            if given.entry_delay:
                parts.append(_("{n} s to come in").format(n=round(given.entry_delay)))
            with ui.row().classes("w-full items-center no-wrap"):
                with ui.column().classes("gap-0"):
                    ui.label(mode_name(mode, _))
                    ui.label(", ".join(parts)).classes("text-sm opacity-80")
                ui.space()
                label = _("Change {name}").format(name=mode_name(mode, _))
                icon_button("edit", label, partial(_edit_mode, context, view, mode))
        ui.separator()
        ui.label(_("Quiet hours: no round starts")).classes("font-medium")
        for i, window in enumerate(rules.quiet_hours):
            _quiet_line(context, view, i, window)
        ui.button(_("Add quiet hours"), icon="add", on_click=lambda: _edit_quiet(context, view, None)).props(
            "outline no-caps"
        )


async def _edit_mode(context: Context, view: View, mode: str) -> None:
    _, rules = view.words, context.house.rules
    given, rooms = rules.modes[mode], {room.id: room.name for room in context.hub.rooms}
    chosen = list(rooms) if given.rooms is None else sorted(given.rooms)
    form = Form(context, view, mode_name(mode, _))
    with form.body:
        form.add("rooms", ui.select(rooms, value=chosen, multiple=True, label=_("Guarded rooms")).props("use-chips"))
        form.add("exit_delay", ui.number(_("Time to leave [s]"), value=given.exit_delay, format="%.0f"))
        form.add("entry_delay", ui.number(_("Time to come in [s]"), value=given.entry_delay, format="%.0f"))
        entry = sorted(rules.entry_rooms)
        form.add("entry_rooms", ui.select(rooms, value=entry, multiple=True, label=_("Rooms that people come in by")))

    def save() -> None:
        listed = sorted(form.value("rooms") or ())
        values = {
            "rooms": "all" if listed == sorted(rooms) else listed,
            "exit_delay": form.number("exit_delay"),
            "entry_delay": form.number("entry_delay"),
        }
        edit.save_modes(context.house, {mode: values}, sorted(form.value("entry_rooms") or ()))

    await form.run(f"change the mode {mode}", save)


def _quiet_line(context: Context, view: View, index: int, window: Window) -> None:
    _ = view.words
    with ui.row().classes("w-full items-center no-wrap"):
        ui.icon("bedtime", size="22px").props('aria-hidden="true"')
        text = f"{_clock(window.start)} - {_clock(window.end)}"
        days = _days_text(window.days, _)
        ui.label(f"{text}, {days}" if days else text)
        ui.space()
        label = _("Change {name}").format(name=text)
        icon_button("edit", label, lambda: _edit_quiet(context, view, index))


async def _edit_quiet(context: Context, view: View, index: int | None) -> None:
    _, windows = view.words, list(context.house.rules.quiet_hours)
    before = windows[index] if index is not None else None
    form = Form(context, view, _("Quiet hours"))
    with form.body:
        first, last = (_clock(before.start), _clock(before.end)) if before else ("22:00", "06:00")
        form.add("from", ui.input(_("From"), value=first).props('type="time"'))
        form.add("to", ui.input(_("Until"), value=last).props('type="time"'))
        days = [DAYS[day] for day in sorted(before.days)] if before and len(before.days) < len(DAYS) else []
        form.add("days", ui.select(day_names(_), value=days, multiple=True, label=_("Days; none: every day")))

    def plain(window: Window) -> dict[str, Any]:
        days = [] if len(window.days) == len(DAYS) else [DAYS[day] for day in sorted(window.days)]
        return {"from": _clock(window.start), "to": _clock(window.end), **({"days": days} if days else {})}

    def save_with(mine: list[dict[str, Any]]) -> None:
        at = len(windows) if index is None else index
        others = [plain(window) for window in windows]
        edit.save_quiet_hours(context.house, [*others[:at], *mine, *others[at + 1 :]])

    def save() -> None:
        days = sorted(form.value("days") or (), key=DAYS.index)
        own = {"from": str(form.value("from") or ""), "to": str(form.value("to") or "")}
        save_with([{**own, **({"days": days} if days else {})}])

    await form.run("change the quiet hours", save, None if index is None else lambda: save_with([]))


# -- rounds


def _rounds(context: Context, view: View) -> None:
    _ = view.words
    with ui.card().classes("w-full gap-2"):
        _heading(_("Rounds"))
        rounds = context.house.rounds
        if not rounds:
            ui.label(_("None: the robot drives when a sensor calls, or somebody asks."))
        for entry in rounds:
            with ui.row().classes("w-full items-center no-wrap"):
                ui.icon("update", size="22px").props('aria-hidden="true"')
                with ui.column().classes("gap-0"):
                    ui.label(entry.name)
                    ui.label(_round_text(context, entry, _)).classes("text-sm opacity-80")
                ui.space()
                label = _("Change {name}").format(name=entry.name)
                icon_button("edit", label, partial(_edit_round, context, view, entry))
        ui.button(_("Add a round"), icon="add", on_click=lambda: _edit_round(context, view, None)).props(
            "outline no-caps"
        )


def _round_text(context: Context, entry: Round, _: Words) -> str:
    when = ", ".join(map(_clock, entry.minutes)) or _("every {n} min").format(n=round(entry.every / 60))
    parts = [when, _days_text(entry.days, _) if entry.minutes else "", _rooms_text(context, entry.rooms, _)]
    return "; ".join(filter(None, parts))


async def _edit_round(context: Context, view: View, entry: Round | None) -> None:
    _, rooms = view.words, {room.id: room.name for room in context.hub.rooms}
    modes = {mode: mode_name(mode, _) for mode in MODES if mode != DISARMED}
    form = Form(context, view, _("Round"))
    with form.body:
        form.add("name", ui.input(_("Name"), value=entry.name if entry else "").props("maxlength=60 autofocus"))
        times = ", ".join(map(_clock, entry.minutes)) if entry else "22:30"
        form.add("at", ui.input(_("Times of day, such as 22:30, 02:00"), value=times))
        every = round(entry.every / 60) if entry and entry.every else None
        form.add("every", ui.number(_("Or every so many minutes"), value=every, format="%.0f"))
        days = [DAYS[day] for day in sorted(entry.days)] if entry and len(entry.days) < len(DAYS) else []
        form.add("days", ui.select(day_names(_), value=days, multiple=True, label=_("Days; none: every day")))
        chosen = [] if entry is None or set(entry.rooms) >= set(rooms) else list(entry.rooms)
        form.add("rooms", ui.select(rooms, value=chosen, multiple=True, label=_("Rooms; none: all")))
        own = sorted(entry.modes, key=MODES.index) if entry and entry.modes < set(modes) else []
        form.add("modes", ui.select(modes, value=own, multiple=True, label=_("Modes; none: all but disarmed")))

    def save() -> None:
        edit.save_round(context.house, entry.name if entry else "", _round_of(form.value))

    remove = None if entry is None else lambda: edit.remove_round(context.house, entry.name)
    await form.run("change a round", save, remove)


def _round_of(value: Any) -> Mapping[str, Any]:
    """Keys of a round, of the fields."""
    times = [part for part in re.split(r"[,;\s]+", str(value("at") or "")) if part]
    return {
        "name": str(value("name") or "").strip(),
        "at": times,
        "every": 60.0 * (value("every") or 0.0),
        "days": sorted(value("days") or (), key=DAYS.index) if times else [],
        "rooms": list(value("rooms") or ()),
        "modes": list(value("modes") or ()),
    }
