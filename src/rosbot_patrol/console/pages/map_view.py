"""The live map on a page: robot, way, rooms and people. A tap on a room or on a place offers what can be done there."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable, Iterable
from html import escape

from nicegui import events, ui

from rosbot_patrol.console.live.house_state import RoomMark, SeenFloor
from rosbot_patrol.console.live.hub import MAP
from rosbot_patrol.console.live.map_picture import MapPicture
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View, follow, say

_REACH = 1.2  # [m] around a room's point within which a tap means the room
_ACROSS = 26  # room names are at least so much smaller than the map's width, to be read on a phone
_LETTERS = 18  # of a room's name on the map
_TAP = """(e) => {
  const r = e.currentTarget.getBoundingClientRect();
  emit({x: (e.clientX - r.left) / r.width, y: (e.clientY - r.top) / r.height});
}"""


def map_view(context: Context, view: View) -> None:
    """Draw the map."""

    async def tap(x: float, y: float) -> None:
        if view.account.role.may_order:
            await _offer(context, view, x, y)

    map_plan(context, view, tap)


def map_plan(
    context: Context,
    view: View,
    tap: Callable[[float, float], Awaitable[None]],
    more: Callable[[MapPicture], str] = lambda _: "",
) -> Callable[[], None]:
    """Draw the live map.

    Args:
        context: of the console.
        view: of the visitor.
        tap: told the place in map [m] of each tap.
        more: SVG drawn over it, in the map's pixels.

    Returns:
        Draws it anew.
    """
    _ = view.words
    hub = context.hub
    hub.look(MAP, 1)
    ui.context.client.on_delete(lambda: hub.look(MAP, -1))
    with ui.element("div").classes("console-map") as plan:
        picture = ui.element("img").props(f'alt="{escape(_("Map of the house"))}"')
        over = ui.html("", sanitize=False).classes("console-over")
    waiting = ui.label(_("Waiting for the map.")).classes("opacity-70")
    shown = -1

    def refresh() -> None:
        nonlocal shown
        found = hub.map
        plan.set_visibility(found is not None)
        waiting.set_visibility(found is None)
        if found is None:
            return
        if found.number != shown:
            shown = found.number
            picture.props(f'src="/map.png?{found.number}"')
        over.content = _drawn(context, found, more(found))

    async def on_tap(event: events.GenericEventArguments) -> None:
        found = hub.map
        if found is not None:
            place = found.place(float(event.args["x"]) * found.width, float(event.args["y"]) * found.height)
            await tap(float(place[0]), float(place[1]))

    plan.on("click", on_tap, js_handler=_TAP)
    follow(hub, refresh)
    follow(hub, refresh, scene=True)
    return refresh


async def _offer(context: Context, view: View, x: float, y: float) -> None:
    _ = view.words
    room = min(context.hub.rooms, key=lambda each: math.hypot(each.x - x, each.y - y), default=None)
    with ui.dialog() as dialog, ui.card().classes("min-w-64"):
        if room is not None and math.hypot(room.x - x, room.y - y) <= _REACH:
            ui.label(room.name).classes("text-lg")
            ui.button(_("Look there now"), icon="visibility", on_click=lambda: dialog.submit("look")).props("no-caps")
        else:
            ui.label(_("A place on the map")).classes("text-lg")
        ui.button(_("Drive there"), icon="navigation", on_click=lambda: dialog.submit("drive")).props("outline no-caps")
        ui.button(_("Not now"), on_click=lambda: dialog.submit("")).props("flat no-caps")
    choice = await dialog
    dialog.delete()
    if choice == "look" and room is not None:
        say(view, await context.desk.look(view.visitor, room.id, room.name))
    elif choice == "drive":
        say(view, await context.desk.drive_to(view.visitor, x, y))


def _drawn(context: Context, found: MapPicture, more: str) -> str:
    """The overlay as SVG, in the map's pixels."""
    state, scene, guard = context.hub.state, context.hub.scene, context.hub.state.guard
    unit = 0.1 / found.resolution  # pixels of 10 cm
    parts = [_seen(scene.seen, found)] if scene.seen is not None else []
    parts += [f'<polygon points="{points_text(zone.points, found)}" class="zone"/>' for zone in state.zones]
    for thing in state.known:
        column, row = found.pixel(thing.x, thing.y)
        radius = thing.radius / found.resolution
        parts.append(f'<circle cx="{column:.0f}" cy="{row:.0f}" r="{radius:.0f}" class="known"/>')
    if scene.path:
        points = points_text(scene.path, found)
        parts.append(f'<polyline points="{points}" class="way" stroke-width="{unit:.1f}"/>')
    goal = guard.room_id if guard is not None and guard.doing in ("driving", "looking") else None
    parts += [_room(room, found, unit, is_goal=room.id == goal) for room in context.hub.rooms]
    for place in scene.people:
        column, row = found.pixel(*place)
        parts.append(f'<circle cx="{column:.0f}" cy="{row:.0f}" r="{2.5 * unit:.1f}" class="somebody"/>')
    if scene.robot is not None:
        x, y, yaw = scene.robot
        column, row = found.pixel(x, y)
        turn = f"translate({column:.1f} {row:.1f}) rotate({-math.degrees(yaw):.1f}) scale({unit:.2f})"
        parts.append(f'<path d="M 3.2 0 L -2 2.2 L -1.1 0 L -2 -2.2 Z" transform="{turn}" class="robot"/>')
    return f'<svg viewBox="0 0 {found.width} {found.height}" aria-hidden="true">{"".join(parts)}{more}</svg>'


def _seen(seen: SeenFloor, found: MapPicture) -> str:
    (left, top), (right, bottom) = found.pixel(seen.left, seen.top), found.pixel(seen.right, seen.bottom)
    return (
        f'<image href="data:image/png;base64,{seen.png}" x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" '
        f'height="{bottom - top:.1f}" preserveAspectRatio="none" class="seen"/>'
    )


def points_text(places: Iterable[tuple[float, float]], found: MapPicture) -> str:
    """Places in map [m] as SVG has points."""
    return " ".join(f"{column:.0f},{row:.0f}" for column, row in (found.pixel(*place) for place in places))


def _room(room: RoomMark, found: MapPicture, unit: float, *, is_goal: bool) -> str:
    column, row = found.pixel(room.x, room.y)
    kind = "room goal" if is_goal else "room"
    size = max(4.2 * unit, found.width / _ACROSS)
    name = room.name if len(room.name) <= _LETTERS else f"{room.name[: _LETTERS - 1]}…"
    half = 0.27 * size * len(name)
    middle = min(max(column, half), max(found.width - half, half))
    return (
        f'<circle cx="{column:.0f}" cy="{row:.0f}" r="{1.8 * unit:.1f}" class="{kind}"/>'
        f'<text x="{middle:.0f}" y="{row - 2.6 * unit:.0f}" class="room-text" style="--size: {size:.0f}px">'
        f"{escape(name)}</text>"
    )
