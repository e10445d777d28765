"""Motion sensors and their rooms. One that calls is highlighted, so that who walks past it sees which it is."""

from __future__ import annotations

import time

from nicegui import ui

from rosbot_patrol.console.house import edit
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View
from rosbot_patrol.console.pages.house.form import Form, follow_house, icon_button
from rosbot_patrol.errors import ParamError
from rosbot_patrol.sensors.sensor_file import SensorSpec

_CALLS_FOR = 4.0  # [s] that a sensor is highlighted


def sensors_part(context: Context, view: View) -> None:
    """Draw the part."""
    _ = view.words
    with ui.card().classes("w-full gap-2"):
        ui.label(_("Motion sensors")).classes("text-lg").props('role="heading" aria-level="2"')
        ui.label(_("Walk past a sensor: it lights up here.")).classes("opacity-80")
        box = ui.column().classes("w-full gap-1")
        ui.button(_("Add a sensor"), icon="add", on_click=lambda: _edit(context, view, None)).props("outline no-caps")

    def refresh() -> None:
        box.clear()
        with box:
            _draw(context, view)

    follow_house(context, refresh, calls=True)


def _draw(context: Context, view: View) -> None:
    _ = view.words
    try:
        listed = context.house.sensors
    except ParamError as err:
        ui.label(str(err)).classes("console-problem console-error").props('role="alert"')
        return
    specs = list(listed) if listed.has_file else [SensorSpec(id=r.id, room=r.id) for r in context.hub.rooms if r.id]
    if not listed.has_file:
        ui.label(_("Without a list, a sensor's id is the number of its room.")).classes("opacity-80")
    for spec in specs:
        _line(context, view, spec)
    known = {spec.id for spec in specs}
    for call in context.hub.state.calls:
        if call.sensor not in known:
            _line(context, view, SensorSpec(id=call.sensor, room=0), is_new=True)


def _line(context: Context, view: View, spec: SensorSpec, *, is_new: bool = False) -> None:
    _ = view.words
    called = max((call.at for call in context.hub.state.calls if call.sensor == spec.id), default=float("-inf"))
    is_calling = time.monotonic() - called < _CALLS_FOR
    room = next((each.name for each in context.hub.rooms if each.id == spec.room), "")
    with ui.row().classes(f"w-full items-center no-wrap{' console-calls' if is_calling else ''}"):
        ui.icon("sensors" if spec.enabled else "sensors_off", size="22px").props('aria-hidden="true"')
        with ui.column().classes("gap-0"):
            ui.label(_("Sensor {number}").format(number=spec.id) + (f" · {spec.name}" if spec.name else ""))
            where = _("calls, and has no room yet") if is_new else room
            ui.label(where if spec.enabled else f"{where} · {_('out of service')}").classes("text-sm opacity-80")
        ui.space()
        label = _("Change sensor {number}").format(number=spec.id)
        icon_button("edit", label, lambda: _edit(context, view, spec, is_new=is_new))


async def _edit(context: Context, view: View, spec: SensorSpec | None, *, is_new: bool = False) -> None:
    _, files = view.words, context.house
    rooms = {room.id: room.name for room in context.hub.rooms}
    form = Form(context, view, _("Motion sensor"))
    with form.body:
        number = ui.number(_("Id that it reports"), value=spec.id if spec else None, format="%.0f", min=0, max=255)
        form.add("id", number)
        number.set_enabled(spec is None)
        room = spec.room if spec and not is_new and spec.room in rooms else None
        form.add("room", ui.select(rooms, label=_("Room"), value=room))
        form.add("name", ui.input(_("Where it hangs"), value=spec.name if spec else "").props("maxlength=60"))
        enabled = ui.checkbox(_("In service"), value=spec.enabled if spec else True)

    def save() -> None:
        if form.value("room") is None:
            raise ParamError("room", _("is missing: choose one"))
        edit.save_sensor(
            files,
            int(form.number("id")),
            int(form.value("room")),
            str(form.value("name") or ""),
            is_enabled=bool(enabled.value),
        )

    remove = None if spec is None or is_new else lambda: edit.remove_sensor(files, spec.id)
    await form.run(f"change motion sensor {spec.id if spec else ''}".strip(), save, remove)
