"""The live camera on a page, with the boxes of the detector drawn over it by the browser."""

from __future__ import annotations

from html import escape

from nicegui import ui

from rosbot_patrol.console.live.house_state import Box
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import View, follow

_SILENT = 3  # [s] without a picture until the page says so


def camera_view(context: Context, view: View) -> None:
    """Draw the camera."""
    _ = view.words
    with ui.element("div").classes("console-camera"):
        picture = ui.element("img").props('src="/camera.mjpg"')
        picture.props["alt"] = _("Live picture of the robot's camera")
        boxes = ui.html("", sanitize=False).classes("console-over")
        silent = ui.label(_("No picture from the camera.")).classes("console-silent")
    shown, since = context.hub.picture_number, 0

    def listen() -> None:
        nonlocal shown, since
        number = context.hub.picture_number
        shown, since = number, 0 if number != shown else since + 1
        silent.set_visibility(since >= _SILENT)

    silent.set_visibility(False)
    ui.timer(1.0, listen)

    def refresh() -> None:
        scene = context.hub.scene
        columns, rows = scene.picture_size
        drawn = "".join(map(_drawn, scene.boxes))
        boxes.content = (
            f'<svg viewBox="0 0 {columns} {rows}" preserveAspectRatio="none" aria-hidden="true">{drawn}</svg>'
        )

    follow(context.hub, refresh, scene=True)


def _drawn(box: Box) -> str:
    width, height = box.xmax - box.xmin, box.ymax - box.ymin
    return (
        f'<rect x="{box.xmin}" y="{box.ymin}" width="{width}" height="{height}" class="box"/>'
        f'<text x="{box.xmin + 4}" y="{max(box.ymin - 6, 14)}" class="box-text">'
        f"{escape(box.label)} {box.probability:.0%}</text>"
    )
