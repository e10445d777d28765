"""Parts of a file, as players of videos ask for them."""

import pytest
from starlette.responses import PlainTextResponse, Response

from rosbot_patrol.console.web.part import part_of

WHOLE = b"0123456789"


def ask(wanted: str) -> Response:
    return part_of(Response(WHOLE, media_type="video/mp4"), wanted, {"Cache-Control": "private"})


@pytest.mark.parametrize("wanted", ["", "bytes=-", "bytes=a-b", "items=0-3", "bytes=0-1,4-5"])
def test_who_asks_for_no_part_gets_the_whole(wanted: str) -> None:
    answer = ask(wanted)
    assert (answer.status_code, bytes(answer.body)) == (200, WHOLE)
    assert answer.headers["accept-ranges"] == "bytes"


@pytest.mark.parametrize(
    ("wanted", "part", "told"),
    [
        ("bytes=0-1", b"01", "bytes 0-1/10"),
        ("bytes=8-", b"89", "bytes 8-9/10"),
        ("bytes=-3", b"789", "bytes 7-9/10"),
        ("bytes=-30", WHOLE, "bytes 0-9/10"),
        ("bytes=5-99", b"56789", "bytes 5-9/10"),
    ],
)
def test_a_part(wanted: str, part: bytes, told: str) -> None:
    answer = ask(wanted)
    assert (answer.status_code, bytes(answer.body), answer.headers["content-range"]) == (206, part, told)
    assert answer.headers["cache-control"] == "private"


@pytest.mark.parametrize("wanted", ["bytes=10-", "bytes=5-4"])
def test_a_part_that_is_not_there(wanted: str) -> None:
    assert ask(wanted).status_code == 416


def test_what_is_missing_stays_missing() -> None:
    assert part_of(PlainTextResponse("none", 404), "bytes=0-1", {}).status_code == 404
