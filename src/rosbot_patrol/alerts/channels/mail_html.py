"""The part of a mail that phones show: one column, the picture as wide as the screen, facts below it."""

from __future__ import annotations

import time
from html import escape
from string import Template

from rosbot_patrol.alerts.outbox.notice import Notice

_PAGE = Template("""\
<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark"><title>$title</title></head>
<body style="margin:0;padding:0;background:#eceff1;color:#1c2429;
 font:16px/1.45 -apple-system,'Segoe UI',Roboto,'Noto Sans',Helvetica,Arial,sans-serif">
<div style="max-width:600px;margin:0 auto;background:#ffffff">
<div style="background:$colour;color:#ffffff;padding:16px 20px">
<div style="font-size:13px;letter-spacing:.06em;text-transform:uppercase;opacity:.85">$label</div>
<div style="font-size:24px;line-height:1.25;font-weight:600;overflow-wrap:anywhere">$title</div>
<div style="font-size:14px;opacity:.9">$when</div>
</div>
$picture<div style="padding:16px 20px 4px;overflow-wrap:anywhere">$paragraphs</div>
$link$table<div style="padding:12px 20px 20px;color:#78868e;font-size:12px;overflow-wrap:anywhere">
rosbot_patrol &middot; $id</div>
</div></body></html>
""")
_PICTURE = Template('<img src="cid:$cid" alt="what the camera saw" style="display:block;width:100%;height:auto">\n')
_LINK = Template(
    '<div style="padding:0 20px 16px"><a href="$link" style="display:inline-block;padding:11px 18px;border-radius:8px;'
    'background:#1565c0;color:#ffffff;text-decoration:none">Open in the console</a></div>\n'
)
_ROW = Template(
    '<tr><td style="padding:7px 12px 7px 0;color:#5c6b74;font-size:14px;vertical-align:baseline;white-space:nowrap;'
    'border-top:1px solid #e3e8eb">$name</td><td style="padding:7px 0;border-top:1px solid #e3e8eb;'
    'overflow-wrap:anywhere">$value</td></tr>\n'
)
# kind -> label, colour of the head
_LOOKS = {
    "incident": ("Intruder", "#b3261e"),
    "verdict": ("Patrol", "#24566b"),
    "sensor": ("Motion sensors", "#8a5a00"),
    "fault": ("Fault", "#8a5a00"),
    "digest": ("Several notices", "#8a5a00"),
    "test": ("Test", "#24566b"),
}


def html_page(notice: Notice, picture_cid: str = "") -> str:
    """The page of a notice; nothing in the notice can add markup.

    Args:
        notice: the content.
        picture_cid: Content-ID of the picture; "" if there is none.
    """
    label, colour = _LOOKS.get(notice.kind, (notice.kind.capitalize(), "#24566b"))
    rows = "".join(_ROW.substitute(name=_clean(name), value=_clean(value)) for name, value in notice.facts)
    return _PAGE.substitute(
        label=_clean(label),
        colour=colour,
        title=_clean(notice.place or notice.room_name or notice.subject.removeprefix("rosbot patrol: ")),
        when=_clean(time.strftime("%A, %d %B %Y, %H:%M:%S", time.localtime(notice.wall))),
        picture=_PICTURE.substitute(cid=picture_cid) if picture_cid else "",
        paragraphs=_paragraphs(notice.text),
        link=_LINK.substitute(link=_clean(notice.link)) if notice.link else "",
        table=f'<div style="padding:0 20px"><table style="border-collapse:collapse;width:100%">\n{rows}</table></div>\n'
        if rows
        else "",
        id=_clean(notice.id),
    )


def _paragraphs(text: str) -> str:
    parts = [part for part in text.strip().split("\n\n") if part.strip()]
    lines = ["<br>\n".join(_clean(line) for line in part.strip("\n").split("\n")) for part in parts]
    return "".join(f'<p style="margin:0 0 12px">{part}</p>\n' for part in lines)


def _clean(text: str) -> str:
    return escape("".join(c if c.isprintable() else " " for c in text))
