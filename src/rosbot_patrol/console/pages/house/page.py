"""The page of the house, with its parts in tabs, and the undo of the last change."""

from __future__ import annotations

from nicegui import ui
from starlette.requests import Request

from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View, follow, frame
from rosbot_patrol.console.pages.house.channels import channels_part
from rosbot_patrol.console.pages.house.form import change
from rosbot_patrol.console.pages.house.map_editor import MapEditor
from rosbot_patrol.console.pages.house.sensors import sensors_part
from rosbot_patrol.console.pages.house.times import times_part


def house_page(context: Context, request: Request) -> None:
    """Draw the page."""
    with frame(context, request, "/house") as view:
        _ = view.words
        if not view.account.role.may_manage:
            ui.label(_("Only owners change the house.")).classes("text-xl").props('role="alert"')
            return
        _undo(context, view)
        names = {"map": _("Map"), "sensors": _("Sensors"), "times": _("Times"), "channels": _("Notices")}
        with ui.tabs().classes("w-full").props("no-caps") as tabs:
            for key, name in names.items():
                ui.tab(key, label=name)
        with ui.tab_panels(tabs, value="map").classes("w-full bg-transparent"):
            with ui.tab_panel("map").classes("p-0 pt-3"):
                MapEditor(context, view).draw()
            with ui.tab_panel("sensors").classes("p-0 pt-3"):
                sensors_part(context, view)
            with ui.tab_panel("times").classes("p-0 pt-3"):
                times_part(context, view)
            with ui.tab_panel("channels").classes("p-0 pt-3"):
                channels_part(context, view)


def _undo(context: Context, view: View) -> None:
    _ = view.words

    async def undo() -> None:
        if await change(context, view, "undo the last change of the house", context.house.undo):
            ui.navigate.reload()

    button = ui.button(icon="undo", on_click=undo).props("outline no-caps").mark("undo")

    def refresh() -> None:
        what = context.house.undoable
        button.text = _("Undo: {what}").format(what=what)
        button.set_visibility(bool(what))

    follow(context.hub, refresh)
    ui.timer(1.0, refresh)
