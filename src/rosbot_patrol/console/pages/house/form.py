"""Forms for the house's files: a wrong value has its reason at its field, and nothing is saved."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Mapping
from typing import Any

from nicegui import ui
from nicegui.elements.mixins.validation_element import ValidationElement

from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View, say_problem
from rosbot_patrol.console.told import told
from rosbot_patrol.errors import AccessError, ParamError

Fields = Mapping[str, ValidationElement[Any]]

_INDEX = re.compile(r"\[\d+\]$")


class Form:
    """A dialog with fields.

    Args:
        context: of the console.
        view: of the visitor.
        title: of the dialog.
    """

    def __init__(self, context: Context, view: View, title: str) -> None:
        self._context, self._view = context, view
        self.fields: dict[str, ValidationElement[Any]] = {}
        with ui.context.client.content:  # not in the line of a list, which may be drawn anew meanwhile
            self._dialog = ui.dialog()
        with self._dialog, ui.card().classes("w-full max-w-md"):
            ui.label(title).classes("text-lg").props('role="heading" aria-level="2"')
            self.body = ui.column().classes("w-full gap-2")
            self._problem = ui.label().classes("console-problem console-error w-full").props('role="alert"')
            self._buttons = ui.row().classes("w-full justify-end")
        self._problem.set_visibility(False)

    def add(self, key: str, field: ValidationElement[Any]) -> None:
        """Tell of a field, by the name of its key in the file."""
        self.fields[key] = field.classes("w-full")

    def value(self, key: str) -> Any:
        """What stands in a field."""
        return getattr(self.fields[key], "value", None)

    def number(self, key: str) -> float:
        """The number in a field. Raises ParamError."""
        value = self.value(key)
        if not isinstance(value, (int, float)):
            raise ParamError(key, self._view.words("is missing, expected a number"))
        return float(value)

    def close(self) -> None:
        """Close the dialog; nothing is saved."""
        self._dialog.submit(False)

    async def run(self, what: str, save: Callable[[], None], remove: Callable[[], None] | None = None) -> bool:
        """Show the dialog until something is saved or removed, or it is closed; returns whether anything was.

        Args:
            what: is changed, for the record of orders.
            save: writes what the fields hold; may raise ParamError, AccessError and OSError.
            remove: removes it; None: there is nothing to remove.
        """
        _ = self._view.words

        async def try_to(change: Callable[[], None]) -> None:
            if await self._try(change):
                self._context.desk.note(self._view.visitor, what)
                self._dialog.submit(True)

        with self._buttons:
            if remove is not None:
                ui.button(_("Remove"), color="negative", on_click=lambda: try_to(remove)).props("flat no-caps")
                ui.space()
            ui.button(_("Not now"), on_click=lambda: self._dialog.submit(False)).props("flat no-caps")
            ui.button(_("Save"), on_click=lambda: try_to(save)).props("unelevated no-caps").mark("save")
        done = await self._dialog
        self._dialog.delete()
        return bool(done)

    async def _try(self, change: Callable[[], None]) -> bool:
        self._problem.set_visibility(False)
        for field in self.fields.values():
            field.error = None
        if not self._context.desk.may(self._view.visitor, manage=True):
            self._say(self._view.words("You may not do that, or are signed out."))
            return False
        try:
            await asyncio.to_thread(change)
            await asyncio.to_thread(self._context.follow_house)
        except ParamError as err:
            self._say_at_field(err)
        except (AccessError, OSError) as err:
            self._say(told(str(err), self._view.words))
        else:
            return True
        return False

    def _say_at_field(self, err: ParamError) -> None:
        key = _INDEX.sub("", err.name.rpartition("/")[2].rpartition(": ")[2])
        field = self.fields.get(key)
        text = told(err.problem, self._view.words)
        if field is None:
            self._say(f"{key}: {text}")
        else:
            field.error = f"{text[:1].upper()}{text[1:]}"

    def _say(self, text: str) -> None:
        self._problem.text = f"{text[:1].upper()}{text[1:]}"
        self._problem.set_visibility(True)


async def change(context: Context, view: View, what: str, do: Callable[[], object]) -> bool:
    """Change something without a form, if the visitor may; says why not."""
    if not context.desk.may(view.visitor, manage=True):
        say_problem(view, view.words("You may not do that, or are signed out."))
        return False
    try:
        await asyncio.to_thread(do)
        await asyncio.to_thread(context.follow_house)
    except (ParamError, AccessError, OSError) as err:
        say_problem(view, err)
        return False
    context.desk.note(view.visitor, what)
    return True


def icon_button(icon: str, label: str, on_click: Callable[[], Any]) -> ui.button:
    """A button with an icon, and a name for those who do not see it; a name may hold any letters."""
    button = ui.button(icon=icon, on_click=on_click).props("flat round dense")
    button.props["aria-label"] = label
    return button


def follow_house(context: Context, refresh: Callable[[], object], *, calls: bool = False) -> None:
    """Draw something now, and again whenever the house's files change, or with `calls` a sensor calls."""
    drawn: object = None

    def look() -> None:
        nonlocal drawn
        state = context.hub.state
        shown = (state.house, state.calls if calls else ())
        if shown != drawn:
            drawn = shown
            refresh()

    look()
    ui.timer(0.2, look)
