"""Settings: language and theme of the one who looks; people, passwords and the alarm code, for owners."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from nicegui import ui
from starlette.requests import Request

from rosbot_patrol.console.access.accounts import SHORTEST, Account, Role
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View, frame, say_problem, sure
from rosbot_patrol.console.words import Words
from rosbot_patrol.errors import AccessError


def settings_page(context: Context, request: Request) -> None:
    """Draw the page."""
    with frame(context, request, "/settings") as view, ui.element("div").classes("console-columns"):
        with ui.column().classes("gap-3"):
            _looks(context, view)
            if not context.door.accounts.is_open:
                _own_password(context, view)
        if view.account.role.may_manage:
            with ui.column().classes("gap-3"):
                _people(context, view)
                _code(context, view)


def _role_names(_: Words) -> dict[str, str]:
    return {
        Role.OWNER.value: _("Owner: everything"),
        Role.MEMBER.value: _("Member: orders, camera and map"),
        Role.GUEST.value: _("Guest: what happened, nothing live"),
    }


def _looks(context: Context, view: View) -> None:
    _ = view.words
    languages = {"": _("As the browser asks"), "en": "English", "de": "Deutsch"}
    themes = {"auto": _("As the device has it"), "light": _("Light"), "dark": _("Dark")}
    with ui.card().classes("w-full"):
        ui.label(_("Appearance")).classes("text-lg").props('role="heading" aria-level="2"')
        language = ui.select(languages, value=view.account.language, label=_("Language")).classes("w-full")
        theme = ui.select(themes, value=view.account.theme, label=_("Theme")).classes("w-full")

        async def save() -> None:
            prefer = context.door.accounts.prefer
            await _try(view, lambda: prefer(view.account, language=str(language.value), theme=str(theme.value)))

        language.on_value_change(save)
        theme.on_value_change(save)


def _own_password(context: Context, view: View) -> None:
    _ = view.words
    with ui.card().classes("w-full"):
        ui.label(_("Signed in as {name}").format(name=view.account.name)).classes("text-lg")
        password = _password_field(_("New password"))

        async def change() -> None:
            if context.desk.may(view.visitor) or not view.account.role.may_order:
                accounts = context.door.accounts
                await _try(view, lambda: accounts.change_password(view.account.name, password.value or ""))

        with ui.row():
            ui.button(_("Change password"), on_click=change).props("outline no-caps")
            with ui.element("form").props('method="post" action="/sign-out"'):
                ui.button(_("Sign out"), icon="logout").props('outline no-caps type="submit"')


def _people(context: Context, view: View) -> None:
    _, accounts = view.words, context.door.accounts
    with ui.card().classes("w-full"):
        ui.label(_("People")).classes("text-lg").props('role="heading" aria-level="2"')
        if accounts.is_open:
            ui.label(_("Nobody has a password yet. The first one is the owner.")).classes("opacity-80")
        for account in accounts.people:
            _draw_person(context, view, account)
        ui.separator()
        name = ui.input(_("Name")).props('maxlength=40 autocomplete="off"').classes("w-full")
        first = Role.OWNER if accounts.is_open else Role.MEMBER
        role = ui.select(_role_names(_), value=first.value, label=_("Role")).classes("w-full")
        password = _password_field(_("Password"))

        async def add() -> None:
            what = f"add {name.value} as {role.value}"
            added = lambda: accounts.add(str(name.value or ""), Role(str(role.value)), str(password.value or ""))  # noqa: E731
            await _manage(context, view, what, added)

        ui.button(_("Add"), icon="person_add", on_click=add).props("unelevated no-caps").mark("add-person")


def _draw_person(context: Context, view: View, account: Account) -> None:
    _, accounts = view.words, context.door.accounts

    async def remove() -> None:
        if await sure(view, _("Remove {name}?").format(name=account.name), _("Remove")):
            await _manage(context, view, f"remove {account.name}", lambda: accounts.remove(account.name))

    with ui.row().classes("items-center w-full no-wrap"):
        ui.icon("person", size="22px").props('aria-hidden="true"')
        ui.label(account.name)
        ui.label(_role_names(_)[account.role.value].partition(":")[0]).classes("opacity-80")
        ui.space()
        remove_text = _("Remove {name}").format(name=account.name)
        ui.button(icon="delete", on_click=remove).props("flat round").props["aria-label"] = remove_text


def _code(context: Context, view: View) -> None:
    _, accounts = view.words, context.door.accounts
    with ui.card().classes("w-full"):
        ui.label(_("Alarm code")).classes("text-lg").props('role="heading" aria-level="2"')
        state = _("A code is set: disarming asks for it.") if accounts.has_code else _("No code is set.")
        ui.label(state).classes("opacity-80")
        code = ui.input(_("4 to 8 digits; empty: none"), password=True).props('inputmode="numeric" autocomplete="off"')
        code.classes("w-full").mark("new-code")

        async def save() -> None:
            await _manage(context, view, "change the alarm code", lambda: accounts.set_code(str(code.value or "")))

        ui.button(_("Set code"), on_click=save).props("outline no-caps").mark("set-code")


def _password_field(label: str) -> ui.input:
    field = ui.input(label, password=True, password_toggle_button=True)
    return field.props(f'autocomplete="new-password" minlength="{SHORTEST}"').classes("w-full")


async def _manage(context: Context, view: View, what: str, change: Callable[[], object]) -> None:
    if not context.desk.may(view.visitor, manage=True):
        say_problem(view, view.words("You may not do that, or are signed out."))
    elif await _try(view, change):
        context.desk.note(view.visitor, what)


async def _try(view: View, change: Callable[[], object]) -> bool:
    """Change something; the page is drawn anew, or says why not."""
    try:
        await asyncio.to_thread(change)
    except AccessError as err:
        say_problem(view, f"{err}.")
        return False
    except OSError as err:
        say_problem(view, err)
        return False
    ui.navigate.reload()
    return True
