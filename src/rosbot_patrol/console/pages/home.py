"""The home page: what the guard does, the mode, what needs attention, camera and map."""

from __future__ import annotations

from nicegui import ui
from starlette.requests import Request

from rosbot_patrol.console.live.orders import DISARMED
from rosbot_patrol.console.pages.camera_view import camera_view
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View, follow, frame, say
from rosbot_patrol.console.pages.map_view import map_view
from rosbot_patrol.console.sentences import ICONS, MODES, headline, mode_name


def home_page(context: Context, request: Request) -> None:
    """Draw the page."""
    with frame(context, request, "/") as view, ui.element("div").classes("console-columns"):
        with ui.column().classes("gap-3"):
            _headline(context, view)
            _modes(context, view)
            _attention(context, view)
            if view.account.role.may_watch:
                with ui.card().classes("w-full p-0 overflow-hidden"):
                    camera_view(context, view)
        with ui.column().classes("gap-3"):
            if view.account.role.may_watch:
                with ui.card().classes("w-full"):
                    map_view(context, view)
            if view.account.role.may_order:
                _orders(context, view)


def _headline(context: Context, view: View) -> None:
    with (
        ui.card().classes("w-full").props('role="status" aria-live="polite"') as card,
        ui.row().classes("items-center no-wrap w-full"),
    ):
        icon = ui.icon("", size="36px").props('aria-hidden="true"')
        with ui.column().classes("gap-0"):
            text = ui.label().classes("text-xl").mark("headline")
            detail = ui.label().classes("text-sm opacity-80")
    share = ui.linear_progress(value=0.0, show_value=False, size="6px").props(
        f'aria-label="{view.words("Share of the floor that was seen")}"'
    )
    share.move(card)

    def refresh() -> None:
        state = context.hub.state
        now = headline(state, view.words)
        text.text, detail.text = now.text, now.detail
        icon.props(f'name="{now.icon}" color="{now.colour}"')
        detail.set_visibility(bool(now.detail))
        seen = state.guard.share_seen if state.guard is not None and state.guard.doing == "looking" else None
        share.set_visibility(seen is not None)
        share.value = seen or 0.0

    follow(context.hub, refresh)


def _modes(context: Context, view: View) -> None:
    _ = view.words
    with ui.card().classes("w-full"):
        ui.label(_("Mode")).classes("text-sm opacity-80")
        with ui.row().classes("w-full gap-2").props(f'role="group" aria-label="{_("Mode")}"'):
            buttons = {mode: _mode_button(context, view, mode) for mode in MODES}
        why = ui.label().classes("text-sm opacity-80")

    def refresh() -> None:
        arming = context.hub.state.arming
        for mode, button in buttons.items():
            is_on = arming is not None and arming.mode == mode
            button.props(remove="outline unelevated").props("unelevated" if is_on else "outline")
            button.props(f'aria-pressed="{str(is_on).lower()}"')
        why.text = _("Leave within {n} s.").format(n=round(arming.exit_delay)) if arming and arming.exit_delay else ""
        why.set_visibility(bool(why.text))

    follow(context.hub, refresh)


def _mode_button(context: Context, view: View, mode: str) -> ui.button:
    async def change() -> None:
        code = ""
        if mode == DISARMED and context.door.accounts.has_code:
            code = await _ask_code(view)
            if not code:
                return
        say(view, await context.desk.arm(view.visitor, mode, code))

    button = ui.button(mode_name(mode, view.words), icon=ICONS[mode], on_click=change)
    button.props("no-caps outline").classes("console-mode").mark(mode)
    button.set_enabled(view.account.role.may_order)
    return button


async def _ask_code(view: View) -> str:
    _ = view.words
    with ui.dialog() as dialog, ui.card():
        typed = ui.input(_("Code"), password=True).props('inputmode="numeric" autocomplete="off" autofocus')
        typed.on("keydown.enter", lambda: dialog.submit(typed.value))
        with ui.row().classes("w-full justify-end"):
            ui.button(_("Not now"), on_click=lambda: dialog.submit("")).props("flat no-caps")
            ui.button(_("Disarm"), on_click=lambda: dialog.submit(typed.value)).props("unelevated no-caps")
    code = await dialog
    dialog.delete()
    return str(code or "")


def _attention(context: Context, view: View) -> None:
    """What somebody should look after, the worst first."""
    _ = view.words
    box = ui.column().classes("w-full gap-2")

    def refresh() -> None:
        state = context.hub.state
        found = state.worst_first
        box.clear()
        with box:
            for problem in found[:4]:
                kind = "console-error" if problem.is_error else "console-warning"
                with ui.row().classes(f"console-problem {kind} no-wrap items-start w-full"):
                    ui.icon("error" if problem.is_error else "warning", size="22px").props('aria-hidden="true"')
                    ui.label(problem.text)
            if len(found) > 4:
                ui.link(_("{n} more").format(n=len(found) - 4), "/health")
            for room, until in state.arming.muted if state.arming is not None else ():
                _draw_muted(context, view, room, until)
            if context.door.accounts.is_open:
                with ui.row().classes("console-problem console-note no-wrap items-center w-full"):
                    ui.icon("key", size="22px").props('aria-hidden="true"')
                    ui.link(_("Set a password to use this page from your phone."), "/settings")

    follow(context.hub, refresh)


def _draw_muted(context: Context, view: View, room: int, until: float) -> None:
    _ = view.words
    name = next((each.name for each in context.hub.rooms if each.id == room), str(room))

    async def end() -> None:
        say(view, await context.desk.mute(view.visitor, room, name, 0.0))

    with ui.row().classes("console-problem console-note no-wrap items-center w-full"):
        ui.icon("volume_off", size="22px").props('aria-hidden="true"')
        ui.label(_("{room} is left alone until {time}.").format(room=name, time=view.time(until, "HH:mm")))
        ui.space()
        if view.account.role.may_order:
            ui.button(_("Guard it again"), on_click=end).props("flat dense no-caps")


def _orders(context: Context, view: View) -> None:
    _ = view.words
    desk, visitor = context.desk, view.visitor

    async def look(number: int, name: str) -> None:
        say(view, await desk.look(visitor, number, name))

    async def look_at_all() -> None:
        say(view, await desk.look_at_all(visitor))

    async def home() -> None:
        say(view, await desk.home(visitor))

    async def cancel() -> None:
        say(view, await desk.cancel(visitor))

    with ui.card().classes("w-full"):
        with ui.row().classes("w-full gap-2"):
            ui.button(_("Look at all rooms"), icon="travel_explore", on_click=look_at_all).props("no-caps outline")
            ui.button(_("Drive home"), icon="home", on_click=home).props("no-caps outline")
            ui.button(_("Give up"), icon="close", on_click=cancel).props("no-caps outline")
        ui.label(_("Look now")).classes("text-sm opacity-80")
        with ui.row().classes("w-full gap-2"):
            for room in context.hub.rooms:
                ui.button(room.name, icon="visibility", on_click=lambda room=room: look(room.id, room.name)).props(
                    "no-caps flat dense"
                ).mark(f"look-{room.id}")
