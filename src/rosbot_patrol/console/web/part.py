"""Parts of a file: players of videos ask for them."""

from __future__ import annotations

import re
from collections.abc import Mapping

from starlette.responses import Response

_RANGE = re.compile(r"bytes=(\d{0,12})-(\d{0,12})")


def part_of(whole: Response, wanted: str, headers: Mapping[str, str]) -> Response:
    """The part of a file that a browser asks for (RFC 9110, 14.2), as players of videos do; else the whole.

    Args:
        whole: the answer with the whole file.
        wanted: the request's header Range, "" for none.
        headers: of the file.
    """
    found = _RANGE.fullmatch(wanted)
    size = len(whole.body)
    if whole.status_code != 200 or found is None or not any(found.groups()):
        whole.headers["Accept-Ranges"] = "bytes"
        return whole
    first, last = (int(each) if each else None for each in found.groups())
    if first is None:  # so many of the last
        first, last = max(size - (last or 0), 0), size - 1
    last = min(size - 1 if last is None else last, size - 1)
    if first > last:
        return Response(status_code=416, headers={"Content-Range": f"bytes */{size}"})
    told = {"Content-Range": f"bytes {first}-{last}/{size}", "Accept-Ranges": "bytes", **headers}
    return Response(whole.body[first : last + 1], 206, told, media_type=whole.media_type)
