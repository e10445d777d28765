"""What all pages have in common: the bar with the emergency stop, the way to the other pages, language and theme."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime

from babel.dates import format_datetime
from nicegui import ui
from starlette.requests import Request

from rosbot_patrol.console.access.accounts import Account
from rosbot_patrol.console.access.gate import peer_of
from rosbot_patrol.console.live.hub import Hub
from rosbot_patrol.console.live.orders import Answer, Visitor
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.told import told
from rosbot_patrol.console.words import Words, language_of, words_of

_PERIOD = 0.1  # [s] between two looks for news
_THEMES = {"auto": None, "light": False, "dark": True}


@dataclass(frozen=True, kw_only=True)
class View:
    """One page that somebody has opened.

    Attributes:
        visitor: who.
        language: "en" or "de".
    """

    visitor: Visitor
    language: str

    @property
    def account(self) -> Account:
        """Who it is."""
        return self.visitor.account

    @property
    def words(self) -> Words:
        """Texts in their language."""
        return words_of(self.language)

    def time(self, wall: float, pattern: str) -> str:
        """A time in the robot's time zone, in their language, by a date pattern of Unicode (CLDR)."""
        return str(format_datetime(datetime.fromtimestamp(wall), pattern, locale=self.language))


def _pages(_: Words) -> tuple[tuple[str, str, str], ...]:
    return (
        ("/", "shield", _("Overview")),
        ("/incidents", "history", _("Incidents")),
        ("/drive", "sports_esports", _("Drive")),
        ("/house", "house", _("House")),
        ("/health", "monitor_heart", _("Health")),
        ("/settings", "settings", _("Settings")),
    )


@contextmanager
def frame(context: Context, request: Request, path: str) -> Iterator[View]:
    """Draw the common parts around a page.

    Args:
        context: of the console.
        request: for the page.
        path: of the page, or of the one that it belongs to.
    """
    account: Account = request.state.account
    language = account.language or language_of(request.headers.get("accept-language", ""))
    _ = words_of(language)
    view = View(visitor=Visitor(account=account, peer=peer_of(request.scope)), language=language)
    ui.add_head_html(
        '<link rel="manifest" href="/manifest.webmanifest"><link rel="stylesheet" href="/style.css">'
        '<meta name="theme-color" content="#1565c0">'
        f'<script>document.documentElement.lang = "{language}"</script>'
    )
    ui.colors(primary="#1565c0", negative="#b71c1c", positive="#1b5e20", warning="#8a4b00", info="#01579b")
    ui.dark_mode(_THEMES.get(account.theme))
    title = next((name for link, _icon, name in _pages(_) if link == path), "rosbot_patrol")
    ui.page_title(f"{title} · rosbot_patrol")
    with ui.header().classes("items-center no-wrap gap-2 px-3 py-2"):
        ui.label("rosbot_patrol").classes("text-lg")
        with ui.element("nav").classes("flex no-wrap gap-1 max-md:hidden").props(f'aria-label="{_("Pages")}"'):
            _links(_, path, "text-white")
        ui.space()
        _stop_button(context, view)
    with (
        ui.footer().classes("md:hidden p-0"),
        ui.element("nav").classes("flex no-wrap justify-around w-full").props(f'aria-label="{_("Pages")}"'),
    ):
        _links(_, path, "text-white", is_small=True)
    with ui.element("main").classes("console-page"):
        yield view


def _links(_: Words, here: str, colour: str, *, is_small: bool = False) -> None:
    for link, icon, name in _pages(_):
        current = ' aria-current="page"' if link == here else ""
        size = "stack size=sm" if is_small else ""
        with ui.element("a").props(f'href="{link}"{current}').classes(f"console-link {colour} {size}"):
            ui.icon(icon, size="22px").props('aria-hidden="true"')
            ui.label(name)


def _stop_button(context: Context, view: View) -> None:
    _ = view.words
    if not view.account.role.may_order:
        return

    async def press() -> None:
        say(view, await context.desk.stop(view.visitor, pressed=True))

    async def release() -> None:
        if await sure(view, _("Release the emergency stop? The robot may drive at once."), _("Release")):
            say(view, await context.desk.stop(view.visitor, pressed=False))

    stop = ui.button(_("Stop"), icon="pan_tool", color="negative", on_click=press)
    stop.props("unelevated size=lg no-caps").classes("console-stop")
    free = ui.button(_("Release stop"), icon="lock_open", color="warning", on_click=release).props("unelevated no-caps")

    def refresh() -> None:
        is_stopped = context.hub.state.is_stopped
        stop.set_visibility(not is_stopped)
        free.set_visibility(is_stopped)

    follow(context.hub, refresh)


def follow(hub: Hub, refresh: Callable[[], object], *, scene: bool = False) -> None:
    """Draw something now, and again whenever the house's state (or the scene) changes."""
    drawn = -1

    def look() -> None:
        nonlocal drawn
        version = hub.scene_version if scene else hub.version
        if version != drawn:
            drawn = version
            refresh()

    look()
    ui.timer(0.2 if scene else _PERIOD, look)


def say(view: View, answer: Answer) -> None:
    """Show what came of an order."""
    text = told(answer.text, view.words)
    text = f"{text[:1].upper()}{text[1:]}"
    ui.notify(text, type="positive" if answer.accepted else "negative", multi_line=True, position="top")


def say_problem(view: View, problem: object) -> None:
    """Show why something was not done."""
    say(view, Answer(accepted=False, text=str(problem)))


async def sure(view: View, question: str, yes: str) -> bool:
    """Ask before something that is hard to undo."""
    with ui.dialog() as dialog, ui.card():
        ui.label(question).classes("text-lg")
        with ui.row().classes("w-full justify-end"):
            ui.button(view.words("Not now"), on_click=lambda: dialog.submit(False)).props("flat no-caps")
            ui.button(yes, on_click=lambda: dialog.submit(True)).props("unelevated no-caps")
    answer = await dialog
    dialog.delete()
    return bool(answer)
