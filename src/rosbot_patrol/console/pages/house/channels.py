"""Ways to the owner: what there is, a test of each, and forms for more."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any

from nicegui import ui

from rosbot_patrol.console.house import edit
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View, say
from rosbot_patrol.console.pages.house.form import Form, change, follow_house, icon_button
from rosbot_patrol.errors import ParamError


def channels_part(context: Context, view: View) -> None:
    """Draw the part."""
    _ = view.words
    with ui.card().classes("w-full gap-2"):
        ui.label(_("Ways to you")).classes("text-lg").props('role="heading" aria-level="2"')
        box = ui.column().classes("w-full gap-1")
        with ui.row().classes("gap-2"):
            for text, icon, form in (
                (_("Add a phone or chat"), "phone_iphone", _edit_phone),
                (_("Add a mail address"), "mail", _edit_mail),
                (_("Add a web address"), "webhook", _edit_web),
            ):
                ui.button(text, icon=icon, on_click=lambda form=form: form(context, view)).props("outline no-caps")

    def refresh() -> None:
        box.clear()
        with box:
            _draw(context, view)

    follow_house(context, refresh)


def _draw(context: Context, view: View) -> None:
    _ = view.words
    try:
        own = edit.channel_types(context.house)
        found = context.channels()
    except ParamError as err:
        ui.label(str(err)).classes("console-problem console-error").props('role="alert"')
        return
    for name, where in found.items():
        with ui.row().classes("w-full items-center no-wrap"):
            ui.icon("outgoing_mail", size="22px").props('aria-hidden="true"')
            with ui.column().classes("gap-0"):
                ui.label(name)
                ui.label(where).classes("text-sm opacity-80")
            ui.space()
            test = ui.button(_("Test"), on_click=partial(_test, context, view, name)).props("outline dense no-caps")
            test.props["aria-label"] = _("Test {name}").format(name=name)
            if name.partition(":")[0] in own:
                icon_button("delete", _("Remove {name}").format(name=name), partial(_remove, context, view, name))


async def _test(context: Context, view: View, name: str) -> None:
    if not context.desk.may(view.visitor, manage=True):
        return
    ui.notify(view.words("Sending a test notice..."), position="top")
    say(view, await asyncio.to_thread(context.try_channel, name))
    context.desk.note(view.visitor, f"test the channel {name}")


async def _remove(context: Context, view: View, name: str) -> None:
    group = name.partition(":")[0]
    await change(context, view, f"remove the channel {group}", lambda: edit.remove_channel(context.house, group))


async def _edit_phone(context: Context, view: View) -> None:
    _ = view.words
    form = Form(context, view, _("Phone or chat"))
    with form.body:
        ui.label(_("An address of Apprise, such as ntfys://ntfy.sh/a-topic-nobody-guesses.")).classes("opacity-80")
        form.add("name", ui.input(_("Name"), value="phone").props("maxlength=40"))
        form.add("url_file", ui.input(_("Address"), password=True, password_toggle_button=True))
        form.add("kinds", _kinds(view))

    def save() -> None:
        secret = str(form.value("url_file") or "")
        given = {"type": "apprise", "kinds": list(form.value("kinds") or ())}
        edit.save_channel(context.house, str(form.value("name") or ""), given, ("url_file", secret))

    await form.run("add a phone or chat", save)


async def _edit_mail(context: Context, view: View) -> None:
    _ = view.words
    form = Form(context, view, _("Mail"))
    with form.body:
        form.add("name", ui.input(_("Name"), value="mail").props("maxlength=40"))
        form.add("to", ui.input(_("Your mail address")))
        form.add("host", ui.input(_("Mail server"), placeholder="smtp.example.org"))
        form.add("port", ui.number(_("Port"), value=587, format="%.0f"))
        security = {
            "starttls": "STARTTLS (587)",
            "tls": "TLS (465)",
            "auto": _("as the server has it"),
            "none": _("none"),
        }
        form.add("security", ui.select(security, value="starttls", label=_("Encryption")))
        form.add("user", ui.input(_("Login; empty: none")).props('autocomplete="off"'))
        password = ui.input(_("Password"), password=True, password_toggle_button=True)
        form.add("password_file", password.props('autocomplete="new-password"'))
        form.add("kinds", _kinds(view))

    def save() -> None:
        user, secret = str(form.value("user") or ""), str(form.value("password_file") or "")
        given: dict[str, Any] = {
            "type": "smtp",
            "to": str(form.value("to") or ""),
            "from": user if "@" in user else "",
            "host": str(form.value("host") or ""),
            "port": int(form.number("port")),
            "security": form.value("security"),
            "user": user,
            "kinds": list(form.value("kinds") or ()),
        }
        name = str(form.value("name") or "")
        edit.save_channel(context.house, name, given, ("password_file", secret) if user else None)

    await form.run("add a mail address", save)


async def _edit_web(context: Context, view: View) -> None:
    _ = view.words
    form = Form(context, view, _("Web address"))
    with form.body:
        ui.label(_("It gets each notice as JSON by POST.")).classes("opacity-80")
        form.add("name", ui.input(_("Name"), value="web").props("maxlength=40"))
        form.add("url", ui.input(_("Address"), placeholder="https://"))
        form.add("kinds", _kinds(view))

    def save() -> None:
        given = {"type": "webhook", "url": str(form.value("url") or ""), "kinds": list(form.value("kinds") or ())}
        edit.save_channel(context.house, str(form.value("name") or ""), given, None)

    await form.run("add a web address", save)


def _kinds(view: View) -> ui.select:
    _ = view.words
    kinds = {
        "incident": _("somebody was seen"),
        "verdict": _("how a patrol ended"),
        "sensor": _("motion sensors"),
        "fault": _("faults"),
    }
    return ui.select(kinds, value=[], multiple=True, label=_("What it gets; none: everything"))
